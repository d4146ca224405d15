"""paxisim: magnet-based tactile sensors in MuJoCo, and the force tensor they read.

The public names are listed in `__all__` and imported when first used, so that ``import paxisim`` costs nothing:
no torch, no serial, no matplotlib, no trimesh.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from paxisim._lazy import lazy
from paxisim._version import __version__ as __version__

if TYPE_CHECKING:
    from paxisim import augment as augment
    from paxisim import diagnose as diagnose
    from paxisim.augment.chain import Chain as Chain
    from paxisim.augment.encodings import encoding as encoding
    from paxisim.augment.gcs import GCS as GCS
    from paxisim.augment.history import History as History
    from paxisim.bump import GaussianBump as GaussianBump
    from paxisim.calibrate.calibration import Calibration as Calibration
    from paxisim.calibrate.calibration import calibrate_sensor as calibrate_sensor
    from paxisim.calibrate.fit import calibrate_readout as calibrate_readout
    from paxisim.calibrate.readout import Readout as Readout
    from paxisim.errors import DeviceError as DeviceError
    from paxisim.errors import DeviceTimeoutError as DeviceTimeoutError
    from paxisim.errors import InvalidValueError as InvalidValueError
    from paxisim.errors import MissingExtraError as MissingExtraError
    from paxisim.errors import OutputExistsError as OutputExistsError
    from paxisim.errors import PaxisimError as PaxisimError
    from paxisim.errors import PortAccessError as PortAccessError
    from paxisim.errors import PortNotFoundError as PortNotFoundError
    from paxisim.errors import ProtocolError as ProtocolError
    from paxisim.errors import UnknownNameError as UnknownNameError
    from paxisim.errors import UnsupportedError as UnsupportedError
    from paxisim.hw.device import TactileSensor as TactileSensor
    from paxisim.hw.device import open_sensor as open_sensor
    from paxisim.hw.emulator import Emulator as Emulator
    from paxisim.hw.frame import Frame as Frame
    from paxisim.hw.profile import Profile as Profile
    from paxisim.hw.profile import Slot as Slot
    from paxisim.hw.profile import UnverifiedProfileWarning as UnverifiedProfileWarning
    from paxisim.hw.profile import known_profiles as known_profiles
    from paxisim.hw.profile import load_profile as load_profile
    from paxisim.hw.quality import SensorQuality as SensorQuality
    from paxisim.hw.quality import measure_quality as measure_quality
    from paxisim.layout import TaxelLayout as TaxelLayout
    from paxisim.models.attach import TactileGripper as TactileGripper
    from paxisim.models.attach import attach as attach
    from paxisim.models.find_mounts import FoundMounts as FoundMounts
    from paxisim.models.find_mounts import find_mounts as find_mounts
    from paxisim.models.finger_surface import finger_surface as finger_surface
    from paxisim.models.gel import Gel as Gel
    from paxisim.models.grippers import known_grippers as known_grippers
    from paxisim.models.grippers import mounts_for as mounts_for
    from paxisim.models.grippers import robosuite_gripper_path as robosuite_gripper_path
    from paxisim.models.mount import Mount as Mount
    from paxisim.models.pad import Pad as Pad
    from paxisim.models.pads import Pads as Pads
    from paxisim.models.pads import find_pads as find_pads
    from paxisim.models.pads import set_surface as set_surface
    from paxisim.models.readout import TactileReadout as TactileReadout
    from paxisim.models.surface import conform as conform
    from paxisim.models.surface import flat as flat
    from paxisim.models.surface import measured as measured
    from paxisim.models.touch_grid import TouchGridReadout as TouchGridReadout
    from paxisim.presses import Presses as Presses
    from paxisim.presses import find_presses as find_presses
    from paxisim.protocols.protocol import Protocol as Protocol
    from paxisim.protocols.ready import known_protocols as known_protocols
    from paxisim.protocols.ready import protocol as protocol
    from paxisim.recording import Recording as Recording
    from paxisim.reference.pad import MagneticPad as MagneticPad
    from paxisim.reference.parameters import GelMemory as GelMemory
    from paxisim.reference.parameters import PadParameters as PadParameters
    from paxisim.reference.sensor import MagneticSensor as MagneticSensor
    from paxisim.reference.sensor import reference_sensor as reference_sensor
    from paxisim.scene.agreement import Agreement as Agreement
    from paxisim.scene.agreement import compare_streams as compare_streams
    from paxisim.scene.drive import Drive as Drive
    from paxisim.scene.drive import ObjectStart as ObjectStart
    from paxisim.scene.parameters import SceneParameter as SceneParameter
    from paxisim.scene.ranges import SceneDraw as SceneDraw
    from paxisim.scene.ranges import SceneRanges as SceneRanges
    from paxisim.scene.ranges import SceneVariation as SceneVariation
    from paxisim.scene.scene import Scene as Scene
    from paxisim.sensors import Sensor as Sensor
    from paxisim.sensors import known_sensors as known_sensors
    from paxisim.sensors import sensor as sensor
    from paxisim.viz.calibration import plot_calibration as plot_calibration
    from paxisim.viz.calibration import plot_presses as plot_presses
    from paxisim.viz.mounts import plot_mounts as plot_mounts
    from paxisim.viz.plot import plot_pads as plot_pads
    from paxisim.viz.plot import plot_tactile as plot_tactile
    from paxisim.viz.quality import plot_quality as plot_quality
    from paxisim.viz.residuals import plot_residuals as plot_residuals
    from paxisim.viz.view import view as view

_HOMES = {
    "paxisim.augment.chain": ("Chain",),
    "paxisim.augment.encodings": ("encoding",),
    "paxisim.augment.gcs": ("GCS",),
    "paxisim.augment.history": ("History",),
    "paxisim.bump": ("GaussianBump",),
    "paxisim.calibrate.calibration": ("Calibration", "calibrate_sensor"),
    "paxisim.calibrate.fit": ("calibrate_readout",),
    "paxisim.calibrate.readout": ("Readout",),
    "paxisim.errors": (
        "DeviceError",
        "DeviceTimeoutError",
        "InvalidValueError",
        "MissingExtraError",
        "OutputExistsError",
        "PaxisimError",
        "PortAccessError",
        "PortNotFoundError",
        "ProtocolError",
        "UnknownNameError",
        "UnsupportedError",
    ),
    "paxisim.hw.device": ("TactileSensor", "open_sensor"),
    "paxisim.hw.emulator": ("Emulator",),
    "paxisim.hw.frame": ("Frame",),
    "paxisim.hw.profile": ("Profile", "Slot", "UnverifiedProfileWarning", "known_profiles", "load_profile"),
    "paxisim.hw.quality": ("SensorQuality", "measure_quality"),
    "paxisim.layout": ("TaxelLayout",),
    "paxisim.models.attach": ("TactileGripper", "attach"),
    "paxisim.models.find_mounts": ("FoundMounts", "find_mounts"),
    "paxisim.models.finger_surface": ("finger_surface",),
    "paxisim.models.gel": ("Gel",),
    "paxisim.models.grippers": ("known_grippers", "mounts_for", "robosuite_gripper_path"),
    "paxisim.models.mount": ("Mount",),
    "paxisim.models.pad": ("Pad",),
    "paxisim.models.pads": ("Pads", "find_pads", "set_surface"),
    "paxisim.models.readout": ("TactileReadout",),
    "paxisim.models.surface": ("conform", "flat", "measured"),
    "paxisim.models.touch_grid": ("TouchGridReadout",),
    "paxisim.presses": ("Presses", "find_presses"),
    "paxisim.protocols.protocol": ("Protocol",),
    "paxisim.protocols.ready": ("known_protocols", "protocol"),
    "paxisim.recording": ("Recording",),
    "paxisim.reference.pad": ("MagneticPad",),
    "paxisim.reference.parameters": ("GelMemory", "PadParameters"),
    "paxisim.reference.sensor": ("MagneticSensor", "reference_sensor"),
    "paxisim.scene.agreement": ("Agreement", "compare_streams"),
    "paxisim.scene.drive": ("Drive", "ObjectStart"),
    "paxisim.scene.parameters": ("SceneParameter",),
    "paxisim.scene.ranges": ("SceneDraw", "SceneRanges", "SceneVariation"),
    "paxisim.scene.scene": ("Scene",),
    "paxisim.sensors": ("Sensor", "known_sensors", "sensor"),
    "paxisim.viz.calibration": ("plot_calibration", "plot_presses"),
    "paxisim.viz.residuals": ("plot_residuals",),
    "paxisim.viz.mounts": ("plot_mounts",),
    "paxisim.viz.plot": ("plot_pads", "plot_tactile"),
    "paxisim.viz.quality": ("plot_quality",),
    "paxisim.viz.view": ("view",),
}
__getattr__, __dir__, __all__ = lazy(__name__, _HOMES, ("augment", "diagnose"))
__all__ += ["__version__", "augment", "diagnose"]
