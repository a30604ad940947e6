"""A workplace of realistic size for building packages: every kind of argument, two branches, a join."""

from arcor2_hw.actions.decorator import StrEnum
from arcor2_hw.analysis import Enumeration
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import ObjectAction, ParameterMeta
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import (
    END,
    START,
    Action,
    ActionParameter,
    ActionPoint,
    Flow,
    LogicItem,
    NamedOrientation,
    Project,
    ProjectLogicIf,
    ProjectParameter,
    ProjectRobotJoints,
)
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_server.build.frame import TypeFacts


class Grip(StrEnum):
    SOFT = "soft"
    FIRM = "firm"


def action(name: str, method: str, *arguments: tuple[str, str, str], results: tuple[str, ...] = ()) -> Action:
    """Return an action. Each argument is its name, type and value as JSON."""
    given = [ActionParameter(*argument) for argument in arguments]
    return Action(name, method, f"act_{name.replace(' ', '_')}", given, [Flow(outputs=list(results))])


def step(start: str, end: str, tested: str = "", value: bool = True) -> LogicItem:
    condition = ProjectLogicIf(f"act_{tested}/default/0", "true" if value else "false") if tested else UNSET
    ids = [name if name in (START, END) else f"act_{name.replace(' ', '_')}" for name in (start, end)]
    return LogicItem(ids[0], ids[1], condition, f"lit_{start}_{end}")


def scene() -> Scene:
    return Scene(
        "workplace",
        id="scn_1",
        objects=[
            SceneObject("robot", "Arm", Pose(Position(0.0, 0.0, 0.1)), id="obj_robot"),
            SceneObject("reader", "AcmeReader", parameters=[Parameter("port", "string", '"tcp"')], id="obj_reader"),
            SceneObject("flow", "FlowActions", id="obj_flow"),
            # AddVirtualCollisionObjectToScene uses one name for the type and its only object.
            SceneObject("table", "table", Pose(), id="obj_table"),
        ],
    )


def project() -> Project:
    feeder = ActionPoint(
        "feeder",
        Position(0.4, -0.3, 0.08),
        id="acp_feeder",
        orientations=[NamedOrientation("default", Orientation(), "ori_feeder")],
        robot_joints=[ProjectRobotJoints("above", "obj_robot", [Joint("j1", 0.5)], True, id="joi_above")],
        actions=[
            action(
                "boards left?", "obj_flow/repeat", ("times", "project_parameter", '"pco_boards"'), results=("left",)
            ),
            action("finish", "obj_flow/finish"),
            action(
                "scan code",
                "obj_reader/scan",
                ("timeout", "double", "2.5"),
                ("mode", "integer_enum", "2"),
                results=("code",),
            ),
            action(
                "above feeder", "obj_robot/move_joints", ("joints", "joints", '"joi_above"'), ("speed", "double", "0.5")
            ),
            action("pick", "obj_robot/pick", ("pose", "pose", '"ori_feeder"'), ("grip", "string_enum", '"firm"')),
        ],
    )
    good = ActionPoint(
        "good",
        Position(0.0, 0.0, 0.1),
        "acp_feeder",
        id="acp_good",
        orientations=[NamedOrientation("default", Orientation(), "ori_good")],
        actions=[
            action("known?", "obj_reader/known", ("code", "link", '"act_scan_code/default/0"'), results=("known",)),
            action("into good box", "obj_robot/place", ("pose", "pose", '"ori_good"')),
            action(
                "throw away", "obj_robot/drop", ("position", "position", '"acp_good"'), ("height", "double", "-0.2")
            ),
            action("back", "obj_robot/move_joints", ("joints", "joints", '"joi_above"')),
        ],
    )
    return Project(
        "Sort boards",
        "scn_1",
        id="pro_1",
        action_points=[feeder, good],
        parameters=[
            ProjectParameter("boards", "integer", "2", id="pco_boards"),
            ProjectParameter("scene_id", "string", '"scn_1"', id="pco_scene"),
        ],
        logic=[
            step(START, "boards left?"),
            step("boards left?", "scan code", "boards_left?", True),
            step("boards left?", "finish", "boards_left?", False),
            step("finish", END),
            step("scan code", "above feeder"),
            step("above feeder", "pick"),
            step("pick", "known?"),
            step("known?", "throw away", "known?", False),
            step("known?", "into good box", "known?", True),
            step("into good box", "back"),
            step("throw away", "back"),
            step("back", END),
        ],
    )


_SPEED = ParameterMeta("speed", "double", default_value="1.0", extra='{"minimum":0.0,"maximum":1.0}')
_GRIP = ParameterMeta("grip", "string_enum", default_value='"soft"', extra='{"allowed_values":["soft","firm"]}')
_MODE = ParameterMeta("mode", "integer_enum", default_value="1", extra='{"allowed_values":[1,2]}')

ACTIONS = {
    "Arm": [
        ObjectAction("pick", parameters=[ParameterMeta("pose", "pose"), _SPEED, _GRIP]),
        ObjectAction("place", parameters=[ParameterMeta("pose", "pose"), _SPEED]),
        ObjectAction("move_joints", parameters=[ParameterMeta("joints", "joints"), _SPEED]),
        ObjectAction("drop", parameters=[ParameterMeta("position", "position"), ParameterMeta("height", "double")]),
    ],
    "AcmeReader": [
        ObjectAction("scan", parameters=[ParameterMeta("timeout", "double"), _MODE], returns=["string"]),
        ObjectAction("known", parameters=[ParameterMeta("code", "string")], returns=["boolean"]),
    ],
    "FlowActions": [
        ObjectAction("repeat", parameters=[ParameterMeta("times", "integer")], returns=["boolean"]),
        ObjectAction("finish"),
    ],
    "table": [],
}
GRIP = Enumeration("object_types.arm", "Grip", {member.value: member.name for member in Grip})
MODE = Enumeration("object_types.acme_reader", "Mode", {1: "ONCE", 2: "TWICE"})
FACTS = {
    name: TypeFacts(f"object_types.{module}", shown_name, {one.name: one for one in ACTIONS[name]}, kinds)
    for name, module, shown_name, kinds in (
        ("Arm", "arm", "Robot arm", {("pick", "grip"): GRIP}),
        ("AcmeReader", "acme_reader", "ACME reader", {("scan", "mode"): MODE}),
        ("FlowActions", "flow_actions", "Program flow", {}),
        ("table", "table", "table", {}),
    )
}

ARM = '''"""An arm that only remembers, of the kind that people upload."""

from arcor2_hw.actions import StrEnum, action
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.objects import GenericWithPose


class Grip(StrEnum):
    """How firmly."""

    SOFT = "soft"
    FIRM = "firm"


class Arm(GenericWithPose):
    """An arm."""

    _ABSTRACT = False

    @action
    def pick(self, pose: Pose, speed: float = 1.0, grip: Grip = Grip.SOFT, *, an: str | None = None) -> None:
        """Pick."""
        assert grip is Grip.FIRM

    @action
    def place(self, pose: Pose, speed: float = 1.0, *, an: str | None = None) -> None:
        """Place."""

    @action
    def move_joints(self, joints: ProjectRobotJoints, speed: float = 1.0, *, an: str | None = None) -> None:
        """Move."""

    @action
    def drop(self, position: Position, height: float, *, an: str | None = None) -> None:
        """Drop."""
'''
TABLE = '''"""A table."""

from arcor2_hw.objects import VirtualCollisionObject


class table(VirtualCollisionObject):
    """A table."""

    _ABSTRACT = False
'''
DRIVER = {
    "__init__.py": '"""The reader of a driver with a folder of its own."""\n',
    "reader.py": '''"""The reader."""

import dataclasses

import msgspec

from arcor2_hw.actions import action
from arcor2_hw.objects import Generic, Settings

from .codes import FIRST, Mode


@dataclasses.dataclass
class ReaderSettings(Settings):
    """Where it is."""

    port: str


class AcmeReader(Generic):
    """A reader."""

    _ABSTRACT = False

    def __init__(self, obj_id: str, name: str, settings: ReaderSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._count = FIRST

    @action
    def scan(self, timeout: float, mode: Mode = Mode.ONCE, *, an: str | None = None) -> str:
        """Scan."""
        assert mode is Mode.TWICE
        self._count += 1
        return f"{self._count} {__file__} {len(msgspec.json.encode(timeout))}"

    @action
    def known(self, code: str, *, an: str | None = None) -> bool:
        """Return whether it is known."""
        return code.startswith("1 ")
''',
    "codes.py": '''"""Codes."""

from arcor2_hw.actions import IntEnum

FIRST = 0


class Mode(IntEnum):
    """How often."""

    ONCE = 1
    TWICE = 2
''',
    "quality.toml": "tested = false\n",
    "__pycache__/codes.cpython-311.pyc": "stale",
}
