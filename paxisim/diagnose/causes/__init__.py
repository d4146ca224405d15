"""The built-in causes, in chain order."""

from paxisim.diagnose.cause import Cause
from paxisim.diagnose.causes.axis_coupling import AXIS_COUPLING
from paxisim.diagnose.causes.axis_gain import AXIS_GAIN
from paxisim.diagnose.causes.channel_curve import CHANNEL_CURVE
from paxisim.diagnose.causes.creep import CREEP
from paxisim.diagnose.causes.dead_band import DEAD_BAND
from paxisim.diagnose.causes.dead_taxels import DEAD_TAXELS
from paxisim.diagnose.causes.drift import DRIFT
from paxisim.diagnose.causes.gel_operator import GEL_OPERATOR
from paxisim.diagnose.causes.hysteresis import HYSTERESIS
from paxisim.diagnose.causes.interference import INTERFERENCE
from paxisim.diagnose.causes.latency import LATENCY
from paxisim.diagnose.causes.layout import LAYOUT
from paxisim.diagnose.causes.low_pass import LOW_PASS
from paxisim.diagnose.causes.offset import OFFSET
from paxisim.diagnose.causes.quantisation import QUANTISATION
from paxisim.diagnose.causes.rotation import ROTATION
from paxisim.diagnose.causes.saturation import SATURATION
from paxisim.diagnose.causes.scene import SCENE_CAUSES
from paxisim.diagnose.causes.stiffening import STIFFENING
from paxisim.diagnose.causes.swapped_taxels import SWAPPED_TAXELS
from paxisim.diagnose.causes.taxel_gain import TAXEL_GAIN

CAUSES: tuple[Cause, ...] = (
    *SCENE_CAUSES,
    LAYOUT,
    SWAPPED_TAXELS,
    STIFFENING,
    CREEP,
    HYSTERESIS,
    GEL_OPERATOR,
    AXIS_COUPLING,
    ROTATION,
    INTERFERENCE,
    AXIS_GAIN,
    LOW_PASS,
    LATENCY,
    CHANNEL_CURVE,
    TAXEL_GAIN,
    OFFSET,
    DRIFT,
    DEAD_BAND,
    SATURATION,
    QUANTISATION,
    DEAD_TAXELS,
)
