"""The effects, in the order in which a sensor applies them."""

from hidden.exam.effects.baseline import drift, interference, offset
from hidden.exam.effects.clock import latency, low_pass
from hidden.exam.effects.curves import dead_band, quantisation, saturation, stiffening
from hidden.exam.effects.gains import axis_gain, dead_taxels, taxel_gain
from hidden.exam.effects.loops import hysteresis
from hidden.exam.effects.memory import creep
from hidden.exam.effects.mixing import axis_coupling, crosstalk, layout, poisson, rotation

EFFECTS = {
    "layout": layout,
    "stiffening": stiffening,
    "creep": creep,
    "hysteresis": hysteresis,
    "poisson": poisson,
    "crosstalk": crosstalk,
    "axis_coupling": axis_coupling,
    "rotation": rotation,
    "interference": interference,
    "axis_gain": axis_gain,
    "taxel_gain": taxel_gain,
    "offset": offset,
    "drift": drift,
    "low_pass": low_pass,
    "latency": latency,
    "dead_band": dead_band,
    "saturation": saturation,
    "quantisation": quantisation,
    "dead_taxels": dead_taxels,
}
"""By name: (rng, world, strength) -> Effect. What is drawn does not depend on the strength."""
