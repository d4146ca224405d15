"""Transforms of the force tensor: randomised they are the paper's GCS, fitted they are a sensor model.

A transform is a frozen dataclass of physical parameters with a pure call. One concept a file; `chain` composes
them, `gcs` draws the paper's, `encodings` makes of the tensor what a policy sees.
"""

MODULES = (
    "gains",
    "low_pass",
    "creep",
    "hysteresis",
    "latency",
    "sample_and_hold",
    "drift",
    "temperature",
    "noise",
    "poisson",
    "offset",
    "stiffening",
    "crosstalk",
    "axis_coupling",
    "rotation",
    "layout_faults",
    "saturation",
    "dead_band",
    "quantisation",
    "dead_taxels",
    "interference",
    "firmware",
)
