"""paxisim in robosuite: tactile versions of its grippers, and the tensor they read as an observable.

Importing this package registers ``PaxiPandaGripper``, ``PaxiRobotiq85Gripper``, ``PaxiRobotiq140Gripper``,
``PaxiXArm7Gripper`` and ``PaxiRethinkGripper`` with robosuite.
"""

from ._quiet import robosuite as _robosuite  # noqa: F401 - first, for it speaks when it is imported
from .gripper import TactileGripper as TactileGripper
from .gripper import register as register
from .gripper import register_ready_made as register_ready_made
from .osc import fast_controller as fast_controller
from .tactile import TactileSim as TactileSim
from .tactile import TactileWrapper as TactileWrapper

register_ready_made()
