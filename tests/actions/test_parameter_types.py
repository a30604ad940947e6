"""The ten parameter types: exact types, ranges, references, and their form in scripts and events."""

import ast
import math

import msgspec
import pytest
from hypothesis import given, strategies as st

from arcor2_hw.actions import PARAMETER_TYPES, IntEnum, StrEnum, by_annotation
from arcor2_hw.actions.json_values import decode_json, encode
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import ParameterMeta
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import ActionPoint, NamedOrientation, Project, ProjectRobotJoints
from arcor2_hw.data.project_index import ProjectIndex
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.exceptions import InvalidData
from tests.protocol import PROTOCOL

QUARTER = Orientation(0, 0, math.sin(math.pi / 4), math.cos(math.pi / 4))


@pytest.fixture
def index() -> ProjectIndex:
    scene = Scene(
        "s",
        id="scn",
        objects=[
            SceneObject("table", "Table", Pose(Position(1, 0, 0), QUARTER), id="obj_table"),
            SceneObject("robot", "R", Pose(), id="obj_robot"),
        ],
    )
    joints = ProjectRobotJoints("j", "obj_robot", [Joint("a", 0.5)], True, id="joi")
    parent = ActionPoint("p", Position(0, 0, 1), parent="obj_table", id="acp_parent")
    child = ActionPoint(
        "c",
        Position(1, 0, 0),
        parent="acp_parent",
        id="acp",
        orientations=[NamedOrientation("o", Orientation(), id="ori")],
        robot_joints=[joints],
    )
    return ProjectIndex(scene, Project("p", "scn", id="pro", action_points=[parent, child]))


class Names:
    """Script names that contain the requested id."""

    def pose(self, orientation_id: str) -> ast.expr:
        return ast.Name(f"pose_{orientation_id}")

    def position(self, action_point_id: str) -> ast.expr:
        return ast.Name(f"position_{action_point_id}")

    def joints(self, joints_id: str) -> ast.expr:
        return ast.Name(f"joints_{joints_id}")

    def enum_member(self, parameter: Parameter, value: str | int) -> ast.expr:
        return ast.Attribute(ast.Name("E"), f"{parameter.name}_{value}")


def check(kind: str, value: str, index: ProjectIndex | None = None, extra: str | None = None, **more: str) -> None:
    meta = ParameterMeta("p", kind) if extra is None else ParameterMeta("p", kind, extra=extra)
    PARAMETER_TYPES[kind].check(Parameter("p", kind, value), meta, index, **more)


def test_all_types_of_the_protocol_exist() -> None:
    assert sorted(PARAMETER_TYPES) == PROTOCOL["parameter_types"]


@pytest.mark.parametrize(
    ("hint", "name"),
    [
        ("bool", "boolean"),
        ("int", "integer"),
        ("float", "double"),
        ("str", "string"),
        ("Pose", "pose"),
        ("common.Pose", "pose"),
        ("Position", "position"),
        ("ProjectRobotJoints", "joints"),
        ("Image.Image", "image"),
        ("PIL.Image.Image", "image"),
        ("StrEnum", "string_enum"),
        ("IntEnum", "integer_enum"),
    ],
)
def test_type_hints_map_to_parameter_types(hint: str, name: str) -> None:
    found = by_annotation(hint)
    assert found is not None
    assert found.name == name
    assert by_annotation("dict") is None


ACCEPTED = {
    "boolean": ["true", "false"],
    "integer": ["0", "-3", "12345678901234567890123"],
    "double": ["1.0", "1e3", "-0.5"],
    "string": ['"a"', '""'],
}


@pytest.mark.parametrize("kind", ACCEPTED)
def test_a_literal_must_have_exactly_its_type(kind: str) -> None:
    for other, values in ACCEPTED.items():
        for value in values:
            if other == kind:
                check(kind, value)
            else:
                with pytest.raises(InvalidData, match="parameter p"):
                    check(kind, value)


@pytest.mark.parametrize("value", ["", "nope", "NaN", "1e400", "[", "[" * 5000, "null", '{"a":1}', "1 2"])
@pytest.mark.parametrize("kind", PARAMETER_TYPES)
def test_an_invalid_literal_is_refused_by_name(kind: str, value: str, index: ProjectIndex) -> None:
    with pytest.raises(InvalidData, match="parameter p"):
        check(kind, value, index)


def test_declared_ranges_and_values_are_checked() -> None:
    bounds = '{"minimum":0.0,"maximum":1.0}'
    for inside in ("0.0", "0.5", "1.0"):
        check("double", inside, extra=bounds)
    for outside in ("-0.1", "1.0001"):
        with pytest.raises(InvalidData, match=r"parameter p.*within 0\.0 and 1\.0"):
            check("double", outside, extra=bounds)
    check("integer", "5", extra='{"maximum":5}')
    with pytest.raises(InvalidData):
        check("integer", "6", extra='{"maximum":5}')
    check("string_enum", '"B"', extra='{"allowed_values":["A","B"]}')
    with pytest.raises(InvalidData, match="not one of 'A', 'B'"):
        check("string_enum", '"C"', extra='{"allowed_values":["A","B"]}')
    check("integer_enum", "1", extra='{"allowed_values":[1,2]}')
    with pytest.raises(InvalidData):
        check("integer_enum", "true", extra='{"allowed_values":[1,2]}')
    with pytest.raises(InvalidData, match="its declaration is invalid"):
        check("integer", "5", extra='{"maximum":"x"}')


def test_a_different_declared_type_is_refused() -> None:
    with pytest.raises(InvalidData, match="must be of type double"):
        PARAMETER_TYPES["double"].check(Parameter("p", "integer", "1.0"), ParameterMeta("p", "double"))
    with pytest.raises(InvalidData, match="must be of type string"):
        PARAMETER_TYPES["double"].check(Parameter("p", "double", "1.0"), ParameterMeta("p", "string"))


def test_references_are_resolved_to_world_coordinates(index: ProjectIndex) -> None:
    for kind, known in (("pose", "ori"), ("position", "acp"), ("joints", "joi")):
        check(kind, f'"{known}"', index)
        with pytest.raises(InvalidData, match=r"parameter p.*unknown_id"):
            check(kind, '"unknown_id"', index)
        with pytest.raises(InvalidData, match="in a project only"):
            check(kind, f'"{known}"')
    # The table turns the child's (1, 0, 1) by 90 degrees about z and moves it by (1, 0, 0).
    pose = PARAMETER_TYPES["pose"].value(Parameter("p", "pose", '"ori"'), index)
    assert list(pose.position) == pytest.approx([1, 1, 1])
    assert list(pose.orientation) == pytest.approx(list(QUARTER))
    position = PARAMETER_TYPES["position"].value(Parameter("p", "position", '"acp"'), index)
    assert list(position) == pytest.approx([1, 1, 1])


def test_an_action_gets_copies(index: ProjectIndex) -> None:
    for kind, known in (("pose", "ori"), ("position", "acp_parent"), ("joints", "joi")):
        first = PARAMETER_TYPES[kind].value(Parameter("p", kind, f'"{known}"'), index)
        if kind == "joints":
            first.joints[0].value = 9.0
        else:
            getattr(first, "position", first).x = 9.0
        second = PARAMETER_TYPES[kind].value(Parameter("p", kind, f'"{known}"'), index)
        assert second != first


def test_joints_of_another_robot_are_refused(index: ProjectIndex) -> None:
    check("joints", '"joi"', index, robot_id="obj_robot")
    with pytest.raises(InvalidData, match="parameter p: joints j belong to another robot"):
        check("joints", '"joi"', index, robot_id="obj_other")


def test_an_image_is_never_a_literal(index: ProjectIndex) -> None:
    parameter = Parameter("p", "image", '"x"')
    for call in (
        lambda kind: kind.check(parameter, None, index),
        lambda kind: kind.value(parameter, index),
        lambda kind: kind.expression(parameter, Names()),
    ):
        with pytest.raises(InvalidData, match="parameter p"):
            call(PARAMETER_TYPES["image"])


@given(st.one_of(st.booleans(), st.integers(), st.floats(allow_nan=False, allow_infinity=False), st.text()))
def test_scalars_survive_script_and_event(value: object) -> None:
    kind = {bool: "boolean", int: "integer", float: "double", str: "string"}[type(value)]
    try:
        text = PARAMETER_TYPES[kind].encode(value)
    except InvalidData:
        assert isinstance(value, str)  # lone surrogates alone have no UTF-8
        return
    parameter = Parameter("p", kind, text)
    PARAMETER_TYPES[kind].check(parameter, None)
    source = ast.unparse(ast.fix_missing_locations(PARAMETER_TYPES[kind].expression(parameter, Names())))
    back = ast.literal_eval(source)
    assert back == value
    assert type(back) is type(value)
    assert ast.dump(ast.parse(source, mode="eval").body) == ast.dump(
        PARAMETER_TYPES[kind].expression(parameter, Names())
    )


@pytest.mark.parametrize(
    ("kind", "value", "source"),
    [
        ("pose", '"ori"', "pose_ori"),
        ("position", '"acp"', "position_acp"),
        ("joints", '"joi"', "joints_joi"),
        ("string_enum", '"A"', "E.p_A"),
        ("integer_enum", "3", "E.p_3"),
        ("double", "-0.0", "-0.0"),
    ],
)
def test_scripts_refer_to_points_by_name(kind: str, value: str, source: str) -> None:
    assert ast.unparse(PARAMETER_TYPES[kind].expression(Parameter("p", kind, value), Names())) == source


def test_results_keep_their_type() -> None:
    assert PARAMETER_TYPES["double"].encode(2) == "2.0"
    assert PARAMETER_TYPES["integer"].encode(2) == "2"
    for kind, wrong in (
        ("double", True),
        ("double", math.nan),
        ("integer", True),
        ("integer", 1.5),
        ("integer_enum", True),
        ("pose", 1),
    ):
        with pytest.raises(InvalidData):
            PARAMETER_TYPES[kind].encode(wrong)
    pose = Pose(Position(1, 2, 3))
    assert decode_json(PARAMETER_TYPES["pose"].encode(pose), Pose) == pose
    with pytest.raises(InvalidData):
        decode_json('{"position": 1}', Pose)
    with pytest.raises(InvalidData, match="object"):
        encode(object())


def test_depth_images_are_encoded_without_loss() -> None:
    image = pytest.importorskip("PIL.Image")
    depth = image.new("I;16", (3, 2))
    depth.putpixel((1, 1), 4711)
    kind = PARAMETER_TYPES["image"]
    back = kind.decode_json(kind.encode(depth), None)
    assert back.getpixel((1, 1)) == 4711
    text = msgspec.json.decode(kind.encode(image.new("RGB", (8, 8))))
    assert text.encode("latin-1").startswith(b"\xff\xd8")
    with pytest.raises(InvalidData):
        kind.decode_json('"no picture"', None)


def test_enumerations_return_the_set_of_their_values() -> None:
    texts = StrEnum("Side", {"LEFT": "left", "RIGHT": "right"})
    numbers = IntEnum("Level", {"LOW": 1, "HIGH": 2, "TOP": 2})
    assert texts.set() == {"left", "right"}
    assert {type(value) for value in texts.set()} == {str}
    assert numbers.set() == {1, 2}
