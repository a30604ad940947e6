"""All requests that clients may send. Each module declares the requests of one topic next to their arguments."""

from typing import Final

from arcor2_hw.data.rpc.action_points import *
from arcor2_hw.data.rpc.alarms import *
from arcor2_hw.data.rpc.calibrations import *
from arcor2_hw.data.rpc.cell import *
from arcor2_hw.data.rpc.dry_runs import *
from arcor2_hw.data.rpc.editor import *
from arcor2_hw.data.rpc.envelope import *
from arcor2_hw.data.rpc.execution import *
from arcor2_hw.data.rpc.functions import *
from arcor2_hw.data.rpc.general import *
from arcor2_hw.data.rpc.history import *
from arcor2_hw.data.rpc.interlocks import *
from arcor2_hw.data.rpc.locks import *
from arcor2_hw.data.rpc.maintenance import *
from arcor2_hw.data.rpc.nodes import *
from arcor2_hw.data.rpc.object_types import *
from arcor2_hw.data.rpc.operation import *
from arcor2_hw.data.rpc.persons import *
from arcor2_hw.data.rpc.points import *
from arcor2_hw.data.rpc.projects import *
from arcor2_hw.data.rpc.recipes import *
from arcor2_hw.data.rpc.robots import *
from arcor2_hw.data.rpc.scenes import *
from arcor2_hw.data.rpc.scripts import *
from arcor2_hw.data.rpc.units import *

_ALL: Final = (
    *ACTION_POINT_RPCS,
    *ALARM_RPCS,
    *CALIBRATION_RPCS,
    *CELL_RPCS,
    *DRY_RUN_RPCS,
    *EDITOR_RPCS,
    *EXECUTION_RPCS,
    *FUNCTION_RPCS,
    *GENERAL_RPCS,
    *HISTORY_RPCS,
    *INTERLOCK_RPCS,
    *LOCK_RPCS,
    *MAINTENANCE_RPCS,
    *NODE_RPCS,
    *OBJECT_TYPE_RPCS,
    *OPERATION_RPCS,
    *PERSON_RPCS,
    *POINT_RPCS,
    *PROJECT_RPCS,
    *RECIPE_RPCS,
    *ROBOT_RPCS,
    *SCENE_RPCS,
    *SCRIPT_RPCS,
    *UNIT_RPCS,
)
RPCS: Final = {rpc.name: rpc for rpc in sorted(_ALL, key=lambda rpc: rpc.name)}
"""Every request by name."""
