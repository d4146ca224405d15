"""Transforms of the force tensor: randomised they are the paper's GCS, fitted they are a sensor model.

A transform is a frozen dataclass of physical parameters with a pure call. One concept a file; `chain` composes
them, `gcs` draws the paper's, `encodings` makes of the tensor what a policy sees, `history` keeps the last of them.
`paxisim.augment.torch` has them as ``nn.Module``, `paxisim.augment.gym` as a wrapper of environments.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
# a star import must not import optional packages
__all__.remove("gym")  # pyright: ignore[reportUnsupportedDunderAll]
__all__.remove("torch")  # pyright: ignore[reportUnsupportedDunderAll]
