"""Reachability of the open project: requests, events, and updates after changes."""

import asyncio
import os
import signal
from pathlib import Path
from typing import Any

from arcor2_hw.collision.description import Obstacle
from arcor2_hw.compute.kinematics_tasks import DescribeRobot
from arcor2_hw.compute.task import WorkerKind
from arcor2_hw.data.base import UNSET
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.object_type import Box, ObjectModel, ObjectTypeSource
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.data.robot import Joint
from arcor2_server.documents.changes import Kind
from tests.server.protocol.devices import PART
from tests.server.protocol.in_process_server import PATIENCE, Actor, Stage, open_stage, refused, until

DOWN = {"x": 1, "y": 0, "z": 0, "w": 0}
CRATE = PART.replace("class Part", "class Crate")


async def point(person: Actor, stage: Stage, name: str, x: float, y: float, z: float) -> tuple[str, str]:
    """Add an action point with an orientation that points down. Return both ids."""
    await person.ask("AddActionPoint", name=name, position={"x": x, "y": y, "z": z})
    (added,) = [each for each in stage.services.session.require_project().action_points if each.name == name]
    await person.lock(added.id)
    await person.ask("AddActionPointOrientation", action_point_id=added.id, orientation=DOWN)
    await person.ask("WriteUnlock", object_id=added.id)
    (updated,) = [each for each in stage.services.session.require_project().action_points if each.name == name]
    return added.id, updated.orientations[0].id


async def move(person: Actor, point_id: str, x: float, y: float, z: float) -> None:
    await person.lock(point_id, tree=True)
    await person.ask("UpdateActionPointPosition", action_point_id=point_id, new_position={"x": x, "y": y, "z": z})
    await person.ask("WriteUnlock", object_id=point_id)


def latest_results(person: Actor) -> dict[str, str]:
    """Return the latest result of each item from the events so far."""
    found: dict[str, str] = {}
    for message in person.waiting:
        if message.get("event") == "ReachabilityChanged":
            found |= {item["id"]: item["reach"] for item in message["data"]["items"]}
    return found


async def prepared(stage: Stage, alice: Actor) -> str:
    crate = ObjectModel.of(Box("Crate", 0.2, 0.2, 0.2))
    await stage.services.types.add(ObjectTypeSource("Crate", CRATE.lstrip(), model=crate))
    await alice.ask("NewScene", name="scene")
    robot = await stage.add(alice, "ur", "UR5e", Pose(), host="127.0.0.99")
    await stage.add(alice, "crate", "Crate", Pose(Position(0, 5, 0)))
    await alice.ask("SaveScene")
    await alice.ask("NewProject", scene_id=stage.services.session.require_scene().id, name="project")
    return robot


async def test_reachability_is_published_and_follows_edits(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        alice, bob, carol = await stage.person("alice"), await stage.person("bob"), await stage.person()
        assert "is open" in await refused(alice, "Reachability")
        robot = await prepared(stage, alice)
        near_point, near = await point(alice, stage, "near", 0.4, 0.2, 0.3)
        _, far = await point(alice, stage, "far", 3, 0, 0)
        await bob.ask("SubscribeEvents", events=["ReachabilityChanged"])
        await until(lambda: latest_results(bob) == {near: "reachable", far: "out_of_reach"})
        (event, *_) = [m["data"] for m in bob.waiting if m.get("event") == "ReachabilityChanged"]
        assert (event["robot_id"], event["end_effector_id"]) == (robot, "tcp")
        assert "arm_id" not in event
        assert not any(m.get("event") == "ReachabilityChanged" for m in [*alice.waiting, *carol.waiting])

        (answer,) = await carol.ask("Reachability")
        assert answer["revision"] == stage.services.session.revision
        items = {item["id"]: item for item in answer["items"]}
        assert items[near] == {"id": near, "reach": "reachable"}
        assert "reaches" in items[far]["reason"]
        (answer,) = await carol.ask("Reachability", robot_id=robot, end_effector_id="tcp", ids=[far])
        assert [item["id"] for item in answer["items"]] == [far]
        assert await carol.ask("Reachability", end_effector_id="other") == []

        # Only changed results are sent.
        bob.take()
        await move(alice, near_point, 2.5, 0, 0)
        await until(lambda: latest_results(bob) == {near: "out_of_reach"})
        bob.take()
        await move(alice, near_point, 0.4, 0.2, 0.3)
        await until(lambda: latest_results(bob) == {near: "reachable"})
        bob.take()
        # An obstacle is added, and removed again.
        stage.services.collisions.put(Obstacle.of(Box("box", 0.2, 0.2, 0.2), Pose(Position(0.4, 0.2, 0.3))))
        await until(lambda: latest_results(bob) == {near: "in_collision"})
        (answer,) = await carol.ask("Reachability", ids=[near])
        assert "box" in answer["items"][0]["reason"]
        assert answer["items"][0].keys() == {"id", "reach", "reason"}
        (answer,) = await carol.ask("Reachability", ids=[near], codes=True)
        (item,) = answer["items"]
        assert item["key"] == "Reached only in collision: {contact}."
        contact = item["values"]["contact"]
        assert (contact["key"], contact["values"]["second"]) == ("{first} and {second}", "box")
        assert contact["values"]["first"].startswith("ur"), "the name of the robot, not its id"
        bob.take()
        stage.services.collisions.remove("box")
        await until(lambda: latest_results(bob) == {near: "reachable"})
        # Stored joints count too, for their robot.
        names = [joint.name for joint in (await _joints(stage))]
        bob.take()
        beyond = [Joint(name, value) for name, value in zip(names, (0, -1.2, 1, -1.4, -1.57, 9), strict=True)]
        key = await _add_joints(stage, near_point, robot, beyond)
        await until(lambda: latest_results(bob) == {key: "out_of_reach"})

        for args, words in (
            ({"robot_id": stage.ids["crate"]}, "not a robot"),
            ({"robot_id": "nobody"}, "nobody"),
            ({"ids": ["ori_none"]}, "ori_none"),
        ):
            assert words in await refused(carol, "Reachability", **args)


async def _joints(stage: Stage) -> list[Any]:
    model = stage.services.robot_models.require(stage.services.session.document.scene_object(stage.ids["ur"]), "")
    return (await stage.services.compute.run(DescribeRobot(model))).joints


async def _add_joints(stage: Stage, point_id: str, robot: str, joints: list[Joint]) -> str:
    """Add joints to a point without the request, which needs a robot that is online."""
    session = stage.services.session
    value = ProjectRobotJoints("kept", robot, joints, True, id="jnt_kept")
    await session.commit("alice", [session.document.add(Kind.JOINTS, "jnt_kept", value, parent=point_id)])
    return "jnt_kept"


JOINT_ARM = """
from .arm import Arm
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.robot import Joint

NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")


class JointArm(Arm):
    _ABSTRACT = False
    urdf_package_name = "ur5e.zip"

    def __init__(self, obj_id: str, name: str, pose: Pose) -> None:
        super().__init__(obj_id, name, pose)
        self._now = [Joint(f"{n}_joint", v) for n, v in zip(NAMES, (0.0, -1.57, 1.57, -1.57, -1.57, 0.0))]

    def robot_joints(self, include_gripper: bool = False) -> list[Joint]:
        return self._now

    def move_to_joints(self, target_joints: list[Joint], speed: float, safe: bool = True) -> None:
        self._now = target_joints

    def get_end_effectors_ids(self) -> set[str]:
        return {"tcp"}
"""


async def test_two_arms_are_obstacles_for_each_other(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Arm") as stage:
        alice, bob = await stage.person("alice"), await stage.person("bob")
        await stage.services.types.add(ObjectTypeSource("JointArm", JOINT_ARM.lstrip()))
        await alice.ask("NewScene", name="scene")
        await stage.add(alice, "arm", "JointArm", Pose())
        other = await stage.add(alice, "other", "JointArm", Pose(Position(0, 1, 0)))
        await alice.ask("SaveScene")
        await alice.ask("NewProject", scene_id=stage.services.session.require_scene().id, name="project")
        _, between = await point(alice, stage, "between", 0.134, 0.492, 0.488)
        await alice.ask("SaveProject")
        await bob.ask("SubscribeEvents", events=["ReachabilityChanged"])

        async def reach(expected: dict[str, str]) -> dict[str, str]:
            """Wait until these results have been published. Return the reasons."""
            found: dict[str, str] = {}
            async with asyncio.timeout(PATIENCE):
                while found != expected:
                    rows = await alice.ask("Reachability", ids=[between])
                    found = {row["robot_id"]: row["items"][0]["reach"] for row in rows}
            return {row["robot_id"]: row["items"][0].get("reason", "") for row in rows}

        free = dict.fromkeys((stage.ids["arm"], other), "reachable")
        await reach(free)
        await stage.start(alice)
        bob.take()
        joints = await alice.ask("GetRobotJoints", robot_id=other)
        await alice.ask("MoveToJoints", robot_id=other, speed=1.0, joints=[joints[0] | {"value": -1.57}, *joints[1:]])
        reasons = await reach(free | {stage.ids["arm"]: "in_collision"})
        assert "arm/wrist" in reasons[stage.ids["arm"]]
        assert "other/wrist" in reasons[stage.ids["arm"]]
        assert latest_results(bob) == {between: "in_collision"}, "without an edit"
        await alice.ask("MoveToJoints", robot_id=other, speed=1.0, joints=joints)
        await reach(free)
        await alice.ask("MoveToJoints", robot_id=other, speed=1.0, joints=[joints[0] | {"value": -1.57}, *joints[1:]])
        await reach(free | {stage.ids["arm"]: "in_collision"})
        await stage.stop(alice)
        await reach(free)


CLAW = """
from arcor2_hw.objects import Gripper
from arcor2_hw.objects.small import GripperState


class Claw(Gripper):
    _ABSTRACT = False

    def activate(self) -> None:
        self.set_part(0.05, 0.05, 0.15, 0.09)

    def grip(self, width: float, force: float, speed: float) -> tuple[bool, float]:
        self.attach_part()
        return True, width

    def release(self) -> None:
        self.detach_part()

    def state(self) -> GripperState:
        return GripperState.HOLDING
"""


async def test_a_gripped_part_is_an_obstacle_online(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Arm") as stage:
        alice, bob = await stage.person("alice"), await stage.person("bob")
        crate = ObjectModel.of(Box("Crate", 0.2, 0.2, 0.2))
        for kind, source, model in (("JointArm", JOINT_ARM, UNSET), ("Claw", CLAW, UNSET), ("Crate", CRATE, crate)):
            await stage.services.types.add(ObjectTypeSource(kind, source.lstrip(), model=model))
        await alice.ask("NewScene", name="scene")
        robot = await stage.add(alice, "arm", "JointArm", Pose())
        await stage.add(alice, "crate", "Crate", Pose(Position(0.134, 0.492, 0.238)))
        await alice.ask("AddObjectToScene", name="claw", type="Claw", parameters=[])
        stage.ids |= {obj.name: obj.id for obj in stage.services.session.require_scene().objects}
        await alice.ask("SaveScene")
        await alice.ask("NewProject", scene_id=stage.services.session.require_scene().id, name="project")
        _, above = await point(alice, stage, "above", 0.134, 0.492, 0.488)
        await alice.ask("SaveProject")
        await bob.ask("SubscribeEvents", events=["ReachabilityChanged"])
        await until(lambda: latest_results(bob) == {above: "reachable"})
        await stage.start(alice)

        async def claw(method: str, **args: float) -> None:
            await stage.services.online.call(stage.ids["claw"], method, args)

        await claw("activate")
        bob.take()
        await claw("grip", width=0.0, force=1.0, speed=1.0)
        await until(lambda: latest_results(bob) == {above: "in_collision"})
        (row,) = await alice.ask("Reachability", robot_id=robot, ids=[above])
        assert "part of claw and crate" in row["items"][0]["reason"]
        assert "part of claw" in stage.services.scene_collisions.online_obstacles()
        bob.take()
        await claw("release")
        await until(lambda: latest_results(bob) == {above: "reachable"})
        bob.take()
        await claw("grip", width=0.0, force=1.0, speed=1.0)
        await until(lambda: latest_results(bob) == {above: "in_collision"})
        bob.take()
        await stage.stop(alice)
        await until(lambda: latest_results(bob) == {above: "reachable"})


async def test_reachability_ends_with_the_document_and_survives_a_worker_crash(tmp_path: Path) -> None:
    async with open_stage(tmp_path) as stage:
        alice, bob = await stage.person("alice"), await stage.person("bob")
        await prepared(stage, alice)
        near_point, near = await point(alice, stage, "near", 0.4, 0.2, 0.3)
        await bob.ask("SubscribeEvents", events=["ReachabilityChanged"])
        await until(lambda: latest_results(bob) == {near: "reachable"})
        compute, board = stage.services.compute, stage.services.reachability
        pid = compute.pid(WorkerKind.KINEMATICS)
        assert pid is not None
        bob.take()
        os.kill(pid, signal.SIGSTOP)
        await move(alice, near_point, 2.5, 0, 0)
        await until(lambda: compute._workers[WorkerKind.KINEMATICS].process is not None and not board._idle.is_set())
        os.kill(pid, signal.SIGKILL)
        await until(lambda: latest_results(bob) == {near: "out_of_reach"})

        pid = compute.pid(WorkerKind.KINEMATICS)
        assert pid is not None
        os.kill(pid, signal.SIGSTOP)
        await move(alice, near_point, 0.4, 0.2, 0.3)
        bob.take()
        await alice.ask("CloseProject", force=True)
        assert board._working is None, "nothing is computed for a closed project"
        os.kill(pid, signal.SIGCONT)
        assert "is open" in await refused(alice, "Reachability")
        assert latest_results(bob) == {}


async def test_a_damaged_robot_model_is_reported(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Arm") as stage:
        alice = await stage.person("alice")
        await alice.ask("NewScene", name="scene")
        await stage.add(alice, "arm", "Arm", Pose())
        await alice.ask("SaveScene")
        await alice.ask("NewProject", scene_id=stage.services.session.require_scene().id, name="project")
        await point(alice, stage, "near", 0.4, 0.2, 0.3)
        async with asyncio.timeout(PATIENCE):
            while True:
                (answer,) = await alice.ask("Reachability")
                assert [item["reach"] for item in answer["items"]] == ["unknown"]
                if "reason" in answer["items"][0]:  # the server may not know yet that the model is damaged
                    break
        assert "arm.zip" in answer["items"][0]["reason"]
