"""Results of the analysis of object types, across files and spellings, and for invalid sources."""

import json
import re
import textwrap
import time

import msgspec
import pytest

from arcor2_hw.analysis import BUILT_IN, Library, SourceFile, TypeAnalysis, module_name
from arcor2_hw.data.object_type import ObjectAction
from arcor2_hw.exceptions import InvalidData, NotFound
from tests.protocol import PROTOCOL, session

NEW = """
    from arcor2_hw.actions import IntEnum, StrEnum, action
    from arcor2_hw.data.geometry import Pose, Position
    from arcor2_hw.data.project import ProjectRobotJoints
    from arcor2_hw.objects import Camera, CollisionObject, Generic, GenericWithPose, MultiArmRobot, Robot, Settings
"""


def library(**sources: str) -> Library:
    return Library(
        SourceFile(name, module_name(name), textwrap.dedent(NEW) + textwrap.dedent(source))
        for name, source in sources.items()
    )


def analyse(source: str, name: str = "T", **others: str) -> TypeAnalysis:
    return library(**{name: source}, **others).analyse(name)


def only_action(body: str, head: str = "", attributes: str = "") -> ObjectAction:
    """Return the only action of a type whose class has this body."""
    source = f"{textwrap.dedent(head)}\nclass T(Generic):\n    _ABSTRACT = False\n"
    source += textwrap.indent(textwrap.dedent(attributes) + "\n" + textwrap.dedent(body), "    ")
    found = analyse(source)
    assert found.problem is None, found.problem
    (action,) = found.actions
    return action


def plain(value: object) -> object:
    return msgspec.to_builtins(value)


# ------------------------------------------------------------------------------------------------ names, built-in
@pytest.mark.parametrize(
    ("name", "module"),
    [
        ("AbstractDobot", "abstract_dobot"),
        ("DobotM1", "dobot_m1"),
        ("Box2", "box2"),
        ("ERPSystem", "erp_system"),
        ("URRobot5e", "ur_robot5e"),
        ("My_Type", "my__type"),
        ("M1", "M1"),
        ("VGC10", "VGC10"),
    ],
)
def test_type_names_become_module_names(name: str, module: str) -> None:
    assert module_name(name) == module


def without_texts(value: object) -> object:
    """Remove texts, and the fields that we add to the protocol."""
    if isinstance(value, dict):
        left_out = ("description", "category", "icon")
        return {key: without_texts(each) for key, each in value.items() if key not in left_out}
    return [without_texts(each) for each in value] if isinstance(value, list) else value


def test_built_in_types_match_the_protocol() -> None:
    stated = PROTOCOL["built_in_object_types"]
    empty = Library()
    assert sorted(stated) == sorted(BUILT_IN) == sorted(empty.names())
    for name, wanted in stated.items():
        found = empty.analyse(name)
        assert found.problem is None
        assert found.meta.description
        assert without_texts(json.loads(msgspec.json.encode(found.meta))) == wanted["meta"]
        assert without_texts(json.loads(msgspec.json.encode(found.actions))) == wanted["actions"]


# ------------------------------------------------------------------------------------------------ recorded sessions
DOBOT = {
    "AbstractDobot": '''
        """Older spelling throughout."""
        from dataclasses import dataclass
        from typing import Optional

        from arcor2.data.common import ActionMetadata, Joint, Pose, StrEnum
        from arcor2.data.robot import RobotType
        from arcor2.exceptions import Arcor2Exception
        from arcor2_object_types.abstract import Robot, Settings

        class DobotException(Arcor2Exception):
            pass

        @dataclass
        class UrlSettings(Settings):
            url: str

        class MoveType(StrEnum):
            LINEAR: str = "LINEAR"
            JOINTS: str = "JOINTS"
            JUMP: str = "JUMP"

        class AbstractDobot(Robot):
            """An arm."""
            robot_type = RobotType.SCARA

            def __init__(self, obj_id: str, name: str, pose: Pose, settings: Settings) -> None:
                super().__init__(obj_id, name, pose, settings)

            def get_end_effectors_ids(self) -> set[str]:
                return {"default"}

            def get_end_effector_pose(self, end_effector: str) -> Pose:
                return Pose()

            def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
                return []

            def grippers(self) -> set[str]:
                return set()

            def suctions(self) -> set[str]:
                return {"default"}

            def move_to_pose(self, end_effector_id: str, target_pose: Pose, speed: float, safe: bool = True,
                             linear: bool = True) -> None:
                self.move(target_pose, MoveType.LINEAR)

            def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
                self.go(target_joints)

            def home(self, *, an: Optional[str] = None) -> None:
                """Home."""

            def move(self, pose: Pose, move_type: MoveType = MoveType.JOINTS, velocity: float = 50.0,
                     acceleration: float = 50.0, safe: bool = True, *, an: Optional[str] = None) -> None:
                """Moves.

                :param pose: Where to.
                :param move_type: How.
                :param velocity: Speed.
                :param acceleration: Acceleration.
                :param safe: Around things.
                :return:
                """
                assert 0.0 <= velocity <= 100.0
                assert 0.0 <= acceleration <= 100.0

            def pick(self, pick_pose: Pose, velocity: float = 50.0, vertical_offset: float = 0.05,
                     safe_approach: bool = True, safe_pick: bool = False, *, an: Optional[str] = None) -> None:
                """Picks.

                :param pick_pose: Where.
                :param velocity: Speed.
                :param vertical_offset: How far above.
                :param safe_approach: Around things.
                :param safe_pick: Around things.
                """
                assert 0.0 <= velocity <= 100.0

            def place(self, place_pose: Pose, velocity: float = 50.0, vertical_offset: float = 0.05,
                      safe_approach: bool = True, safe_place: bool = False, *, an: Optional[str] = None) -> None:
                """Places.

                :param place_pose: Where.
                :param velocity: Speed.
                :param vertical_offset: How far above.
                :param safe_approach: Around things.
                :param safe_place: Around things.
                """
                assert 0.0 <= velocity <= 100.0

            def release(self, *, an: Optional[str] = None) -> None:
                """Release."""

            def suck(self, *, an: Optional[str] = None) -> None:
                """Suck."""

            home.__action__ = ActionMetadata()  # type: ignore
            move.__action__ = ActionMetadata()  # type: ignore
            suck.__action__ = ActionMetadata()  # type: ignore
            release.__action__ = ActionMetadata()  # type: ignore
            pick.__action__ = ActionMetadata(composite=True)  # type: ignore
            place.__action__ = ActionMetadata(composite=True)  # type: ignore
    ''',
    "DobotM1": '''
        from dataclasses import dataclass
        from arcor2.data.common import Pose
        from .abstract_dobot import AbstractDobot, UrlSettings as Base

        @dataclass
        class DobotSettings(Base):
            url: str = "http://fit-demo-dobot-m1:5018"

        class DobotM1(AbstractDobot):
            """M1."""
            _ABSTRACT = False
            urdf_package_name = "dobot-m1.zip"

            def __init__(self, obj_id: str, name: str, pose: Pose, settings: DobotSettings) -> None:
                super().__init__(obj_id, name, pose, settings)

            def get_hand_teaching_mode(self) -> bool:
                return True

            def set_hand_teaching_mode(self, enabled: bool) -> None:
                self.put(enabled)
    ''',
    "DobotMagician": '''
        from dataclasses import dataclass
        from typing import List, Optional
        from arcor2.data.common import Joint, Pose
        from arcor2.exceptions import Arcor2NotImplemented
        from .abstract_dobot import AbstractDobot, UrlSettings as Base

        @dataclass
        class DobotSettings(Base):
            url: str = "http://fit-demo-dobot-magician:5018"

        class DobotMagician(AbstractDobot):
            """Magician."""
            _ABSTRACT = False
            urdf_package_name = "dobot-magician.zip"

            def __init__(self, obj_id: str, name: str, pose: Pose, settings: DobotSettings) -> None:
                super().__init__(obj_id, name, pose, settings)

            def inverse_kinematics(self, end_effector_id: str, pose: Pose, start_joints: Optional[List[Joint]] = None,
                                   avoid_collisions: bool = True) -> List[Joint]:
                return []

            def forward_kinematics(self, end_effector_id: str, joints: List[Joint]) -> Pose:
                return Pose()

            def set_hand_teaching_mode(self, enabled: bool) -> None:
                """Not this one."""
                raise Arcor2NotImplemented("No hand teaching.")
    ''',
}


def recorded() -> dict[str, list]:
    """Return the data of the answers in the first recorded session."""
    answers = {}
    for line in session("01_connect_register"):
        message = line["msg"]
        if isinstance(message, dict) and message.get("response") in ("GetObjectTypes", "GetActions", "GetRobotMeta"):
            answers[message["response"]] = message["data"]
    assert len(answers) == 3
    return answers


def test_types_of_a_recorded_session_are_analysed_as_recorded() -> None:
    answers = recorded()
    lib = Library(SourceFile(name, module_name(name), textwrap.dedent(source)) for name, source in DOBOT.items())
    metas = {meta["type"]: meta for meta in answers["GetObjectTypes"]}
    for name in DOBOT:
        found = lib.analyse(name)
        assert found.problem is None, found.problem
        wanted = {key: value for key, value in metas[name].items() if key != "modified"}
        assert without_texts(json.loads(msgspec.json.encode(found.meta))) == without_texts(wanted)
    actions = json.loads(msgspec.json.encode(lib.analyse("DobotMagician").actions))
    assert without_texts(actions) == without_texts(answers["GetActions"])
    # The results have texts exactly where the recording has texts.
    for ours, theirs in zip(actions, answers["GetActions"], strict=True):
        assert ("description" in ours) == ("description" in theirs)
        for a, b in zip(ours["parameters"], theirs["parameters"], strict=True):
            assert ("description" in a) == ("description" in b)
    robots = [json.loads(msgspec.json.encode(lib.analyse(name).robot)) for name in ("DobotM1", "DobotMagician")]
    assert robots == answers["GetRobotMeta"]
    assert lib.analyse("AbstractDobot").robot is None
    assert lib.analyse("DobotM1").bases == ("AbstractDobot", "Robot", "GenericWithPose", "Generic")
    assert [file.name for file in lib.analyse("DobotM1").modules] == ["AbstractDobot"]
    assert lib.analyse("DobotM1").implemented >= {"move_to_pose", "set_hand_teaching_mode", "get_hand_teaching_mode"}
    assert "set_hand_teaching_mode" not in lib.analyse("DobotMagician").implemented


def test_a_generated_type_is_analysed() -> None:
    found = Library(
        [
            SourceFile(
                "MyBox",
                "my_box",
                "from arcor2_object_types.abstract import CollisionObject\n\n\n"
                "class MyBox(CollisionObject):\n    _ABSTRACT = False\n",
            )
        ]
    ).analyse("MyBox")
    assert found.problem is None
    assert (found.meta.base, found.meta.has_pose, found.meta.abstract) == ("CollisionObject", True, False)
    assert [(a.name, a.origins) for a in found.actions] == [
        ("set_enabled", "CollisionObject"),
        ("update_pose", "GenericWithPose"),
    ]


# ------------------------------------------------------------------------------------------------ actions
def test_every_parameter_type_is_described() -> None:
    action = only_action(
        """
        @action
        def every(self, a: bool, b: int, c: float, d: str, e: Colour, f: Level, g: Pose, h: Position,
                  i: ProjectRobotJoints, j: Image.Image, *, an: str | None = None) -> tuple[bool, Image.Image]:
            return True, j
        """,
        head="""
        from PIL import Image

        class Colour(StrEnum):
            RED = "red"
            BLUE = "blue"

        class Level(IntEnum):
            LOW = -1
            HIGH = 7
        """,
    )
    assert [parameter.type for parameter in action.parameters] == [
        "boolean", "integer", "double", "string", "string_enum", "integer_enum", "pose", "position", "joints", "image",
    ]  # fmt: skip
    assert action.parameters[4].extra == '{"allowed_values":["red","blue"]}'
    assert action.parameters[5].extra == '{"allowed_values":[-1,7]}'
    assert action.returns == ["boolean", "image"]
    assert not action.disabled


def test_enumerations_of_other_files_and_of_the_class_are_resolved() -> None:
    found = analyse(
        """
        from . import modes
        from .modes import Mode as Renamed

        class T(Generic):
            class Inner(IntEnum):
                ONE = 1
                TWO = ONE + 1

            @action
            def act(self, a: Renamed = Renamed.FAST, b: modes.Mode = modes.DEFAULT, c: Inner = Inner.TWO,
                    d: "Renamed" = Renamed.SLOW, *, an: None | str = None) -> Inner:
                return c
        """,
        Modes='class Mode(StrEnum):\n    FAST = "f"\n    SLOW = "s"\nDEFAULT = Mode.SLOW\nclass Modes:\n    pass\n',
    )
    (action,) = found.actions
    assert action.problem is msgspec.UNSET
    assert [p.default_value for p in action.parameters] == ['"f"', '"s"', "2", '"s"']
    assert action.parameters[2].extra == '{"allowed_values":[1,2]}'
    assert action.returns == ["integer_enum"]
    assert [file.name for file in found.modules] == ["Modes"]


def test_defaults_that_name_constants_are_resolved() -> None:
    action = only_action(
        """
        @action
        def act(self, a: float = SPEED, b: float = math.pi / 2, c: int = -COUNT, d: float = 3, e: float = LIMIT, *,
                f: str = "x", an: str | None = None) -> None:
            pass
        """,
        head="import math\nfrom typing import Final\nSPEED: Final = 0.25\nCOUNT = 3\n",
        attributes="LIMIT = SPEED * 2\n",
    )
    assert [p.default_value for p in action.parameters] == ["0.25", "1.5707963267948966", "-3", "3.0", "0.5", '"x"']


@pytest.mark.parametrize(
    ("statement", "extra"),
    [
        ("assert 0.0 <= p <= 1.0", '{"minimum":0.0,"maximum":1.0}'),
        ("assert 0.0 <= p <= 1.0, 'message'", '{"minimum":0.0,"maximum":1.0}'),
        ("assert 0.0 < p <= 1.0", None),
        ("assert -1.0 <= p <= 1.0", None),
        ("assert 0.0 <= q <= 1.0", None),
        ("assert p <= 1.0", None),
        ("if q:\n        assert 0.0 <= p <= 1.0", None),
    ],
)
def test_parameter_ranges_are_read(statement: str, extra: str | None) -> None:
    action = only_action(
        f"@action\ndef act(self, p: float, *, an: str | None = None) -> None:\n    q = p\n    {statement}\n"
    )
    assert action.parameters[0].extra == (msgspec.UNSET if extra is None else extra)


def test_dynamic_values_and_cancel_mappings_are_read() -> None:
    for attributes in (
        'DYNAMIC_PARAMS = {"item": ("items", {"store"})}\nCANCEL_MAPPING = {"act": "cancel"}',
        "def items(self, store: str) -> set[str]: ...\ndef cancel(self): ...\n"
        'DYNAMIC_PARAMS = {"item": DynamicParamTuple(items.__name__, {"store"})}\n'
        'CANCEL_MAPPING: CancelDict = {"act": cancel.__name__}',
    ):
        action = only_action(
            "@action\ndef act(self, store: str, item: str, *, an: str | None = None) -> None: ...",
            head="from arcor2 import DynamicParamTuple",
            attributes=attributes,
        )
        assert action.meta.cancellable
        assert [(p.dynamic_value, p.dynamic_value_parents) for p in action.parameters] == [
            (False, msgspec.UNSET),
            (True, {"store"}),
        ]
    after = analyse("""
        class T(Generic):
            @action
            def act(self, *, an: str | None = None) -> None: ...
            def halt(self): ...
        T.CANCEL_MAPPING = {T.act.__name__: T.halt.__name__}
    """)
    assert after.actions[0].meta.cancellable


@pytest.mark.parametrize(
    ("imports", "common", "dynamic"),
    [
        ("from arcor2 import DynamicParamTuple as DPT\nfrom arcor2.data import common as c", "c.", "DPT"),
        ("import arcor2 as a2", "a2.data.common.", "a2.DynamicParamTuple"),
        ("import arcor2.data.common", "arcor2.data.common.", "arcor2.DynamicParamTuple"),
        ("import arcor2\nimport arcor2.data.common as c", "c.", "arcor2.DynamicParamTuple"),
        ("from arcor2 import *\nfrom arcor2.data.common import *", "", "DynamicParamTuple"),
        (
            "from arcor2 import DynamicParamTuple\nDynamic = DynamicParamTuple\nimport arcor2.data as d",
            "d.common.",
            "Dynamic",
        ),
    ],
)
def test_every_form_of_import_is_resolved(imports: str, common: str, dynamic: str) -> None:
    source = f"""{imports}
import arcor2_object_types.abstract as bases
import builtins as b
import typing as t

class Level(AC.IntEnum):
    LOW = 1

class T(bases.Generic):
    _ABSTRACT = False
    def act(
        self, store: str, item: str, at: AC.Pose, level: Level = Level.LOW, *, an: t.Optional[str] = None
    ) -> bool: ...
    def stores(self) -> set[str]: ...
    def items(self, store: str) -> set[str]: ...
    DYNAMIC_PARAMS = {{"store": DPT("stores", b.set()), "item": DPT(items.__name__, {{"store"}})}}
    act.__action__ = AC.ActionMetadata()
""".replace("AC.", common).replace("DPT(", f"{dynamic}(")
    (act,) = Library([SourceFile("T", "T", source)]).analyse("T").actions
    assert not act.disabled, act.problem
    assert [(p.name, p.type, p.dynamic_value_parents) for p in act.parameters] == [
        ("store", "string", msgspec.UNSET),
        ("item", "string", {"store"}),
        ("at", "pose", msgspec.UNSET),
        ("level", "integer_enum", msgspec.UNSET),
    ]
    assert [p.dynamic_value for p in act.parameters] == [True, True, False, False]


def test_former_names_of_actions_and_parameters_are_read() -> None:
    action = only_action(
        """
        @action(renamed={"low": "minimum", "least": "minimum", "high": "maximum"})
        def draw(self, minimum: int, maximum: int, *, an: str | None = None) -> int: ...

        pull = draw
        """
    )
    assert (action.name, action.former_names) == ("draw", ["pull"])
    assert [parameter.former_names for parameter in action.parameters] == [["low", "least"], ["high"]]
    assert action.present_name("least") == "minimum"
    assert action.present_name("other") == "other"
    plain_action = only_action("@action\ndef draw(self, *, an: str | None = None) -> int: ...")
    assert plain_action.former_names is msgspec.UNSET


AN = "*, an: str | None = None"


@pytest.mark.parametrize(
    ("method", "problem"),
    [
        (f"def act(self, a: dict, {AN}) -> None: ...", "act: parameter a: the type dict is not supported"),
        (f"def act(self, a, {AN}) -> None: ...", "act: parameter a is not annotated"),
        (f"def act(self, a: Nope, {AN}) -> None: ...", "act: parameter a: the name Nope is not defined"),
        (f"def act(self, a: 'int[', {AN}) -> None: ...", "is not a type hint"),
        (f"def act(self, {AN}): ...", "the return annotation is missing"),
        (f"def act(self, {AN}) -> list[int]: ...", "act: result: the type list\\[int\\] is not supported"),
        ("def act(self, *, an: str = '') -> None: ...", "`an` must be annotated"),
        ("def act(self, *, an=None) -> None: ...", "`an` must be annotated"),
        ("def act(self, a: int) -> None: ...", "the last parameter of an action must be `an"),
        ("def act(self, an: str | None, a: int) -> None: ...", "the last parameter of an action must be `an"),
        ("def act(self, *a: int, an: str | None = None) -> None: ...", "parameters of an action need names"),
        (f"async def act(self, {AN}) -> None: ...", "synchronous"),
        (f"def act(self, a: float, {AN}) -> None:\n    assert 0 <= a <= 1", "must be of type double too"),
        (f"def act(self, a: int = 'x', {AN}) -> None: ...", "parameter a: default: 'x' is not an integer"),
        (f"def act(self, a: bool = 1, {AN}) -> None: ...", "parameter a: default: 1 is not true or false"),
        (f"def act(self, a: float = None, {AN}) -> None: ...", "parameter a: default: None is not a number"),
        (f"def act(self, a: float = compute(), {AN}) -> None: ...", r"compute\(\) cannot be determined"),
        (f"def act(self, a: E = 'c', {AN}) -> None: ...", "the default is not a member of E"),
        (f"def act(self, a: Empty, {AN}) -> None: ...", "the enumeration Empty has no members"),
        (f"def act(self, a: Odd, {AN}) -> None: ...", "Odd.A must be a member of type StrEnum, not 1"),
        (f"def act(self, a: enum.Enum, {AN}) -> None: ...", "the type enum.Enum is not supported"),
        (f"@staticmethod\ndef act(self, {AN}) -> None: ...", "an ordinary method"),
        (f"@action(renamed={{'b': 'c'}})\ndef act(self, a: int, {AN}) -> None: ...", "act: `renamed` is {former name"),
        (f"@action(renamed={{'a': 'b'}})\ndef act(self, a: int, b: int, {AN}) -> None: ...", "act: `renamed` is"),
    ],
)
def test_an_error_of_an_action_disables_only_the_action(method: str, problem: str) -> None:
    head = "import enum\nclass E(StrEnum):\n    A = 'a'\nclass Empty(StrEnum): ...\nclass Odd(StrEnum):\n    A = 1\n"
    source = f"{head}\nclass T(Generic):\n    _ABSTRACT = False\n" + textwrap.indent(f"@action\n{method}\n", "    ")
    found = analyse(source + f"    @action\n    def fine(self, {AN}) -> None: ...\n")
    assert found.problem is None
    assert not found.meta.disabled
    act, fine = found.actions
    assert (act.disabled, fine.disabled) == (True, False)
    assert isinstance(act.problem, str)
    assert re.search(problem, act.problem), act.problem
    assert act.problem.startswith("object_types/T.py:")
    line = int(act.problem.split(":")[1])
    assert line >= (9 if "Empty" in method or "Odd" in method else 13)  # where the fault is


def test_actions_are_inherited() -> None:
    lib = library(
        Base="""
        class Base(GenericWithPose):
            @action
            def kept(self, *, an: str | None = None) -> None: ...
            @action
            def replaced(self, *, an: str | None = None) -> None: ...
            @action
            def dropped(self, *, an: str | None = None) -> None: ...
            @action(hidden=True)
            def hidden(self, *, an: str | None = None) -> None: ...
        """,
        Mixin="""
        class Mixin:
            @action(composite=True)
            def mixed(self, *, an: str | None = None) -> bool:
                return True
        """,
        Derived="""
        from .base import Base
        from .mixin import Mixin

        class Derived(Mixin, Base):
            @action
            def replaced(self, *, an: str | None = None) -> None: ...
            def dropped(self, *, an: str | None = None) -> None: ...
            @action
            def own(self, *, an: str | None = None) -> None: ...
        """,
        Last="from .derived import Derived\nclass Last(Derived):\n    pass\n",
    )
    derived = lib.analyse("Derived")
    assert [(a.name, a.origins) for a in derived.actions] == [
        ("mixed", msgspec.UNSET),
        ("own", msgspec.UNSET),
        ("replaced", "Base"),
        ("kept", "Base"),
        ("update_pose", "GenericWithPose"),
    ]
    assert derived.actions[0].meta.composite
    assert derived.mixins == ("Mixin",)
    assert [file.name for file in derived.modules] == ["Base", "Mixin"]
    last = lib.analyse("Last")
    assert [(a.name, a.origins) for a in last.actions] == [
        ("mixed", "Derived"),
        ("own", "Derived"),
        ("replaced", "Derived"),
        ("kept", "Base"),
        ("update_pose", "GenericWithPose"),
    ]
    assert [file.name for file in last.modules] == ["Base", "Mixin", "Derived"]
    mixin = lib.analyse("Mixin")
    assert not mixin.is_object_type
    assert mixin.problem is None


def test_optional_methods_of_bases_become_actions_when_implemented() -> None:
    found = analyse("""
        from PIL import Image
        class T(Camera):
            _ABSTRACT = False
            @action
            def color_image(self, *, an: str | None = None) -> Image.Image:
                return self.grab()
    """)
    assert (found.actions[0].name, found.actions[0].origins) == ("color_image", msgspec.UNSET)
    assert "depth_image" not in [a.name for a in found.actions]
    assert not found.meta.abstract
    missing = analyse("class T(Camera):\n    _ABSTRACT = False\n")
    assert missing.meta.abstract  # color_image is missing


# ------------------------------------------------------------------------------------------------ types
def test_abstract_types_are_recognised() -> None:
    lib = library(
        A="class A(Generic):\n    pass\n",
        B="from .A import A\nclass B(A):\n    _ABSTRACT = False\n",
        C="from .B import B\nclass C(B):\n    pass\n",
        D=(
            "import abc\nfrom .B import B\nclass D(B):\n"
            "    @property\n    @abc.abstractmethod\n    def x(self): ...\n    @x.setter\n    def x(self, v): ...\n"
        ),
        E="from .D import D\nclass E(D):\n    x = 1\n",
    )
    assert {name: lib.analyse(name).meta.abstract for name in "ABCDE"} == {
        "A": True, "B": False, "C": False, "D": True, "E": False,
    }  # fmt: skip


def test_settings_are_ordered_as_in_dataclasses() -> None:
    lib = library(
        Base="""
        from dataclasses import KW_ONLY, dataclass, field
        from typing import ClassVar
        class Kind(IntEnum):
            A = 1
            B = 2
        @dataclass
        class BaseSettings(Settings):
            '''Ours.

            :param host: where it is
            '''
            host: str
            KINDS: ClassVar[int] = 3
            later: bool = field(default=True, kw_only=True)
            never: int = field(default=1, init=False)
            port: int = 502
        class Base(Generic):
            def __init__(self, obj_id: str, name: str, settings: BaseSettings) -> None: ...
        """,
        Derived="""
        import dataclasses
        from .base import Base, BaseSettings, Kind
        @dataclasses.dataclass(frozen=True)
        class Mine(BaseSettings):
            kind: Kind = Kind.B
            port: int = 503
            slow: float = 1
        class Derived(Base):
            def __init__(self, obj_id: str, name: str, settings: "None | Mine" = None) -> None: ...
        """,
        Heir="from .derived import Derived\nclass Heir(Derived):\n    pass\n",
    )
    shown = [(s.name, s.type, s.default_value) for s in lib.analyse("Base").meta.settings]
    assert shown == [("host", "string", msgspec.UNSET), ("port", "integer", "502"), ("later", "boolean", "true")]
    assert lib.analyse("Base").meta.settings[0].description == "where it is"
    derived = lib.analyse("Derived").meta.settings
    assert [(s.name, s.default_value) for s in derived] == [
        ("host", msgspec.UNSET), ("port", "503"), ("kind", "2"), ("slow", "1.0"), ("later", "true"),
    ]  # fmt: skip
    assert derived[2].extra == '{"allowed_values":[1,2]}'
    assert lib.analyse("Heir").meta.settings == derived


def test_settings_may_derive_from_those_of_the_library() -> None:
    lib = library(
        Press="""
        import dataclasses
        from arcor2_hw.objects.modbus_settings import ModbusSettings
        @dataclasses.dataclass
        class PressSettings(ModbusSettings):
            '''Ours.

            :param force: of the press, N
            '''
            port: int = 1502
            force: float = 10.0
        class Press(Generic):
            def __init__(self, obj_id: str, name: str, settings: PressSettings) -> None: ...
        """
    )
    shown = {s.name: (s.type, s.default_value) for s in lib.analyse("Press").meta.settings}
    assert list(shown)[:2] == ["host", "port"]
    assert shown["port"] == ("integer", "1502")
    assert shown["parity"] == ("string_enum", '"none"')
    assert shown["force"] == ("double", "10.0")
    assert all(s.description for s in lib.analyse("Press").meta.settings if s.name != "port")


def test_secret_settings_are_marked() -> None:
    lib = library(
        Bank="""
        from dataclasses import dataclass, field
        @dataclass
        class BankSettings(Settings):
            host: str
            branch: str = field(metadata={"address": True})
            report_url: str = field(metadata={"address": False})
            code: str = field(metadata={"secret": True})
            password: str = "robotics"
            password_file: str = ""
            token: str = field(default="part", metadata={"unit": "x", "secret": False})
            pin: int = 3
            empty_secret: str = ""
            mass: float = field(default=-1.0, metadata={"for_control": True})
            door: str = field(default="", metadata={"found_by": "serial"})
        class Bank(Generic):
            def __init__(self, obj_id: str, name: str, settings: BankSettings) -> None: ...
        """,
        Wrong="""
        from dataclasses import dataclass, field
        @dataclass
        class WrongSettings(Settings):
            pin: int = field(default=1, metadata={"secret": True})
        class Wrong(Generic):
            def __init__(self, obj_id: str, name: str, settings: WrongSettings) -> None: ...
        """,
        Lost="""
        from dataclasses import dataclass, field
        @dataclass
        class LostSettings(Settings):
            door: str = field(default="", metadata={"found_by": "dowsing"})
        class Lost(Generic):
            def __init__(self, obj_id: str, name: str, settings: LostSettings) -> None: ...
        """,
    )
    settings = {each.name: (each.secret, each.default_value) for each in lib.analyse("Bank").meta.settings}
    assert settings == {
        "host": (msgspec.UNSET, msgspec.UNSET),
        "branch": (msgspec.UNSET, msgspec.UNSET),
        "report_url": (msgspec.UNSET, msgspec.UNSET),
        "code": (True, msgspec.UNSET),
        "password": (True, '"***"'),
        "password_file": (msgspec.UNSET, '""'),
        "token": (msgspec.UNSET, '"part"'),
        "pin": (msgspec.UNSET, "3"),
        "empty_secret": (True, '""'),
        "mass": (msgspec.UNSET, "-1.0"),
        "door": (msgspec.UNSET, '""'),
    }
    assert [each.name for each in lib.analyse("Bank").meta.settings if each.for_control is True] == ["mass"]
    searches = {each.name: each.found_by for each in lib.analyse("Bank").meta.settings}
    assert {name: search for name, search in searches.items() if search} == {"door": "serial"}
    declared = {
        each.name: each.address for each in lib.analyse("Bank").meta.settings if each.address is not msgspec.UNSET
    }
    assert declared == {"branch": True, "report_url": False}
    problem = lib.analyse("Wrong").problem
    assert problem is not None
    assert "a secret setting must be of type str" in str(problem)
    assert "found_by must be serial, can, oak, ur, modbus, not 'dowsing'" in str(lib.analyse("Lost").problem)


ROBOT = """
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import Arcor2NotImplemented
class T(Robot):
    _ABSTRACT = False
    def get_end_effectors_ids(self): ...
    def get_end_effector_pose(self, end_effector): ...
    def robot_joints(self, include_gripper=False): ...
    def grippers(self): ...
    def suctions(self): ...
    def stop(self) -> None:
        {stop}
    def move_to_joints(self, target_joints: list[Joint], speed: {speed}, safe: bool = {safe}) -> None:
        self.go()
"""


@pytest.mark.parametrize(
    ("stop", "speed", "safe", "features"),
    [
        ("self.halt()", "float", "True", {"stop", "move_to_joints"}),
        ("raise Arcor2NotImplemented", "float", "True", {"move_to_joints"}),
        ("raise Arcor2NotImplemented('no')", "float", "True", {"move_to_joints"}),
        ("raise ValueError", "int", "True", {"stop"}),
        ("pass", "'float'", "False", {"stop"}),
    ],
)
def test_robot_features_are_detected(stop: str, speed: str, safe: str, features: set[str]) -> None:
    found = analyse(ROBOT.format(stop=stop, speed=speed, safe=safe))
    assert found.problem is None
    assert found.robot is not None
    assert {name for name, has in plain(found.robot.features).items() if has} == features
    assert not found.robot.multi_arm


def test_robots_with_several_arms_are_analysed() -> None:
    found = analyse("""
        from arcor2_hw.data.robot import RobotType
        class T(MultiArmRobot):
            _ABSTRACT = False
            robot_type = RobotType("cartesian").value if False else RobotType.CARTESIAN
            def get_arm_ids(self): ...
            def get_end_effectors_ids(self, arm_id=None): ...
            def get_end_effector_pose(self, end_effector, arm_id=None): ...
            def robot_joints(self, include_gripper=False, arm_id=None): ...
            def grippers(self, arm_id=None): ...
            def suctions(self, arm_id=None): ...
            def stop(self, arm_id: str | None = None) -> None:
                self.halt(arm_id)
            def set_hand_teaching_mode(self, enabled: bool) -> None:
                self.soft()
    """)
    assert found.problem is not None
    assert "robot_type must be a member of RobotType" in found.problem.what.text
    good = analyse("""
        class T(MultiArmRobot):
            _ABSTRACT = False
            def get_arm_ids(self): ...
            def get_end_effectors_ids(self, arm_id=None): ...
            def get_end_effector_pose(self, end_effector, arm_id=None): ...
            def robot_joints(self, include_gripper=False, arm_id=None): ...
            def grippers(self, arm_id=None): ...
            def suctions(self, arm_id=None): ...
            def stop(self, arm_id: str | None = None) -> None:
                self.halt(arm_id)
            def set_hand_teaching_mode(self, enabled: bool) -> None:
                self.soft()
    """)
    assert good.robot is not None
    assert good.robot.multi_arm
    assert good.robot.features.stop
    assert not good.robot.features.hand_teaching  # the arm is missing in its signature
    assert good.implemented == {"stop", "set_hand_teaching_mode"}


# ------------------------------------------------------------------------------------------------ problems
@pytest.mark.parametrize(
    ("source", "text", "line"),
    [
        ("class T(Generic:\n", "this is not valid Python", 6),
        ("class Other(Generic): ...\n", "the file has no class T", 1),
        ("\nclass T(Nothing): ...\n", "the base Nothing cannot be read", 7),
        ("from vendor_sdk import Base\nclass T(Base): ...\n", "the base vendor_sdk.Base cannot be read", 7),
        ("from .missing import Base\nclass T(Base): ...\n", "the imported module missing does not exist", 6),
        ("from arcor2_hw.objects import Nope\nclass T(Nope): ...\n", "the base Nope cannot be read", 7),
        ("from ..far import Base\nclass T(Base): ...\n", "leads outside of the package", 6),
        ("class T(T): ...\n", "its own ancestor", 6),
        ("class A(Generic): ...\nclass T(Generic, A): ...\n", "contradict each other", 7),
        ("class M: ...\nclass T(Generic, M): ...\n", "mixins must come before the base", 7),
        ("import sdk\nclass B(sdk.Base): ...\nclass T(B): ...\n", "the base sdk.Base cannot be read", 8),
        ("class T(Generic):\n    _ABSTRACT = compute()\n", "cannot be determined from the source", 7),
        (
            "class T(Generic):\n    def __init__(self, settings: int): ...\n",
            "settings must be a dataclass derived from Settings",
            7,
        ),
        (
            "from dataclasses import dataclass\n@dataclass\nclass S(Settings):\n    a: list\n"
            "class T(Generic):\n    def __init__(self, settings: S): ...\n",
            "setting a: the type list is not supported",
            9,
        ),
    ],
)
def test_problems_are_named_with_file_and_line(source: str, text: str, line: int) -> None:
    found = analyse(source)
    assert found.problem is not None
    assert text in found.problem.what.text
    assert (found.problem.path, found.problem.line) == ("object_types/T.py", line)
    assert found.meta.disabled
    assert found.meta.problem == str(found.problem) == f"object_types/T.py:{line}: {found.problem.what.text}"


def test_a_problem_in_another_file_names_that_file() -> None:
    lib = library(
        Broken="class Broken(Generic)\n",
        T="from .broken import Broken\nclass T(Broken): ...\n",
    )
    assert str(lib.analyse("T").problem).startswith("object_types/broken.py:6: this is not valid Python")
    lib.add(SourceFile("Broken", "broken", NEW.replace("    ", "") + "class Broken(Generic): ...\n"))
    assert lib.analyse("T").problem is None
    assert lib.analyse("T").meta.base == "Broken"
    lib.remove("Broken")
    assert "does not exist" in str(lib.analyse("T").problem)


def test_circular_bases_across_files_are_reported() -> None:
    lib = library(
        One="from .two import Two\nclass One(Two): ...\n",
        Two="from .one import One\nclass Two(One): ...\n",
    )
    for name in ("One", "Two"):
        assert "is its own ancestor" in str(lib.analyse(name).problem)


@pytest.mark.parametrize(
    "source",
    [
        b"\xff\xfe\x00class",
        b"# -*- coding: nonsense -*-\n",
        "a\0b",
        'x = "\ud800"',
        "-" * 100000 + "1",
        "x" + ".x" * 50000,
        "(" * 1000,
        "class T(Generic):\n    x = " + "1+" * 900 + "1",
        "from .t import *\nclass T(x): ...",
        "from .t import T as T\nclass U(T): ...",
        "T = T\n",
        "A = B\nB = A\nclass T(A): ...",
        "import t\nclass T(t.t.t.t): ...",
    ],
)
def test_unreadable_sources_are_reported(source: str | bytes) -> None:
    found = Library([SourceFile("T", "t", source)]).analyse("T")
    assert found.problem is not None
    assert found.problem.line >= 1
    msgspec.json.encode(found.meta)


def test_a_file_in_another_encoding_is_read() -> None:
    source = '# -*- coding: latin-1 -*-\nfrom arcor2_hw.objects import Generic\nclass T(Generic):\n    "Wägt."\n'
    assert Library([SourceFile("T", "t", source.encode("latin-1"))]).analyse("T").meta.description == "Wägt."


def test_imports_inside_try_may_fail() -> None:
    found = analyse("""
        from typing import TYPE_CHECKING
        if TYPE_CHECKING:
            from .nowhere import X
        try:
            from .fast import speed
        except ImportError:
            speed = 1.0
        class T(Generic):
            _ABSTRACT = False
    """)
    assert found.problem is None


def test_invalid_names_are_refused() -> None:
    with pytest.raises(InvalidData, match="Robot is built in"):
        Library([SourceFile("Robot", "robot", "")])
    with pytest.raises(NotFound, match="Nobody"):
        Library().analyse("Nobody")


def test_twenty_types_are_analysed_within_a_tenth_of_a_second() -> None:
    sources = [
        SourceFile(f"{name}{n}", module_name(f"{name}{n}"), textwrap.dedent(source).replace(name, f"{name}{n}"))
        for n in range(20)
        for name, source in DOBOT.items()
        if name == "AbstractDobot"
    ]
    best = min(_duration(sources) for _ in range(3))
    assert best < 0.1, f"{best:.3f} s for {len(sources)} types"


def _duration(sources: list[SourceFile]) -> float:
    start = time.process_time()
    lib = Library(sources)
    for name in lib.names():
        assert lib.analyse(name).problem is None
    return time.process_time() - start
