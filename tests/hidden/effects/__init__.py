"""What a real sensor does to forces, in continuous time (500 Hz), each effect by its own physics.

Nothing here is shared with what is fitted. Each effect has several forms, of which one is drawn, and where a real
sensor is calibrated somewhere, at which force or moment it reads right is drawn too.

An effect is a function ``(rng, pad, strength, form=None) -> (apply, truth)``: `apply(force, episode)` turns
(T, pads, 3, N) newtons into what is read, and `truth` holds the form and the figures a diagnosis should come back with.
`strength` in [0, 1] goes from barely there to strong, log-uniformly over the published or plausible magnitudes.
"""

from hidden.effects.common import COUNT, DT, Episode, Pad, between, sign
from hidden.effects.curves import dead_band, saturation, stiffening
from hidden.effects.gains import axis_gain, dead_taxels, offset, quantisation, taxel_gain
from hidden.effects.memory import creep, hysteresis, latency, low_pass
from hidden.effects.mixing import axis_coupling, crosstalk, layout, poisson, rotation
from hidden.effects.wander import drift, interference

__all__ = ["COUNT", "DT", "EFFECTS", "FORMS", "Episode", "Pad", "between", "sign"]

EFFECTS = {
    f.__name__: f
    for f in (
        layout, stiffening, creep, hysteresis, poisson, crosstalk, axis_coupling, rotation, interference, axis_gain,
        taxel_gain, offset, drift, low_pass, latency, dead_band, saturation, quantisation, dead_taxels,
    )
}  # fmt: skip
"""By the name a diagnosis should give, in the order in which a sensor applies them (`layout`: to what comes in)."""

FORMS = {name: effect.forms for name, effect in EFFECTS.items()}
"""By effect, the names of its forms: those that are drawn, then those that only the family "broad" draws as well."""
