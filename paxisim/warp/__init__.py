"""Pads on MuJoCo Warp: thousands of worlds in parallel on a GPU, or a few on the CPU.

`put_worlds` makes them of a compiled model, `WarpTactileReadout` reads the force tensor of all of them, `set_surface`
and `apply_gel` give each its own surface and gel. Needs the extra ``warp``, best in an environment of its own: the
versions of mujoco and mujoco-warp must match, and robosuite needs an older mujoco.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
