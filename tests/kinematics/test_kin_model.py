"""Forward kinematics against the drivers, the fakes and DH products."""

import math

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from arcor2_drivers.dobot_magician import kinematics as dobot_kinematics
from arcor2_drivers.two_axis_robot import kinematics as two_axis_kinematics
from arcor2_drivers.universal_robots.geometry import world_from_base
from arcor2_fakes.ur.kinematics import MODELS, Chain
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.exceptions import NotFound
from arcor2_hw.kinematics.dh import DhRow, calibrated, chain
from arcor2_hw.kinematics.errors import ModelError, ZeroLength
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Box, Capsule, Cylinder, triangles_of
from tests.kinematics.kin_robots import DOBOT, TWO_AXIS, UR, joint, links, six_axes, ur, urdf

TURN = st.floats(-2.0 * math.pi, 2.0 * math.pi)
SIX = st.tuples(TURN, TURN, TURN, TURN, TURN, TURN)


def rows_of(name: str) -> list[DhRow]:
    g = MODELS[name]
    half = math.pi / 2.0
    table = ((g.d1, 0.0, half), (0.0, g.a2, 0.0), (0.0, g.a3, 0.0), (g.d4, 0.0, half), (g.d5, 0.0, -half), (g.d6, 0, 0))
    return [DhRow(0.0, *row) for row in table]


@pytest.mark.parametrize("name", ["ur3e", "ur5e", "ur10e"])
@given(SIX)
def test_ur_forward_kinematics_matches_the_controller(name: str, q: tuple[float, ...]) -> None:
    x, y, z, origin = Chain(name).forward(q)
    in_base = np.eye(4)
    in_base[:3] = np.column_stack((x, y, z, origin))
    expected = world_from_base(Pose()) * Pose.from_matrix(in_base)
    assert np.allclose(ur(name).arm("tcp").forward(np.array(q)), expected.matrix(), atol=1e-9)


@given(SIX)
def test_link_poses_match_the_chain_and_the_jacobian_its_derivative(values: tuple[float, ...]) -> None:
    q = np.array(values)
    for model, tip in ((ur(), "tcp"), (six_axes(), "tool")):
        arm = model.arm(tip)
        inside = np.clip(q, np.maximum(arm.lower, -6.0), np.minimum(arm.upper, 6.0))
        assert np.allclose(model.link_poses(inside)[tip], arm.forward(inside), atol=1e-12)
        jacobian = arm.jacobian(inside)
        for number in range(6):
            step = np.eye(6)[number] * 1e-6
            before, after = arm.forward(inside - step), arm.forward(inside + step)
            turn = (after[:3, :3] - before[:3, :3]) @ arm.forward(inside)[:3, :3].T / 2e-6
            assert np.allclose(jacobian[:3, number], (after[:3, 3] - before[:3, 3]) / 2e-6, atol=1e-6)
            assert np.allclose(jacobian[3:, number], (turn[2, 1], turn[0, 2], turn[1, 0]), atol=1e-6)


@given(st.tuples(*(st.floats(low, high) for low, high in dobot_kinematics.LIMITS.values())), st.floats(0.0, 0.3))
def test_dobot_forward_kinematics_matches_its_driver_with_any_tool(
    q: tuple[float, float, float, float], tool: float
) -> None:
    model = RobotModel.load(DOBOT, {"tool_x": tool, "tool_z": -0.05, "port": "not a number, and none is needed"})
    assert model.joint_names == dobot_kinematics.JOINTS
    assert np.allclose(np.column_stack((model.lower, model.upper)), list(dobot_kinematics.LIMITS.values()))
    expected = dobot_kinematics.forward(q, tool, -0.05).pose
    assert np.allclose(model.arm("tcp").forward(np.array(q)), expected.matrix(), atol=1e-12)


@given(st.tuples(st.floats(-2.6, 2.6), st.floats(-2.6, 2.6)), st.floats(0.01, 1.0), st.floats(0.01, 1.0))
def test_two_axis_forward_kinematics_matches_its_driver_with_any_links(
    q: tuple[float, float], first: float, second: float
) -> None:
    arm = RobotModel.load(TWO_AXIS, {"link_1": first, "link_2": second}).arm("tcp")
    x, y, heading = two_axis_kinematics.forward((first, second), q)
    expected = Pose(Position(x, y, 0.0), Orientation.from_rotation_vector(0.0, 0.0, heading))
    assert np.allclose(arm.forward(np.array(q)), expected.matrix(), atol=1e-12)


def test_settings_change_limits_speeds_tools_and_the_boxes_of_links() -> None:
    values = {"link_1": 0.3, "lower_1": 0.5, "upper_1": 1.0, "max_joint_speed": 2.0}
    model = RobotModel.load(TWO_AXIS, values)
    assert (model.lower[0], model.upper[0], model.velocity[0]) == (0.5, 1.0, 2.0)
    boxes = [each for each in model.collision if each.link == "link_1"]
    assert [each.shape for each in boxes] == [Box(0.3, 0.03, 0.02)]
    assert boxes[0].origin[0, 3] == pytest.approx(0.15)
    tcp = Pose(Position(0.01, 0.02, 0.1), Orientation.from_rotation_vector(0.1, -0.7, 0.4))
    vector = tcp.orientation.rotation_vector()
    given_tcp = {
        f"tcp_{k}": v for k, v in zip(("x", "y", "z", "rx", "ry", "rz"), (*tcp.position, *vector), strict=True)
    }
    q = np.array((0.1, -1.0, 1.2, -0.4, 0.9, 0.3))
    plain = ur().arm("tcp").forward(q)
    assert np.allclose(RobotModel.load(UR / "ur5e", given_tcp).arm("tcp").forward(q), plain @ tcp.matrix())
    assert np.allclose(ur().arm("tcp", tcp.matrix()).forward(q), plain @ tcp.matrix())
    for wrong in ({"link_1": "long"}, {"link_1": math.nan}, {"link_1": True}, {"lower_1": 2.0, "upper_1": -2.0}):
        with pytest.raises(ModelError, match=r"link_1|joint_1"):
            RobotModel.load(TWO_AXIS, wrong)


SMALL = st.floats(-2e-3, 2e-3)


@settings(max_examples=50)
@given(SIX, st.lists(st.tuples(SMALL, SMALL, SMALL, SMALL), min_size=6, max_size=6))
def test_a_calibrated_arm_uses_its_own_parameters(
    q: tuple[float, ...], deltas: list[tuple[float, float, float, float]]
) -> None:
    rows = [row.plus(DhRow(*delta)) for row, delta in zip(rows_of("ur5e"), deltas, strict=True)]
    arm = calibrated(ur(), "tcp", rows).arm("tcp")
    expected = world_from_base(Pose()).matrix() @ chain(rows, q)
    assert np.allclose(arm.forward(np.array(q)), expected, atol=1e-9)


def test_offsets_along_parallel_axes_do_not_move_links() -> None:
    rows = rows_of("ur5e")
    rows[1] = rows[1].plus(DhRow(0.0, 400.0, 0.0, 0.0))
    rows[2] = rows[2].plus(DhRow(0.0, -400.0, 0.0, 0.0))
    model = calibrated(ur(), "tcp", rows)
    q = np.array((0.3, -1.2, 1.0, 0.4, 1.0, -2.0))
    assert np.allclose(model.arm("tcp").forward(q), ur().arm("tcp").forward(q), atol=1e-9)
    poses, nominal = model.link_poses(q), ur().link_poses(q)
    assert all(np.allclose(poses[link], nominal[link], atol=1e-9) for link in ur().links)


def test_the_calibration_of_another_arm_is_refused() -> None:
    with pytest.raises(ModelError, match=r"does not belong to|another robot"):
        calibrated(ur("ur5e"), "tcp", rows_of("ur10e"))
    with pytest.raises(ModelError, match="5 DH rows"):
        calibrated(ur(), "tcp", rows_of("ur5e")[:5])
    broken = [*rows_of("ur5e")[:5], DhRow(0.0, math.nan, 0.0, 0.0)]
    with pytest.raises(ModelError, match="not finite"):
        calibrated(ur(), "tcp", broken)


def test_joints_by_name_are_ordered_and_wrong_names_refused() -> None:
    model = ur()
    values = {name: 0.1 * number for number, name in enumerate(model.joint_names)}
    named = [Joint(name, value) for name, value in reversed(values.items())]
    assert model.values([*named, Joint("gripper", 1.0)]).tolist() == list(values.values())
    assert [(each.name, each.value) for each in model.named(model.values(named))] == list(values.items())
    with pytest.raises(ModelError, match="elbow_joint"):
        model.values([each for each in named if each.name != "elbow_joint"])
    with pytest.raises(ModelError, match="elbow_joint"):
        model.values([*named, Joint("elbow_joint", 0.0)])
    with pytest.raises(ModelError, match="elbow_joint"):
        model.values([each if each.name != "elbow_joint" else Joint("elbow_joint", math.inf) for each in named])
    with pytest.raises(NotFound, match="no end effector 'nose'"):
        model.arm("nose")


def test_each_end_effector_has_its_own_chain() -> None:
    text = links("base", "body", "left", "left_hand", "right", "right_hand")
    text += joint("trunk", "base", "body", kind="prismatic", limit='<limit lower="0" upper="0.5" velocity="0.1"/>')
    text += joint("left_1", "body", "left", xyz="0 0.2 0", axis="0 1 0")
    text += joint("left_2", "left", "left_hand", xyz="0.3 0 0", axis="0 1 0")
    text += joint("right_1", "body", "right", xyz="0 -0.2 0", axis="0 1 0")
    text += joint("right_2", "right", "right_hand", xyz="0.3 0 0", axis="0 1 0", more='<mimic joint="right_1"/>')
    model = RobotModel.load(urdf(text))
    assert model.joint_names == ("trunk", "left_1", "left_2", "right_1")
    assert list(model.end_effectors) == ["left_hand", "right_hand"]
    right = model.arm("right_hand")
    assert right.joint_names == ("trunk", "right_1")
    assert right.whole(np.array((0.1, 0.5))).tolist() == [0.1, 0.0, 0.0, 0.5]
    q = np.array((0.1, 0.7, -0.2, 0.5))
    assert np.allclose(model.link_poses(q)["right_hand"], right.forward(right.of(q)))
    assert np.allclose(
        right.forward(np.array((0.1, 0.5)))[:3, 3], (0.3 * math.cos(0.5), -0.2, 0.1 - 0.3 * math.sin(0.5))
    )
    assert np.allclose(right.forward(np.array((0.1, 0.5)))[:3, 0], (math.cos(1.0), 0.0, -math.sin(1.0)))
    # Both the mimicked joint and the one that mimics it move the hand, which turns twice as fast.
    assert right.jacobian(np.array((0.1, 0.5)))[4, 1] == pytest.approx(2.0)


def test_a_cylinder_between_balls_is_a_capsule() -> None:
    shapes = {each.link: each.shape for each in ur().collision}
    assert shapes["wrist_2_link"] == Capsule(0.04, 0.0997)
    assert isinstance(shapes["base_link"], Cylinder)
    assert len(ur().visual) > len(ur().collision)


def test_collision_shapes_end_at_the_flange() -> None:
    q = np.array((0.4, -1.1, 0.9, -0.3, 0.6, 0.2))
    flange = ur().link_poses(q)["flange"]
    last = [each for each in ur().collision if each.link == "wrist_3_link"]
    points = np.concatenate(
        [triangles_of(each.shape).vertices @ each.origin[:3, :3].T + each.origin[:3, 3] for each in last]
    )
    world = points @ ur().link_poses(q)["wrist_3_link"][:3, :3].T + ur().link_poses(q)["wrist_3_link"][:3, 3]
    assert ((world - flange[:3, 3]) @ flange[:3, 2]).max() == pytest.approx(0.0, abs=1e-9)


def test_a_stretched_elbow_and_a_straight_wrist_are_near_a_singularity() -> None:
    arm = ur().arm("tcp")
    good = arm.dexterity(np.array((0.3, -1.2, 1.4, -0.4, 1.3, 0.2)))
    assert not good.near_singularity
    assert good.manipulability == pytest.approx(
        abs(np.linalg.det(arm.jacobian(np.array((0.3, -1.2, 1.4, -0.4, 1.3, 0.2)))))
    )
    assert arm.dexterity(np.array((0.3, -1.2, 1.4, -0.4, 0.01, 0.2))).near_singularity
    assert arm.dexterity(np.array((0.3, -1.2, 0.01, -0.4, 1.3, 0.2))).near_singularity


def test_two_joints_on_one_axis_have_no_link_between() -> None:
    text = links("base", "l1", "flat", "l2") + joint("j1", "base", "l1", xyz="0 0 0.1")
    text += joint("fix", "l1", "flat", kind="fixed", rpy="0 0 1", limit="")
    text += joint("j2", "flat", "l2", xyz="0 0 0.2")
    with pytest.raises(ZeroLength, match="l1 has no length between the joints j1 and j2"):
        RobotModel.load(urdf(text))
    RobotModel.load(urdf(text.replace('xyz="0 0 0.2"', 'xyz="0.1 0 0.2"')))
