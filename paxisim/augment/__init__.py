"""Transforms of the force tensor: randomised they are the paper's GCS, fitted they are a sensor model.

A transform is a frozen dataclass of physical parameters with a pure call. One concept a file; `chain` composes
them, `gcs` draws the paper's, `encodings` makes of the tensor what a policy sees, `history` keeps the last of them.
`paxisim.augment.torch` has them as ``nn.Module``, `paxisim.augment.gym` as a wrapper of environments.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from paxisim._lazy import lazy

if TYPE_CHECKING:
    from paxisim.augment.around import FittedGCS as FittedGCS
    from paxisim.augment.axis_coupling import AxisCoupling as AxisCoupling
    from paxisim.augment.chain import Chain as Chain
    from paxisim.augment.channel_curve import ChannelCurve as ChannelCurve
    from paxisim.augment.covariate_field import CovariateField as CovariateField
    from paxisim.augment.creep import Creep as Creep
    from paxisim.augment.crosstalk import Crosstalk as Crosstalk
    from paxisim.augment.dead_band import DeadBand as DeadBand
    from paxisim.augment.dead_taxels import DeadTaxels as DeadTaxels
    from paxisim.augment.drift import Drift as Drift
    from paxisim.augment.encodings import CentreOfPressure as CentreOfPressure
    from paxisim.augment.encodings import DirectTransfer as DirectTransfer
    from paxisim.augment.encodings import Encoding as Encoding
    from paxisim.augment.encodings import GCSReading as GCSReading
    from paxisim.augment.encodings import NoTactile as NoTactile
    from paxisim.augment.encodings import TaxelBinarization as TaxelBinarization
    from paxisim.augment.encodings import TaxelDirection as TaxelDirection
    from paxisim.augment.encodings import TotalForce as TotalForce
    from paxisim.augment.encodings import encoding as encoding
    from paxisim.augment.failing_taxels import FailingTaxels as FailingTaxels
    from paxisim.augment.firmware import Firmware as Firmware
    from paxisim.augment.gains import AxisGain as AxisGain
    from paxisim.augment.gains import PadAxisGain as PadAxisGain
    from paxisim.augment.gains import TaxelGain as TaxelGain
    from paxisim.augment.gcs import GCS as GCS
    from paxisim.augment.gcs import Ranges as Ranges
    from paxisim.augment.history import History as History
    from paxisim.augment.hysteresis import Hysteresis as Hysteresis
    from paxisim.augment.interference import Interference as Interference
    from paxisim.augment.latency import Latency as Latency
    from paxisim.augment.layout_faults import LayoutFault as LayoutFault
    from paxisim.augment.low_pass import LowPass as LowPass
    from paxisim.augment.noise import RandomWalk as RandomWalk
    from paxisim.augment.noise import WhiteNoise as WhiteNoise
    from paxisim.augment.offset import Offset as Offset
    from paxisim.augment.parameter import Parameter as Parameter
    from paxisim.augment.parameter import parameter as parameter
    from paxisim.augment.parameter import parameters as parameters
    from paxisim.augment.poisson import Poisson as Poisson
    from paxisim.augment.quantisation import Quantisation as Quantisation
    from paxisim.augment.rotation import Rotation as Rotation
    from paxisim.augment.sample_and_hold import SampleAndHold as SampleAndHold
    from paxisim.augment.saturation import Saturation as Saturation
    from paxisim.augment.stiffening import Stiffening as Stiffening
    from paxisim.augment.swapped_taxels import SwappedTaxels as SwappedTaxels
    from paxisim.augment.temperature import TemperatureDrift as TemperatureDrift
    from paxisim.augment.transform import Memory as Memory
    from paxisim.augment.transform import Transform as Transform

_HOMES = {
    "paxisim.augment.around": ("FittedGCS",),
    "paxisim.augment.axis_coupling": ("AxisCoupling",),
    "paxisim.augment.chain": ("Chain",),
    "paxisim.augment.channel_curve": ("ChannelCurve",),
    "paxisim.augment.covariate_field": ("CovariateField",),
    "paxisim.augment.creep": ("Creep",),
    "paxisim.augment.crosstalk": ("Crosstalk",),
    "paxisim.augment.dead_band": ("DeadBand",),
    "paxisim.augment.dead_taxels": ("DeadTaxels",),
    "paxisim.augment.drift": ("Drift",),
    "paxisim.augment.encodings": (
        "CentreOfPressure",
        "DirectTransfer",
        "Encoding",
        "GCSReading",
        "NoTactile",
        "TaxelBinarization",
        "TaxelDirection",
        "TotalForce",
        "encoding",
    ),
    "paxisim.augment.failing_taxels": ("FailingTaxels",),
    "paxisim.augment.firmware": ("Firmware",),
    "paxisim.augment.gains": (
        "AxisGain",
        "PadAxisGain",
        "TaxelGain",
    ),
    "paxisim.augment.gcs": (
        "GCS",
        "Ranges",
    ),
    "paxisim.augment.history": ("History",),
    "paxisim.augment.hysteresis": ("Hysteresis",),
    "paxisim.augment.interference": ("Interference",),
    "paxisim.augment.latency": ("Latency",),
    "paxisim.augment.layout_faults": ("LayoutFault",),
    "paxisim.augment.low_pass": ("LowPass",),
    "paxisim.augment.noise": (
        "RandomWalk",
        "WhiteNoise",
    ),
    "paxisim.augment.offset": ("Offset",),
    "paxisim.augment.parameter": (
        "Parameter",
        "parameter",
        "parameters",
    ),
    "paxisim.augment.poisson": ("Poisson",),
    "paxisim.augment.quantisation": ("Quantisation",),
    "paxisim.augment.rotation": ("Rotation",),
    "paxisim.augment.sample_and_hold": ("SampleAndHold",),
    "paxisim.augment.saturation": ("Saturation",),
    "paxisim.augment.stiffening": ("Stiffening",),
    "paxisim.augment.swapped_taxels": ("SwappedTaxels",),
    "paxisim.augment.temperature": ("TemperatureDrift",),
    "paxisim.augment.transform": (
        "Memory",
        "Transform",
    ),
}
__getattr__, __dir__, __all__ = lazy(__name__, _HOMES, ("gym", "torch"))
