"""Robots whose object types were written for ARCOR2, with other parameter names than our base classes."""

from pathlib import Path
from typing import Any

from tests.server.protocol.in_process_server import Actor, Stage, open_stage, refused, until_event


async def tip_of(actor: Actor, robot: str, **arm: str) -> dict[str, float]:
    pose = await actor.ask("GetEndEffectorPose", robot_id=robot, end_effector_id="tip", **arm)
    found: dict[str, float] = pose["position"]
    return found


async def project(stage: Stage, alice: Actor, **objects: str) -> None:
    await stage.place(alice, **objects)
    await alice.ask("SaveScene")
    await alice.ask("NewProject", scene_id=stage.services.session.require_scene().id, name="project")
    await stage.start(alice)


async def test_a_robot_that_names_the_end_effector_differently_is_operated(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "OlderArm") as stage:
        alice = await stage.person("alice")
        await project(stage, alice, arm="OlderArm")
        arm = stage.ids["arm"]
        assert await tip_of(alice, arm) == {"x": 0.4, "y": 0.1, "z": 0.3}
        assert await alice.ask("GetEndEffectors", robot_id=arm) == ["tip"]

        # Values of a parameter, from a method whose own parameter has another name.
        chosen = [{"id": "group", "value": "a"}]
        values = await alice.ask("ActionParamValues", id=arm, param_id="program", parent_params=chosen)
        assert sorted(values) == ["a1", "a2"]
        assert "group" in await refused(alice, "ActionParamValues", id=arm, param_id="program", parent_params=[])

        # The ordinary stream of poses.
        await alice.ask("RegisterForRobotEvent", robot_id=arm, what="eef_pose", send=True)
        streamed = await until_event(alice, "RobotEef", robot_id=arm)
        (eef,) = streamed["end_effectors"]
        assert (eef["end_effector_id"], eef["pose"]["position"]["x"]) == ("tip", 0.4)
        await alice.ask("RegisterForRobotEvent", robot_id=arm, what="eef_pose", send=False)

        # An action point where the robot is.
        await alice.ask("AddApUsingRobot", robot_id=arm, end_effector_id="tip", name="here")
        (point,) = stage.services.session.require_project().action_points
        assert (point.position.x, point.position.y, point.position.z) == (0.4, 0.1, 0.3)
        assert [joint.value for joint in point.robot_joints[0].joints] == [0.4, 0.1, 0.3]

        # Steps, as existing clients jog.
        step: dict[str, Any] = {"robot_id": arm, "end_effector_id": "tip", "axis": "x", "what": "position"}
        await alice.lock(arm)
        await alice.ask("StepRobotEef", **step, mode="world", step=0.05)
        await until_event(alice, "RobotMoveToPose", move_event_type="end")
        assert (await tip_of(alice, arm))["x"] == 0.45

        # Motion while a button is held.
        held = {"robot_id": arm, "hold": 1, "sent_ms": 0, "valid_ms": 200}
        answer = await alice.ask("JogRobot", **held, linear={"x": 0, "y": 0, "z": 0.1})
        assert answer["scale"] > 0
        assert (await tip_of(alice, arm))["z"] > 0.3
        await alice.ask("JogRobot", **held | {"valid_ms": 0})


async def test_a_robot_that_names_the_arm_differently_is_operated(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "OlderArms") as stage:
        alice = await stage.person("alice")
        await project(stage, alice, robot="OlderArms")
        robot = stage.ids["robot"]
        # Arms are the values of an enumeration of the source.
        assert sorted(await alice.ask("GetRobotArms", robot_id=robot)) == ["left", "right"]
        assert await alice.ask("GetGrippers", robot_id=robot, arm_id="left") == ["left_jaw"]
        assert await alice.ask("GetSuctions", robot_id=robot, arm_id="right") == ["right_cup"]
        assert await alice.ask("GetEndEffectors", robot_id=robot, arm_id="left") == ["tip"]
        joints = await alice.ask("GetRobotJoints", robot_id=robot, arm_id="right")
        assert joints == [{"name": "right_1", "value": 0.25}]
        assert (await tip_of(alice, robot, arm_id="left"))["y"] == 0.5
        assert (await tip_of(alice, robot, arm_id="right"))["y"] == -0.5

        await alice.ask("RegisterForRobotEvent", robot_id=robot, what="eef_pose", send=True)
        streamed = await until_event(alice, "RobotEef", robot_id=robot)
        places = {eef["arm_id"]: eef["pose"]["position"]["y"] for eef in streamed["end_effectors"]}
        assert places == {"left": 0.5, "right": -0.5}
        await alice.ask("RegisterForRobotEvent", robot_id=robot, what="joints", send=True)
        both = await until_event(alice, "RobotJoints", robot_id=robot)
        assert [joint["name"] for joint in both["joints"]] == ["left_1", "right_1"]

        await alice.ask("AddApUsingRobot", robot_id=robot, end_effector_id="tip", arm_id="right", name="here")
        (point,) = stage.services.session.require_project().action_points
        assert (point.position.y, point.robot_joints[0].arm_id) == (-0.5, "right")
