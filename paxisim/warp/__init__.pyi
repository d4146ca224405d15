from .gel import apply_gel as apply_gel
from .gel import check_gel as check_gel
from .overflow import check_overflow as check_overflow
from .readout import WarpTactileReadout as WarpTactileReadout
from .surface import set_surface as set_surface
from .worlds import put_worlds as put_worlds
