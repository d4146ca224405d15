"""The public names: users rely on them, so a change to these lists changes the API."""

import ast
import inspect
import pkgutil
from pathlib import Path

import pytest

import paxisim

PUBLIC = """
    Agreement Background BackgroundRangeWarning Calibration Card Chain ComposedScene DeviceError DeviceTimeoutError
    Drive Emulator Faults FittedObject FoundMounts Frame GCS GaussianBump Gel GelMemory Grip History
    InvalidValueError Layer LinearCalibration MagneticPad MagneticSensor MagneticSkin MissingExtraError Mount
    ObjectStart OutputExistsError Pad PadParameters Pads PaxisimError PortAccessError PortNotFoundError Presses
    Profile Protocol ProtocolError RayCluster Recording Score Scene SceneDraw SceneParameter SceneRanges SceneVariation
    Sensor SensorModule SensorQuality SkinDesign Slot SqueezeResult TactileGripper TactileReadout TactileSensor
    TaxelLayout TouchGridReadout UnknownNameError UnsupportedError UnverifiedProfileWarning __version__
    align_clocks attach augment calibrate_readout calibrate_sensor compare_streams compose_scene conform diagnose
    encoding find_mounts find_pads find_presses finger_surface fit_background fit_object flat heights_from_map
    known_grippers known_profiles known_protocols known_sensors load_profile measure_quality mounts_for
    nominal_operator open_sensor place_objects plot_background plot_calibration plot_mounts plot_pads plot_presses
    plot_quality plot_residuals plot_tactile protocol reference_sensor robosuite_gripper_path sensor
    sensor_modules set_surface skin_distance squeeze view warp
"""
AUGMENT = """
    AxisCoupling AxisGain CentreOfPressure Chain ChannelCurve CovariateField Creep Crosstalk DeadBand DeadTaxels
    DirectTransfer Drift Encoding FailingTaxels Firmware FittedGCS GCS GCSReading GelOperator History Hysteresis
    Interference Latency LayoutFault LowPass StatefulTransform NoTactile Offset PadAxisGain Parameter Poisson
    Quantisation RandomWalk Ranges Rotation SampleAndHold Saturation Stiffening SwappedTaxels TaxelBinarization
    TaxelDirection TaxelGain TemperatureDrift TotalForce Transform WhiteNoise encoding parameter parameters
    read_recording
"""
DIAGNOSE = """
    BaselineCause Cause CausePart Derived DetectedCause Diagnosis FittedCause FittedParameter FoundCause FoundPart Free
    Gauge HeldOut Interval LeftOver PerChannelCause Place Reading Symptoms diagnose known_causes register_cause
"""

PACKAGES = {paxisim: PUBLIC, paxisim.augment: AUGMENT, paxisim.diagnose: DIAGNOSE}
DEFINED = [name for name in PUBLIC.split() if name not in ("__version__", "augment", "diagnose", "warp")]


def test_the_public_names_are_these_and_a_star_imports_them():
    for package, names in PACKAGES.items():
        assert sorted(names.split()) == sorted(package.__all__), package.__name__
    names: dict = {}
    exec("from paxisim import *", names)
    assert set(PUBLIC.split()) <= set(names)
    assert set(PUBLIC.split()) <= set(dir(paxisim))
    assert callable(paxisim.diagnose)
    assert paxisim.__version__.split(".")[0].isdigit()


def test_no_public_name_is_that_of_a_module_beside_it():
    """The import of such a module would replace the name."""
    for package, names in PACKAGES.items():
        modules = {found.name for found in pkgutil.iter_modules(package.__path__) if not found.ispkg}
        assert modules & set(names.split()) == set(), package.__name__


def test_every_public_name_is_documented_under_its_own_name_with_its_methods():
    for name in DEFINED:
        thing = getattr(paxisim, name)
        assert thing.__name__ == name
        document = inspect.getdoc(thing)
        assert document, f"{name} has no docstring"
        assert not document.startswith(f"{name}("), "the generated docstring of a dataclass says nothing"
        members = vars(thing) if inspect.isclass(thing) else {}
        for member, value in members.items():
            is_method = callable(value) or isinstance(value, (property, classmethod, staticmethod))
            if is_method and not member.startswith("_"):
                assert inspect.getdoc(getattr(thing, member)), f"{name}.{member} has no docstring"
    for package in (paxisim.augment, paxisim.diagnose):
        assert [name for name in package.__all__ if not inspect.getdoc(getattr(package, name))] == []


def test_type_checkers_see_the_names_that_are_imported_lazily():
    for part in ("", "augment", "diagnose", "warp"):
        stub = Path(paxisim.__file__).parent / part / "__init__.pyi"
        for statement in ast.parse(stub.read_text(encoding="utf-8")).body:
            assert isinstance(statement, ast.ImportFrom), stub
            for alias in statement.names:
                assert alias.asname == alias.name, "without `as` a type checker takes the name for private"


def test_names_do_not_hide_one_another():
    """Importing a module replaces a name of the package that is the same."""
    modules = {module.name for module in pkgutil.iter_modules(paxisim.__path__)}
    assert modules.isdisjoint(DEFINED)
    import paxisim.augment.parameter_spec as module

    assert paxisim.augment.parameter is module.parameter


def test_an_unknown_name():
    with pytest.raises(AttributeError, match="No paxisim attribute atach"):
        _ = paxisim.atach
    with pytest.raises(ImportError):
        exec("from paxisim import atach")
