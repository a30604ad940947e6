"""Requests to cameras, and the calibration of camera and robot poses."""

import asyncio
import hashlib
import io
from pathlib import Path
from typing import Any

import msgspec
import pytest
from PIL import Image

from arcor2_hw.calibration.camera_results import CameraPose
from arcor2_hw.calibration.configuration import CalibrationConfiguration
from arcor2_hw.calibration.layout import Marker
from arcor2_hw.calibration.records import CalibrationKind, CalibrationRecord
from arcor2_hw.calibration.results import Grade, RobotPose
from arcor2_hw.collision.description import RobotSource
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.camera import CameraParameters, Corner, MarkerCorners
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.rpc import ListCalibrationsArgs
from arcor2_hw.exceptions import Arcor2Error, NotFound
from arcor2_server.compute.process import ProgressCallback
from arcor2_server.errors import RequestRefused
from arcor2_server.rest.cameras import CameraOperations
from arcor2_server.workspace.calibration import RobotView
from tests.server.protocol.in_process_server import Actor, Stage, open_stage, refused, until_event

PARAMETERS = {"fx": 600, "fy": 610, "cx": 320, "cy": 240, "dist_coefs": [0, 0, 0, 0]}
FOUND = Pose(Position(1, 2, 3), Orientation(0, 0, 1, 0))


class Service:
    """A calibration service with preset answers, which records its requests."""

    def __init__(self) -> None:
        self.requests: list[Any] = []
        self.refusal: Arcor2Error | None = None
        self.may_answer = asyncio.Event()
        self.may_answer.set()

    async def _take(self, *requests: Any) -> None:
        self.requests.append(requests)
        await self.may_answer.wait()
        if self.refusal is not None:
            raise self.refusal

    async def camera(
        self,
        parameters: CameraParameters,
        pictures: list[bytes],
        *,
        expected: Pose | None = None,
        on_progress: ProgressCallback | None = None,
    ) -> CameraPose:
        await self._take(parameters, pictures, expected)
        return CameraPose(
            pose=FOUND,
            quality=0.75,
            residual=0.2,
            markers=[],
            covariance=[[0.0] * 6] * 6,
            position_deviation=0.001,
            orientation_deviation=0.002,
            blur=0.5,
            method="joint",
            pictures=len(pictures),
            grade=Grade.GOOD,
            verdict="It is well known.",
        )

    async def markers(self, parameters: CameraParameters, picture: bytes) -> list[MarkerCorners]:
        await self._take(parameters, [picture])
        return [MarkerCorners(10, [Corner(1, 2), Corner(3, 2), Corner(3, 4), Corner(1, 4)])]

    async def robot(
        self, model: RobotSource, view: RobotView, depth: list[bytes], *, on_progress: ProgressCallback | None = None
    ) -> RobotPose:
        if on_progress is not None:
            on_progress(0.5, "looking for the robot")
        await self._take(view, depth, model)
        return RobotPose(
            pose=FOUND,
            grade=Grade.GOOD,
            verdict="It is well known.",
            fitness=0.9,
            occluded=0.0,
            uneven=0.001,
            residual=0.001,
            points=1000,
            covariance=[[0.0] * 6] * 6,
            position_deviation=0.001,
            orientation_deviation=0.01,
            moved=0.02,
            turned=0.01,
            starts=8,
            agreed=8,
            seconds=0.5,
        )


def replaced_calibration(stage: Stage) -> Service:
    """Replace the stage's calibration service."""
    service = Service()
    for method in ("camera", "markers", "robot"):
        setattr(stage.services.calibration, method, getattr(service, method))
    return service


async def ready(stage: Stage, **objects: str) -> tuple[Actor, Service]:
    alice = await stage.person("alice")
    await stage.place(alice, **objects)
    await stage.start(alice)
    service = replaced_calibration(stage)
    return alice, service


def process_states(actor: Actor, name: str) -> list[tuple[str, bool]]:
    """Return the published states of a process, and whether each had a message."""
    states = [message["data"] for message in actor.waiting if message.get("event") == "ProcessState"]
    assert {data["id"] for data in states} <= {name}
    return [(data["state"], "message" in data) for data in states]


async def test_a_camera_returns_its_picture_and_parameters(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Eye", "BlindEye", "Part") as stage:
        alice, bob = await stage.person("alice"), await stage.person("bob")
        stranger = await stage.person()
        for name in ("CameraColorImage", "CameraColorParameters"):
            assert "No scene is open" in await refused(stranger, name, id="x")
        await stage.place(alice, eye="Eye", blind="BlindEye", part="Part")
        eye, blind, part = (stage.ids[name] for name in ("eye", "blind", "part"))
        await alice.lock(eye)
        for name in ("CameraColorImage", "CameraColorParameters"):
            assert "not logged in" in await refused(stranger, name, id=eye)
            assert "lock" in await refused(bob, name, id=eye)
            assert "offline" in await refused(alice, name, id=eye)
        await alice.ask("WriteUnlock", object_id=eye)
        await stage.start(alice)
        for item in (eye, blind, part):
            await alice.lock(item)

        picture = Image.open(io.BytesIO((await alice.ask("CameraColorImage", id=eye)).encode("latin-1")))
        assert (picture.format, picture.size) == ("JPEG", (64, 48))
        red = picture.getpixel((30, 20))
        assert isinstance(red, tuple)
        assert red[0] > 240 > 20 > max(red[1:])
        assert await alice.ask("CameraColorParameters", id=eye) == PARAMETERS
        # A viewer needs neither a user name nor the lock.
        s = stage.services
        cameras = CameraOperations(s.session, s.online, s.cameras)
        assert Image.open(io.BytesIO((await cameras.take_picture(eye)).content)).size == (64, 48)  # type: ignore[arg-type]
        with pytest.raises(RequestRefused, match="part is not a camera"):
            await cameras.take_picture(part)
        with pytest.raises(NotFound):
            await cameras.take_picture("obj_nobody")

        for name in ("CameraColorImage", "CameraColorParameters"):
            assert "part is not a camera" in await refused(alice, name, id=part)
            assert "lock" in await refused(bob, name, id=eye)
        assert "has no camera parameters" in await refused(alice, "CameraColorParameters", id=blind)
        for item in (eye, blind, part):
            await alice.ask("WriteUnlock", object_id=item)
        await alice.ask("StopScene")
        await until_event(alice, "SceneState", state="stopped")
        with pytest.raises(RequestRefused, match="offline"):
            await cameras.take_picture(eye)


@pytest.mark.parametrize("request_name", ["GetCameraPose", "MarkersCorners"])
async def test_pictures_of_a_client_are_evaluated_by_the_service(tmp_path: Path, request_name: str) -> None:
    async with open_stage(tmp_path) as stage:
        stranger = await stage.person()
        args: dict[str, Any] = {"camera_parameters": PARAMETERS, "image": "\xff\xd8\x00picture"}
        # Data that is not a picture is refused. Without configured markers the picture is not even decoded.
        words = "No markers are configured" if request_name == "GetCameraPose" else "picture"
        assert words in await refused(stranger, request_name, **args)
        service = replaced_calibration(stage)
        if request_name == "GetCameraPose":
            answer = await stranger.ask(request_name, **args, inverse=True)
            assert answer["quality"] == 0.75
            inverse = FOUND.inverted()
            assert answer["pose"]["position"] == msgspec.to_builtins(inverse.position)
            assert answer["pose"]["orientation"] == msgspec.to_builtins(inverse.orientation)
            answer = await stranger.ask(request_name, **args)
            assert answer["pose"]["position"] == {"x": 1, "y": 2, "z": 3}
            assert service.requests.pop()[2] is None, "the pose of the camera is unknown"
        else:
            (seen,) = await stranger.ask(request_name, **args)
            assert seen["marker_id"] == 10
            assert seen["corners"][2] == {"x": 3, "y": 4}
        parameters, (image,) = service.requests[0][:2]
        assert parameters.fy == 610
        assert image == b"\xff\xd8\x00picture"
        # The original never answered a request whose picture is invalid.
        assert "not a picture" in await refused(stranger, request_name, **args | {"image": "€"})
        assert "empty" in await refused(stranger, request_name, **args | {"image": ""})
        assert len(service.requests) == 1
        service.refusal = NotFound("No marker is seen.")
        assert await refused(stranger, request_name, **args) == "No marker is seen."


async def test_a_camera_pose_is_set_from_its_picture(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Eye", "BlindEye", "Part") as stage:
        alice, service = await ready(stage, eye="Eye", blind="BlindEye", part="Part")
        bob, stranger = await stage.person("bob"), await stage.person()
        eye = stage.ids["eye"]
        assert "has no camera parameters" in await refused(alice, "CalibrateCamera", id=stage.ids["blind"])
        assert "not a camera" in await refused(alice, "CalibrateCamera", id=stage.ids["part"])
        assert "not logged in" in await refused(stranger, "CalibrateCamera", id=eye)
        assert "lock" in await refused(alice, "CalibrateCamera", id=eye)
        await alice.lock(eye)
        bob.take()

        service.may_answer.clear()
        await alice.ask("CalibrateCamera", id=eye)
        assert [message.get("event") or message["response"] for message in alice.take()] == [
            "CalibrateCamera",
            "ProcessState",
        ]
        assert "calibrated already" in await refused(alice, "CalibrateCamera", id=eye)
        service.may_answer.set()
        await until_event(bob, "ProcessState", state="finished")
        assert process_states(bob, "CameraCalibration") == [("started", False), ("finished", True)]
        assert bob.waiting[-1]["data"]["message"] == "It is well known."
        assert bob.names() == ["ProcessState", "SceneObjectChanged/update", "ProcessState"]
        parameters, images, expected = service.requests[0]
        assert parameters.cx == 320
        assert len(images) == 3
        assert all(image.startswith(b"\xff\xd8") for image in images)
        assert expected == Pose(), "the pose in the scene"
        placed = stage.services.session.document.scene_object(eye)
        assert placed.pose == FOUND
        raw = await stage.services.online.ask(Pose, eye, "pose")
        assert raw == FOUND, "the online camera was not moved"
        (record,) = await stage.services.calibration_records.find(ListCalibrationsArgs(object_id=eye))
        assert (record.kind, record.person, record.object_name) == (CalibrationKind.CAMERA_POSE, "alice", "eye")
        assert (record.before, record.after, record.residual, record.residual_unit) == (Pose(), FOUND, 0.2, "px")
        assert [each.sha256 for each in record.inputs] == [hashlib.sha256(image).hexdigest() for image in images]
        assert record.parameters["camera_parameters"] == PARAMETERS

        service.refusal = NotFound("No marker is seen.")
        await alice.ask("CalibrateCamera", id=eye)
        failed = await until_event(bob, "ProcessState", state="failed")
        assert failed["message"] == "No marker is seen."
        assert bob.names() == ["ProcessState", "ProcessState"]
        await alice.ask("WriteUnlock", object_id=eye)
        await stage.stop(alice)
        assert "offline" in await refused(alice, "CalibrateCamera", id=eye)
        await alice.ask("CloseScene", force=True)
        assert "No scene is open" in await refused(alice, "CalibrateCamera", id=eye)


async def test_a_camera_without_visible_markers_keeps_its_pose(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Eye") as stage:
        alice = await stage.person("alice")
        await stage.place(alice, eye="Eye")
        await stage.start(alice)
        await alice.lock(stage.ids["eye"])
        await alice.ask("CalibrateCamera", id=stage.ids["eye"])
        failed = await until_event(alice, "ProcessState", state="failed")
        assert failed["id"] == "CameraCalibration"
        assert "No markers are configured" in failed["message"]
        marker = Marker(7, Pose(Position(0.2, 0, 0)))
        await stage.services.markers.set(CalibrationConfiguration(markers=[marker]))
        alice.take()
        await alice.ask("CalibrateCamera", id=stage.ids["eye"])
        failed = await until_event(alice, "ProcessState", state="failed")
        assert alice.names() == ["ProcessState", "ProcessState"], "the camera was moved"
        assert stage.services.session.document.scene_object(stage.ids["eye"]).pose == Pose()
        assert await stage.services.calibration_records.find(ListCalibrationsArgs()) == []


async def test_a_robot_pose_is_set_from_a_camera(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Arm", "DumbArm", "Eye", "Part") as stage:
        alice, service = await ready(stage, part="Part", arm="Arm", dumb="DumbArm", eye="Eye")
        bob, carol = await stage.person("bob"), await stage.person("carol")
        arm, eye, part, dumb = (stage.ids[name] for name in ("arm", "eye", "part", "dumb"))
        assert "not a robot" in await refused(alice, "CalibrateRobot", robot_id=part)
        assert "not a camera" in await refused(alice, "CalibrateRobot", robot_id=arm, camera_id=part)
        assert "lock" in await refused(alice, "CalibrateRobot", robot_id=arm)
        await alice.lock(arm)
        await alice.lock(dumb)
        assert "no model" in await refused(alice, "CalibrateRobot", robot_id=dumb)
        await bob.lock(eye)
        assert "lock" in await refused(alice, "CalibrateRobot", robot_id=arm)
        await bob.ask("WriteUnlock", object_id=eye)
        alice.take()
        carol.take()

        service.may_answer.clear()
        await alice.ask("CalibrateRobot", robot_id=arm)  # the first camera of the scene
        while not service.requests:
            await asyncio.sleep(0.005)
        assert "lock" in await refused(bob, "WriteLock", object_id=eye), "the camera stays locked until the end"
        assert "is moving" in await refused(alice, "CalibrateRobot", robot_id=arm)
        assert "is moving" in await refused(
            alice,
            "StepRobotEef",
            robot_id=arm,
            end_effector_id="tip",
            axis="x",
            what="position",
            mode="world",
            step=0.1,
        )
        service.may_answer.set()
        await until_event(carol, "ProcessState", state="finished")
        assert process_states(carol, "RobotCalibration") == [("started", False), ("finished", True)]
        tasks = [message["data"] for message in carol.waiting if message.get("event") == "TaskState"]
        assert tasks == [], "nobody subscribed to these"
        assert carol.names() == ["ProcessState", "SceneObjectChanged/update", "ProcessState"]
        view, (depth,), model = service.requests[0]
        assert [joint.value for joint in view.robot_joints[:3]] == [0, 0, 1], "it moved to its calibration pose"
        assert (model.urdf.name, Path(model.urdf.path).read_bytes()) == ("arm.zip", b"content")
        assert view.robot_pose == Pose()
        picture = Image.open(io.BytesIO(depth))
        assert (picture.format, picture.mode, picture.getpixel((3, 3))) == ("PNG", "I;16", 1500)
        assert stage.services.session.document.scene_object(arm).pose == FOUND
        (record,) = await stage.services.calibration_records.find(ListCalibrationsArgs(object_id=arm))
        assert (record.kind, record.person, record.after) == (CalibrationKind.ROBOT_POSE, "alice", FOUND)
        assert record.parameters["camera_id"] == eye
        await bob.lock(eye)
        await bob.ask("WriteUnlock", object_id=eye)

        service.refusal = NotFound("The robot is not seen.")
        await alice.ask("CalibrateRobot", robot_id=arm, camera_id=eye, move_to_calibration_pose=False)
        failed = await until_event(alice, "ProcessState", state="failed")
        assert failed == {"id": "RobotCalibration", "state": "failed", "message": "The robot is not seen."}
        await bob.lock(eye)


async def test_calibration_records_are_listed_and_compared(tmp_path: Path) -> None:
    async with open_stage(tmp_path, "Eye", "Part") as stage:
        alice, stranger = await stage.person("alice"), await stage.person()
        await stage.place(alice, eye="Eye", part="Part")
        eye, part = stage.ids["eye"], stage.ids["part"]
        records = stage.services.calibration_records

        def record(
            date: str, pose: Pose | Unset, parent: str = "world", kind: str = "camera_pose"
        ) -> CalibrationRecord:
            return CalibrationRecord(
                CalibrationKind(kind),
                "alice",
                eye,
                "eye",
                parent,
                "It is so.",
                after=pose,
                date=f"2026-01-{date}T00:00:00Z",
            )

        far, near = record("01", FOUND), record("02", Pose(Position(0.001)))
        lens, hand_eye = record("03", UNSET, kind="intrinsics"), record("04", Pose(), "the flange of arm", "hand_eye")
        for one in (far, near, lens, hand_eye):
            await records.put(one)
        listed = (await stranger.ask("ListCalibrations"))["records"]
        assert [one["id"] for one in listed] == [hand_eye.id, lens.id, near.id, far.id]
        assert listed[-1]["after"] == msgspec.to_builtins(FOUND)
        for args, expected in (
            ({"limit": 1}, [hand_eye]),
            ({"kind": "camera_pose"}, [near, far]),
            ({"before": "2026-01-02T00:00:00Z"}, [far]),
            ({"object_id": part}, []),
        ):
            found = (await stranger.ask("ListCalibrations", **args))["records"]  # type: ignore[arg-type]
            assert [one["id"] for one in found] == [one.id for one in expected]

        # The check uses the pose in the open scene, unless the client sends a measured one.
        check = await stranger.ask("CheckCalibration", id=near.id)
        assert (check["passed"], check["record_id"]) == (True, near.id)
        assert check["distance"] == pytest.approx(0.001)
        check = await stranger.ask("CheckCalibration", id=near.id, distance_limit=0.0005)
        assert (check["passed"], "1.0 mm" in check["verdict"]) == (False, True)
        check = await stranger.ask("CheckCalibration", id=far.id, pose=msgspec.to_builtins(FOUND))
        assert (check["passed"], check["distance"]) == (True, 0.0)
        assert (await stranger.ask("CheckCalibration", id=far.id))["passed"] is False
        assert (await stranger.ask("CheckCalibration", id=hand_eye.id, pose={}))["passed"] is True
        for args, words in (
            ({"id": hand_eye.id}, "frame of the flange of arm"),
            ({"id": lens.id, "pose": {}}, "has no pose that could be checked"),
            ({"id": "cal_none"}, "cal_none"),
            ({"id": near.id, "angle_limit": 0}, "angle_limit"),
        ):
            assert words in await refused(stranger, "CheckCalibration", **args)
        await alice.ask("CloseScene", force=True)
        assert "No scene is open" in await refused(stranger, "CheckCalibration", id=near.id)
