"""paxisim: magnet-based tactile sensors in MuJoCo, and the force tensor they read.

The public names are listed in ``__init__.pyi`` and imported on first use, so that ``import paxisim`` is fast and loads
neither torch, serial, matplotlib nor trimesh.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
