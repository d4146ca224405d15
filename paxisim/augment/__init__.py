"""Transforms of the force tensor: randomised they are the paper's GCS, fitted they are a sensor model.

A transform is a frozen dataclass of physical parameters with a pure call. One concept a file; `chain` composes
them, `gcs` draws the paper's, `encodings` makes of the tensor what a policy sees.
"""

MODULES = ("gains", "low_pass")
