"""The public names: users rely on them, so a change to this list changes the API."""

import ast
import inspect
import pkgutil
from pathlib import Path

import pytest

import paxisim

PUBLIC = [
    "Agreement",
    "Calibration",
    "Chain",
    "DeviceError",
    "DeviceTimeoutError",
    "Drive",
    "Emulator",
    "FoundMounts",
    "Frame",
    "GCS",
    "GaussianBump",
    "Gel",
    "GelMemory",
    "Grip",
    "History",
    "InvalidValueError",
    "MagneticPad",
    "MagneticSensor",
    "MissingExtraError",
    "Mount",
    "ObjectStart",
    "OutputExistsError",
    "Pad",
    "PadParameters",
    "Pads",
    "PaxisimError",
    "PortAccessError",
    "PortNotFoundError",
    "Presses",
    "Profile",
    "Protocol",
    "ProtocolError",
    "RayCluster",
    "LinearCalibration",
    "Recording",
    "Scene",
    "SceneDraw",
    "SceneParameter",
    "SceneRanges",
    "SceneVariation",
    "Sensor",
    "SensorModule",
    "SensorQuality",
    "Slot",
    "SqueezeResult",
    "TactileGripper",
    "TactileReadout",
    "TactileSensor",
    "TaxelLayout",
    "TouchGridReadout",
    "UnknownNameError",
    "UnsupportedError",
    "UnverifiedProfileWarning",
    "__version__",
    "attach",
    "augment",
    "calibrate_readout",
    "calibrate_sensor",
    "compare_streams",
    "conform",
    "diagnose",
    "encoding",
    "find_mounts",
    "find_pads",
    "find_presses",
    "finger_surface",
    "flat",
    "heights_from_map",
    "known_grippers",
    "known_profiles",
    "known_protocols",
    "known_sensors",
    "load_profile",
    "measure_quality",
    "mounts_for",
    "open_sensor",
    "plot_calibration",
    "plot_mounts",
    "plot_pads",
    "plot_presses",
    "plot_residuals",
    "plot_quality",
    "plot_tactile",
    "protocol",
    "reference_sensor",
    "robosuite_gripper_path",
    "sensor",
    "sensor_modules",
    "set_surface",
    "skin_distance",
    "squeeze",
    "view",
    "warp",
]
DEFINED = [n for n in PUBLIC if n not in ("__version__", "augment", "diagnose", "warp")]
AUGMENT = [
    "AxisCoupling",
    "AxisGain",
    "CentreOfPressure",
    "Chain",
    "ChannelCurve",
    "CovariateField",
    "Creep",
    "Crosstalk",
    "DeadBand",
    "DeadTaxels",
    "DirectTransfer",
    "Drift",
    "Encoding",
    "FailingTaxels",
    "Firmware",
    "FittedGCS",
    "GCS",
    "GCSReading",
    "History",
    "Hysteresis",
    "Interference",
    "Latency",
    "LayoutFault",
    "LowPass",
    "StatefulTransform",
    "NoTactile",
    "Offset",
    "PadAxisGain",
    "Parameter",
    "Poisson",
    "Quantisation",
    "RandomWalk",
    "Ranges",
    "Rotation",
    "SampleAndHold",
    "Saturation",
    "Stiffening",
    "SwappedTaxels",
    "TaxelBinarization",
    "TaxelDirection",
    "TaxelGain",
    "TemperatureDrift",
    "TotalForce",
    "Transform",
    "WhiteNoise",
    "encoding",
    "parameter",
    "parameters",
]


DIAGNOSE = [
    "Cause",
    "Diagnosis",
    "FittedParameter",
    "FoundCause",
    "Free",
    "HeldOut",
    "Interval",
    "LeftOver",
    "Place",
    "Symptoms",
    "diagnose",
    "known_causes",
    "register_cause",
]


def test_the_public_names_of_diagnose_are_these():
    assert callable(paxisim.diagnose)
    assert sorted(DIAGNOSE) == sorted(paxisim.diagnose.__all__)
    for name in DIAGNOSE:
        assert inspect.getdoc(getattr(paxisim.diagnose, name)), f"{name} has no docstring"


def test_the_public_names_of_augment_are_these():
    assert sorted(AUGMENT) == sorted(paxisim.augment.__all__)
    for name in AUGMENT:
        assert inspect.getdoc(getattr(paxisim.augment, name)), f"{name} has no docstring"


def test_the_public_names_are_these():
    assert sorted(PUBLIC) == sorted(paxisim.__all__)


@pytest.mark.parametrize("name", DEFINED)
def test_every_public_name_is_documented_under_its_own_name(name):
    thing = getattr(paxisim, name)
    assert thing.__name__ == name
    assert inspect.getdoc(thing), f"{name} has no docstring"
    assert not inspect.getdoc(thing).startswith(f"{name}("), "the generated docstring of a dataclass says nothing"


@pytest.mark.parametrize("name", DEFINED)
def test_every_public_method_is_documented(name):
    thing = getattr(paxisim, name)
    if not inspect.isclass(thing):
        return
    for member, value in vars(thing).items():
        if not member.startswith("_") and (callable(value) or isinstance(value, (property, classmethod, staticmethod))):
            assert inspect.getdoc(getattr(thing, member)), f"{name}.{member} has no docstring"


def test_star_import_and_dir():
    names: dict = {}
    exec("from paxisim import *", names)
    assert set(PUBLIC) <= set(names)
    assert set(PUBLIC) <= set(dir(paxisim))


STUBS = [Path(paxisim.__file__).parent / part / "__init__.pyi" for part in ("", "augment", "diagnose", "warp")]


@pytest.mark.parametrize("stub", STUBS, ids=lambda stub: stub.parent.name)
def test_type_checkers_see_the_names_that_are_imported_lazily(stub):
    for statement in ast.parse(stub.read_text(encoding="utf-8")).body:
        assert isinstance(statement, ast.ImportFrom)
        for alias in statement.names:
            assert alias.asname == alias.name, "without `as` a type checker takes the name for private"


def test_a_name_that_is_also_a_module_stays_the_function():
    import paxisim.augment.parameter_spec as module

    assert paxisim.augment.parameter is module.parameter


def test_a_public_name_is_what_its_home_defines():
    from paxisim.layout import TaxelLayout
    from paxisim.models.attach import attach

    assert paxisim.TaxelLayout is TaxelLayout
    assert paxisim.attach is attach


def test_no_public_name_is_that_of_a_module():
    """Importing such a module would replace the name in the package."""
    modules = {module.name for module in pkgutil.iter_modules(paxisim.__path__)}
    assert modules.isdisjoint(DEFINED)


def test_an_unknown_name():
    with pytest.raises(AttributeError, match="No paxisim attribute atach"):
        _ = paxisim.atach
    with pytest.raises(ImportError):
        exec("from paxisim import atach")


def test_the_version():
    assert paxisim.__version__.split(".")[0].isdigit()
