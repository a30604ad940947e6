"""Edits that no recorded session contains: effects, events and refusals."""

from pathlib import Path
from typing import Any

from tests.server.protocol.in_process_server import Actor, Stage, open_stage, refused


def new_events(actor: Actor) -> list[tuple[str, str | None, str | None, Any]]:
    """Return the events since the last call: name, change, parent, data."""
    return [(e["event"], e.get("change_type"), e.get("parent_id"), e.get("data")) for e in actor.events()]


async def test_object_settings_and_collision_models_are_changed(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Chooser", "Part", "Plain") as stage:
        alice, bob = await stage.person("alice"), await stage.person("bob")
        await stage.place(alice, chooser="Chooser", plain="Plain")
        chooser = stage.ids["chooser"]
        parameters = [{"name": "greeting", "type": "string", "value": '"hi"'}]
        update: dict[str, Any] = {"id": chooser, "parameters": parameters}
        assert "hold" in await refused(alice, "UpdateObjectParameters", **update)
        await alice.lock(chooser)
        for wrong in ({"name": "size", "type": "string", "value": '"x"'}, parameters[0] | {"type": "integer"}):
            await refused(alice, "UpdateObjectParameters", id=chooser, parameters=[wrong])
        bob.take()
        await alice.ask("UpdateObjectParameters", dry_run=True, **update)
        assert bob.events() == []
        await alice.ask("UpdateObjectParameters", **update)
        ((event, change, parent, data),) = new_events(bob)
        assert (event, change, parent) == ("SceneObjectChanged", "update", None)
        assert (data["id"], data["parameters"]) == (chooser, parameters)
        await alice.ask("WriteUnlock", object_id=chooser)

        box = {"type": "Box", "box": {"id": "Plain", "size_x": 1, "size_y": 2, "size_z": 3}}
        model: dict[str, Any] = {"object_type_id": "Plain", "object_model": box}
        assert "hold" in await refused(alice, "UpdateObjectModel", **model)
        await alice.lock("Plain")
        other = {"type": "Box", "box": box["box"] | {"id": "Other"}}  # type: ignore[operator]
        assert "needs the id" in await refused(alice, "UpdateObjectModel", **model | {"object_model": other})
        assert "no collision model" in await refused(
            alice, "UpdateObjectModel", **model | {"object_type_id": "Chooser"}
        )
        bob.take()
        await alice.ask("UpdateObjectModel", **model)
        ((event, change, parent, data),) = new_events(bob)
        assert (event, change, parent) == ("ChangedObjectTypes", "update", None)
        assert [(meta["type"], meta["object_model"]) for meta in data] == [("Plain", box)]
        assert "already" in await refused(alice, "UpdateObjectModel", **model)
        await alice.ask("WriteUnlock", object_id="Plain")

        await alice.ask("SaveScene")
        saved = await bob.ask("GetScene", id=stage.services.session.require_scene().id)
        assert saved["objects"][0]["parameters"] == parameters
        await stage.start(alice)
        assert "online" in await refused(alice, "UpdateObjectModel", **model)
        assert "online" in await refused(alice, "UpdateObjectParameters", **update)
        await refused(bob, "GetScene", id="scn_none")


async def project(stage: Stage, alice: Actor, **objects: str) -> str:
    """Open a project with one action point. Return its id."""
    await stage.place(alice, **objects)
    await alice.ask("SaveScene")
    await alice.ask("NewProject", scene_id=stage.services.session.require_scene().id, name="project")
    await alice.ask("AddActionPoint", name="ap", position={"x": 1, "y": 2, "z": 3})
    alice.take()
    return stage.services.session.require_project().action_points[0].id


async def test_orientations_and_joints_are_taught_by_a_robot(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Arm", "TwoArms") as stage:
        alice, bob = await stage.person("alice"), await stage.person("bob")
        point = await project(stage, alice, arm="Arm", two="TwoArms")
        arm, two = stage.ids["arm"], stage.ids["two"]
        add: dict[str, Any] = {"action_point_id": point, "robot_id": arm, "name": "taught"}
        assert "offline" in await refused(alice, "AddActionPointJointsUsingRobot", **add)
        await stage.start(alice)
        assert "hold" in await refused(alice, "AddActionPointJointsUsingRobot", **add)
        await alice.lock(point)
        assert "several arms" in await refused(alice, "AddActionPointJointsUsingRobot", **add | {"robot_id": two})
        await refused(alice, "AddActionPointJointsUsingRobot", **add | {"name": "a b"})
        bob.take()
        await alice.ask("AddActionPointJointsUsingRobot", dry_run=True, **add)
        assert bob.events() == []
        await alice.ask("AddActionPointJointsUsingRobot", **add)
        ((event, change, parent, joints),) = new_events(bob)
        assert (event, change, parent) == ("JointsChanged", "add", point)
        assert (joints["name"], joints["robot_id"], joints["is_valid"]) == ("taught", arm, True)
        assert [joint["value"] for joint in joints["joints"]][:3] == [0.4, 0.1, 0.3]
        await refused(alice, "AddActionPointJointsUsingRobot", **add)  # the name is taken
        left: dict[str, Any] = add | {"robot_id": two, "name": "left", "arm_id": "left"}
        await alice.ask("AddActionPointJointsUsingRobot", **left)
        ((_, _, _, of_left),) = new_events(bob)
        assert (of_left["arm_id"], of_left["joints"]) == ("left", [{"name": "left_1", "value": 0.25}])

        straight = {"x": 0, "y": 0, "z": 0, "w": 1}
        await alice.ask("AddActionPointOrientation", action_point_id=point, name="o", orientation=straight)
        ((_, _, _, orientation),) = new_events(bob)
        robot = {"robot_id": arm, "end_effector": "tip"}
        teach: dict[str, Any] = {"orientation_id": orientation["id"], "robot": robot}
        assert "hold" in await refused(bob, "UpdateActionPointOrientationUsingRobot", **teach)
        await alice.lock(orientation["id"])
        unknown = robot | {"end_effector": "claw"}
        assert "no end effector" in await refused(
            alice, "UpdateActionPointOrientationUsingRobot", **teach | {"robot": unknown}
        )
        bob.take()
        await alice.ask("UpdateActionPointOrientationUsingRobot", **teach)
        ((event, change, parent, data),) = new_events(bob)
        assert (event, change, parent) == ("OrientationChanged", "update", None)
        assert data["orientation"] == {"x": 1, "y": 0, "z": 0, "w": 0}
        await alice.ask("WriteUnlock", object_id=orientation["id"])
        bob.take()

        # Joints and orientations are removed only by the user who has the lock.
        assert "lock" in await refused(bob, "RemoveActionPointJoints", joints_id=joints["id"])
        await alice.ask("RemoveActionPointJoints", joints_id=joints["id"])
        ((event, change, parent, data),) = new_events(bob)
        assert (event, change, parent, data["id"]) == ("JointsChanged", "remove", None, joints["id"])
        await alice.ask("RemoveActionPointOrientation", orientation_id=orientation["id"])
        ((event, change, parent, data),) = new_events(bob)
        assert (event, change, parent, data["id"]) == ("OrientationChanged", "remove", None, orientation["id"])
        (left_over,) = stage.services.session.require_project().action_points
        assert ([j.name for j in left_over.robot_joints], left_over.orientations) == (["left"], [])


async def test_robots_list_their_arms_and_switch_hand_teaching(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Arm", "TwoArms", "DumbArm") as stage:
        alice, bob = await stage.person("alice"), await stage.person("bob")
        await stage.place(alice, arm="Arm", two="TwoArms")
        arm, two = stage.ids["arm"], stage.ids["two"]
        await stage.start(alice)
        assert sorted(await bob.ask("GetRobotArms", robot_id=two)) == ["left", "right"]
        assert "one arm" in await refused(bob, "GetRobotArms", robot_id=arm)
        assert await bob.ask("GetSuctions", robot_id=two, arm_id="right") == ["right_cup"]
        for name in ("GetSuctions", "GetGrippers", "GetRobotJoints", "GetEndEffectors"):
            assert "several arms" in await refused(bob, name, robot_id=two)
            assert "one arm" in await refused(bob, name, robot_id=arm, arm_id="left")

        teach: dict[str, Any] = {"robot_id": arm, "enable": True}
        assert "hold" in await refused(alice, "HandTeachingMode", **teach)
        for item in (arm, two):
            await alice.lock(item)
        assert "off already" in await refused(alice, "HandTeachingMode", **teach | {"enable": False})
        assert "moved by hand" in await refused(alice, "HandTeachingMode", robot_id=two, enable=True, arm_id="left")
        bob.take()
        await alice.ask("HandTeachingMode", dry_run=True, **teach)
        assert bob.events() == []
        await alice.ask("HandTeachingMode", **teach)
        assert new_events(bob) == [("HandTeachingMode", None, None, {"robot_id": arm, "enabled": True})]
        step: dict[str, Any] = {"robot_id": arm, "end_effector_id": "tip", "axis": "x", "what": "position"}
        assert "by hand" in await refused(alice, "StepRobotEef", **step, mode="world", step=0.01)
        await alice.ask("HandTeachingMode", robot_id=arm, enable=False)
        assert new_events(bob) == [("HandTeachingMode", None, None, {"robot_id": arm, "enabled": False})]


async def test_logic_items_are_changed(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Chooser") as stage:
        alice, bob = await stage.person("alice"), await stage.person("bob")
        point = await project(stage, alice, chooser="Chooser", rnd="RandomActions")
        flows = [{"type": "default", "outputs": ["yes"]}]
        probability = [{"name": "probability", "type": "double", "value": "0.5"}]
        actions = {}
        for name, kind, parameters in (
            ("first", f"{stage.ids['rnd']}/random_bool", probability),
            ("second", f"{stage.ids['chooser']}/greet", []),
        ):
            outputs = flows if name == "first" else [{"type": "default", "outputs": []}]
            args: dict[str, Any] = {"name": name, "type": kind, "parameters": parameters, "flows": outputs}
            await alice.ask("AddAction", action_point_id=point, **args)
        for action in stage.services.session.require_project().action_points[0].actions:
            actions[action.name] = action.id
        first, second = actions["first"], actions["second"]
        await alice.ask("AddLogicItem", start="START", end=first)
        await alice.ask("AddLogicItem", start=first, end=second)
        bob.take()
        item = stage.services.session.require_project().logic[1].id
        condition = {"what": f"{first}/default/0", "value": "true"}
        change: dict[str, Any] = {"logic_item_id": item, "start": first, "end": second, "condition": condition}
        assert "lead to itself" in await refused(alice, "UpdateLogicItem", **change | {"end": first})
        await refused(alice, "UpdateLogicItem", **change | {"end": "act_none"})
        await refused(alice, "UpdateLogicItem", **change | {"logic_item_id": "lit_none"})
        bob.take()
        await alice.ask("UpdateLogicItem", dry_run=True, **change)
        assert bob.events() == []
        await alice.ask("UpdateLogicItem", **change)
        ((event, kind, parent, data),) = new_events(bob)
        assert (event, kind, parent) == ("LogicItemChanged", "update", None)
        assert data == {"id": item, "start": first, "end": second, "condition": condition}
        await alice.ask("SaveProject")
        saved = await bob.ask("GetProject", id=stage.services.session.require_project().id)
        assert data in saved["logic"]
        await refused(bob, "GetProject", id="pro_none")
        project_id = saved["id"]
        await alice.ask("CloseProject")
        bob.take()
        await alice.ask("OpenProject", id=project_id)
        (opened, state) = new_events(bob)
        assert (opened[0], opened[3]["project"]["logic"]) == ("OpenProject", saved["logic"])
        assert (state[0], state[3]) == ("SceneState", {"state": "stopped"})
        await refused(alice, "OpenProject", id=project_id)
