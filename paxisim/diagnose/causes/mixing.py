"""What carries force from taxel to taxel or from axis to axis: Poisson shear, crosstalk, axis coupling, rotation."""

from __future__ import annotations

import numpy as np

from paxisim import augment
from paxisim.diagnose.cause import TAXEL_GAIN, UNLIKE, Cause, Free, Values, one_away, register_cause
from paxisim.diagnose.channels import mixes_alike, no_neighbours

register_cause(
    Cause(
        "poisson",
        40,
        lambda p: (Free("cx", "1", 0.0, 0.0, 1.0, 0.05, 0.008), Free("cy", "1", 0.0, 0.0, 1.0, 0.05, 0.008)),
        lambda v, p: augment.Poisson(v[0], v[1], reach=2.9),
        lambda p: [(0.1, 0.0), (0.0, 0.1)],
        form={"interference": 0.008, "saturation": 0.003, "axis_coupling": 0.002},
        mistaken=UNLIKE,
        faint=0.4,
        barred=no_neighbours,
    )
)

register_cause(
    Cause(
        "crosstalk",
        41,
        lambda p: (
            Free("strength", "1", 0.0, -0.3, 0.3, 0.02, 0.001),
            Free("far", "1", 0.5, 0.0, 3.0, 0.5),
            Free("taken", "1", 0.5, 0.0, 1.0, 0.3),
        ),
        lambda v, p: augment.Crosstalk(v[0], length=1.0, far=v[1], taken=v[2]),
        lambda p: [(0.02, 0.0, 0.0), (0.02, 1.0, 0.0), (0.02, 1.0, 1.0)],
        simpler=("axis_gain",),
        form={
            TAXEL_GAIN: 0.05,
            **dict.fromkeys(("axis_gain", "interference"), 0.006),
            "saturation": 0.004,
            "stiffening": 0.003,
            **dict.fromkeys(("axis_coupling", "rotation"), 0.0015),
        },
        # what the 4 next neighbours get of a load in the middle of a pad, and the 16 beyond at distances up to 2.8
        beyond=lambda v, p: abs(v[0]) * (4 + 7 * v[1]) / 0.012,
        barred=no_neighbours,
    )
)

# in the plane of the pad only what is symmetric: the rest of it is a turn about the normal, and `rotation`
_COUPLED = {
    "z_to_x": ((0, 2),),
    "z_to_y": ((1, 2),),
    "x_to_z": ((2, 0),),
    "y_to_z": ((2, 1),),
    "x_and_y": ((0, 1), (1, 0)),
}


def _coupling(values: Values) -> augment.AxisCoupling:
    matrix = np.eye(3)
    for places, value in zip(_COUPLED.values(), values, strict=True):
        for place in places:
            matrix[place] = value
    return augment.AxisCoupling(matrix)


register_cause(
    Cause(
        "axis_coupling",
        50,
        lambda p: tuple(Free(name, "1", 0.0, -0.6, 0.6, 0.05, 0.012) for name in _COUPLED),
        lambda v, p: _coupling(v),
        lambda p: [one_away(5, i, 0.0, 0.1) for i in range(5)],
        form={"rotation": 0.0005},
        mistaken=UNLIKE,
        barred=mixes_alike,
    )
)

_TILT = 0.01  # rad, of a sensor in its mount, that is expected
_MOST_TILT = 0.09

register_cause(
    Cause(
        "rotation",
        51,
        lambda p: (
            *(Free(f"about_{axis}", "rad", 0.0, -_MOST_TILT, _MOST_TILT, 0.05, 0.012, _TILT) for axis in "xy"),
            Free("about_z", "rad", 0.0, -0.6, 0.6, 0.05, 0.012),
        ),
        lambda v, p: augment.Rotation((tuple(v),)),
        lambda p: [one_away(3, k, 0.0, 0.05) for k in range(3)],
        # a tilt is nearly a coupling of shear and normal force, which may be any
        behind={"axis_coupling": lambda v, p: 0.001},
        told_beside={"axis_coupling": ("about_z",)},
        form={"axis_coupling": 0.0005},
        mistaken=UNLIKE,
        barred=mixes_alike,
    )
)
