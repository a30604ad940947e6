"""Calibrations over REST: complete results, workplace markers, touched points, stored and checked records."""

import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import cv2
import httpx
import msgspec
import numpy as np
import pytest
import pytest_asyncio

from arcor2_hw.calibration.configuration import CalibrationConfiguration
from arcor2_hw.calibration.layout import Marker
from arcor2_hw.calibration.records import CalibrationKind, CalibrationRecord
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.rpc import ListCalibrationsArgs
from arcor2_hw.exceptions import Conflict, StorageError
from arcor2_server.app import Server
from arcor2_server.storage.calibrations import Calibrations
from arcor2_server.storage.damage_notices import DataDamage
from arcor2_server.websocket.hub import Hub
from arcor2_server.workspace.markers import Markers
from benchmarks import rendering
from tests.server.rest.rest_client import granted, refused

pytestmark = pytest.mark.asyncio(loop_scope="module")

LENS = rendering.Lens(600.0, 599.0, 322.0, 237.0, (0.06, -0.1, 0.0005, -0.0004, 0.02), 640, 480)
PARAMETERS = msgspec.to_builtins(CameraParameters(600.0, 599.0, 322.0, 237.0, list(LENS.coefficients)))
CAMERA = rendering.looking_at(np.array([0.25, -0.6, 0.5]), np.zeros(3), 0.2)
QUERY: dict[str, Any] = {
    "fx": 600.0, "fy": 599.0, "cx": 322.0, "cy": 237.0, "distCoefs": list(LENS.coefficients)
}  # fmt: skip


def flat(x: float, y: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    pose = np.eye(4)
    pose[:2, 3] = x, y
    return pose


PLACES = {3: flat(-0.12, -0.02), 17: flat(0.12, -0.05)}
MARKERS = {"markers": [{"marker_id": n, "pose": msgspec.to_builtins(Pose.from_matrix(p))} for n, p in PLACES.items()]}


@pytest.fixture(scope="module")
def pictures() -> list[bytes]:
    """Two pictures of the same view."""
    plates = [rendering.table(np.random.default_rng(1), side=3.0)]
    plates += [rendering.marker(number, 0.1, place) for number, place in PLACES.items()]
    made = [rendering.render(LENS, CAMERA, plates, np.random.default_rng(seed)) for seed in (2, 3)]
    return [bytes(cv2.imencode(".png", grey)[1].tobytes()) for grey in made]


@pytest_asyncio.fixture(loop_scope="module", autouse=True)
async def no_markers(services: Server) -> AsyncIterator[None]:
    yield
    await services.markers.set(CalibrationConfiguration())


def parts(pictures: list[bytes], args: Any = None) -> list[tuple[str, Any]]:
    made: list[tuple[str, Any]] = [("image", (f"{n}.png", one, "image/png")) for n, one in enumerate(pictures)]
    return made if args is None else [*made, ("args", (None, json.dumps(args)))]


# ------------------------------------------------------------------------------------------------ pictures
async def test_the_original_route_returns_the_pose_and_its_inverse(
    http: httpx.AsyncClient, pictures: list[bytes]
) -> None:
    answer = await http.put("/calibrate/camera", params=QUERY, files=parts(pictures[:1]))
    refused(answer, 404, "NotFound", "No markers are configured")
    granted(await http.put("/api/calibration/markers", json=MARKERS))
    found = granted(await http.put("/calibrate/camera", params=QUERY, files=parts(pictures[:1])))
    assert set(found) == {"pose", "quality"}
    pose = msgspec.convert(found["pose"], Pose)
    assert pose.position.distance_to(Pose.from_matrix(CAMERA).position) < 0.003
    assert 0.0 < found["quality"] <= 1.0
    inverse = granted(await http.put("/calibrate/camera", params=QUERY | {"inverse": True}, files=parts(pictures[:1])))
    identity = pose * msgspec.convert(inverse["pose"], Pose)
    assert identity.position.distance_to(Position()) < 1e-9
    seen = granted(await http.put("/markers/corners", params=QUERY, files=parts(pictures[:1])))
    assert sorted(marker["marker_id"] for marker in seen) == [3, 17]
    assert all(len(marker["corners"]) == 4 for marker in seen)


async def test_complete_results_include_their_quality(http: httpx.AsyncClient, pictures: list[bytes]) -> None:
    record = {"object_id": "obj_cam", "object_name": "cam", "before": {}}
    args = {"camera_parameters": PARAMETERS, "markers": MARKERS, "record": record}
    found = granted(await http.put("/api/calibration/camera", files=parts(pictures, args)))
    assert found["pictures"] == 2
    assert [each["name"] for each in found["markers"]].count("marker 3") == 2
    assert len(found["covariance"]) == 6
    drawn = {"camera_parameters": PARAMETERS, "markers": MARKERS, "result": found}
    answer = await http.put("/api/calibration/camera/picture", files=parts(pictures[:1], drawn))
    assert answer.headers["content-type"] == "image/png"
    assert cv2.imdecode(np.frombuffer(answer.content, np.uint8), cv2.IMREAD_COLOR).shape[1] > 640
    (stored_record,) = granted(await http.get("/api/calibrations", params={"object_id": "obj_cam"}))
    assert (stored_record["kind"], stored_record["verdict"], stored_record["residual_unit"]) == (
        "camera_pose",
        found["verdict"],
        "px",
    )
    assert stored_record["after"] == found["pose"]
    assert len(stored_record["inputs"]) == 2
    assert stored_record["applied"] is False

    lens = {"camera_parameters": PARAMETERS, "markers": MARKERS}
    checked = granted(await http.put("/api/calibration/lens", files=parts(pictures, lens)))
    assert checked == found["lens"]
    assert checked["parameters"]["fx"] == pytest.approx(PARAMETERS["fx"] * checked["factor"])
    refused(await http.put("/api/calibration/lens", files=parts([], args)), 400, "Argument", "image")

    options = {"lowest": 5.0}
    answer = await http.put("/api/calibration/camera", files=parts(pictures, args | {"options": options}))
    refused(answer, 409, "Invalid")
    args["markers"] = {"markers": [{"marker_id": 3, "pose": {}}, {"marker_id": 3, "pose": {}}]}
    refused(
        await http.put("/api/calibration/camera", files=parts(pictures, args)), 400, "Argument", "marker 3", "twice"
    )
    refused(await http.put("/api/calibration/camera", files=parts(pictures)), 400, "Argument", "args")
    refused(await http.put("/api/calibration/camera", files=parts([], args)), 400, "Argument", "image")


async def test_the_number_of_pictures_and_poses_must_match(http: httpx.AsyncClient, pictures: list[bytes]) -> None:
    args = {"flanges": [{}], "camera_parameters": PARAMETERS, "target": MARKERS, "mounting": "eye_in_hand"}
    refused(await http.put("/api/calibration/hand-eye", files=parts(pictures, args)), 400, "Argument", "1 poses")
    args["flanges"] = [{}, {}]
    refused(await http.put("/api/calibration/hand-eye", files=parts(pictures, args)), 400, "Argument")
    args["mounting"] = "somewhere"
    refused(await http.put("/api/calibration/hand-eye", files=parts(pictures, args)), 400, "Argument", "mounting")
    board = {"columns": 7, "rows": 5, "square": 0.03, "marker": 0.0225}
    refused(await http.put("/api/calibration/intrinsics", files=parts(pictures, {"board": board})), 404, "NotFound")
    robot = {
        "robot_joints": [{"name": "j", "value": 0}],
        "robot_pose": {},
        "camera_pose": {},
        "camera_parameters": PARAMETERS,
        "urdf_uri": "ur5e.zip",
    }
    # A colour picture is not a depth picture.
    refused(await http.put("/api/calibration/robot", files=parts(pictures[:1], robot)), 400, "Argument")
    few = bytes(cv2.imencode(".png", np.zeros((480, 640), np.uint16))[1].tobytes())
    text = refused(await http.put("/api/calibration/robot", files=parts([few], robot)), 400, "Argument")
    assert "missing" in text, "the joints of the model have other names"
    refused(
        await http.put("/api/calibration/robot", files=parts([few], robot | {"urdf_uri": "no.zip"})), 404, "NotFound"
    )


# ------------------------------------------------------------------------------------------------ touch
async def test_touched_points_are_stored_with_their_result(http: httpx.AsyncClient) -> None:
    turned = Orientation.from_rotation_vector(0.1, 0.2, 0.3)
    known = [Position(0, 0, 0), Position(0.3, 0, 0), Position(0, 0.2, 0), Position(0.1, 0.1, 0.1)]
    touched = [point.rotated(turned) + Position(0.5, 0.1, 0.0) for point in known]
    body = msgspec.to_builtins({"known": known, "touched": touched, "record": {"object_id": "obj_arm"}})
    found = granted(await http.put("/api/calibration/touch/frame-by-points", json=body))
    assert msgspec.convert(found["pose"], Pose).position.distance_to(Position(0.5, 0.1, 0.0)) < 1e-9
    assert found["checked"] is True
    (stored_record,) = granted(await http.get("/api/calibrations", params={"object_id": "obj_arm"}))
    assert (stored_record["kind"], stored_record["object_name"]) == ("base_frame", "obj_arm")
    assert len(stored_record["parameters"]["args"]["touched"]) == 4
    line = msgspec.to_builtins({"known": known[:1] * 3, "touched": known[:1] * 3})
    refused(await http.put("/api/calibration/touch/frame-by-points", json=line), 409, "Invalid")
    axes = msgspec.to_builtins({"origin": Position(), "on_x": Position(1), "in_plane": [Position(0, 1)]})
    found = granted(await http.put("/api/calibration/touch/frame-by-axes", json=axes))
    assert found["checked"] is False
    refused(await http.put("/api/calibration/touch/tip", json={"flanges": [{}] * 4}), 409, "Invalid", "too similar")
    refused(await http.put("/api/calibration/touch/tip", json={"flanges": [{}]}), 400, "Argument")
    found = granted(await http.put("/api/calibration/touch/orientation-by-alignment", json={"flanges": [{}, {}]}))
    assert msgspec.convert(found["orientation"], Orientation).angle_to(Orientation()) < 1e-9
    points = {"flange": {}, "tip": {}, "along_z": {"z": 0.1}, "on_x": {"x": 0.1}}
    found = granted(await http.put("/api/calibration/touch/orientation-by-points", json=points))
    assert msgspec.convert(found["orientation"], Orientation).angle_to(Orientation()) < 1e-9


# ------------------------------------------------------------------------------------------------ records
async def test_records_are_listed_and_checked(http: httpx.AsyncClient) -> None:
    ids = []
    for number in range(3):
        body = {"object_id": "obj_x", "object_name": "x", "pose": {"position": {"x": number / 10}}, "remark": "moved"}
        ids.append(granted(await http.post("/api/calibrations", json=body))["id"])
    query: dict[str, Any] = {"object_id": "obj_x"}
    listed = granted(await http.get("/api/calibrations", params=query))
    assert [one["id"] for one in listed] == ids[::-1]
    assert {one["verdict"] for one in listed} == {"moved"}
    older = granted(await http.get("/api/calibrations", params=query | {"before": listed[0]["date"], "limit": 1}))
    assert [one["id"] for one in older] == [ids[1]]
    assert granted(await http.get("/api/calibrations", params=query | {"kind": "robot_pose"})) == []
    refused(await http.get("/api/calibrations", params={"kind": "guess"}), 400, "Argument", "kind")
    refused(await http.get("/api/calibrations", params={"limit": 1001}), 400, "Argument", "limit")
    assert granted(await http.get(f"/api/calibrations/{ids[0]}"))["kind"] == "by_hand"
    refused(await http.get("/api/calibrations/none"), 404, "NotFound", "none")

    check = f"/api/calibrations/{ids[1]}/check"
    still = granted(await http.put(check, json={"pose": {"position": {"x": 0.101}}}))
    assert (still["passed"], still["record_id"]) == (True, ids[1])
    assert still["distance"] == pytest.approx(0.001)
    moved = granted(await http.put(check, json={"pose": {"position": {"x": 0.11}}}))
    assert moved["passed"] is False
    assert "10.0 mm" in moved["verdict"]
    assert granted(await http.put(check, json={"pose": {"position": {"x": 0.11}}, "distance_limit": 0.02}))["passed"]
    refused(await http.put(check, json={"pose": {}, "distance_limit": 0}), 400, "Argument", "distanceLimit")
    refused(await http.put("/api/calibrations/none/check", json={"pose": {}}), 404, "NotFound")


async def test_the_oldest_records_are_removed_except_the_last_of_each_object(services: Server) -> None:
    records = Calibrations(services.storage, limit=5)

    def record(name: str, number: int) -> CalibrationRecord:
        date = f"2026-01-01T00:00:{number:02d}.000000+00:00"
        return CalibrationRecord(CalibrationKind.BY_HAND, "", name, name, "world", "", date=date)

    await records.put(record("first", 0))
    for number in range(1, 12):
        await records.put(record("often", number))
    assert [one.date[17:19] for one in await records.find(ListCalibrationsArgs(object_id="first"))] == ["00"]
    often = [one.date[17:19] for one in await records.find(ListCalibrationsArgs(object_id="often"))]
    assert often[0] == "11"
    assert len(often) < 6


# ------------------------------------------------------------------------------------------------ markers
async def test_markers_are_stored(http: httpx.AsyncClient, services: Server, tmp_path: Path) -> None:
    assert granted(await http.get("/api/calibration/markers"))["markers"] == []
    granted(await http.put("/api/calibration/markers", json=MARKERS | {"marker_size": 0.08}))
    again = Markers(services.settings.markers_file)
    again.load(damage(tmp_path))
    assert again.configuration == services.markers.configuration
    assert again.configuration.marker_size == 0.08
    twice = {"markers": [{"marker_id": 3, "pose": {}}] * 2}
    refused(await http.put("/api/calibration/markers", json=twice), 400, "Argument", "marker 3 is listed twice")
    small = {"marker_size": 0, "markers": []}
    refused(await http.put("/api/calibration/markers", json=small), 400, "Argument", "marker_size")
    assert services.markers.configuration.marker_size == 0.08


def damage(directory: Path) -> DataDamage:
    return DataDamage(directory, Hub())


async def test_damaged_marker_files_are_renamed(tmp_path: Path) -> None:
    path = tmp_path / "markers.json"
    path.write_bytes(b"{")
    notices = damage(tmp_path)
    markers = Markers(path)
    markers.load(notices)
    assert markers.configuration == CalibrationConfiguration()
    (stored,) = tmp_path.glob("markers.damaged-*.json")
    assert stored.read_bytes() == b"{"
    assert not path.exists()
    (notice,) = notices.notices
    assert str(path) in notice.text
    assert str(stored) in notice.text
    # A later run still shows the notice, until a client has received it.
    later = damage(tmp_path)
    later.load()
    assert [event.data.as_message(event.data.message) for event in later.greeting()] == [notice]
    afterwards = damage(tmp_path)
    afterwards.load()
    assert afterwards.greeting() == []


async def test_markers_of_a_file_take_precedence(tmp_path: Path) -> None:
    given = CalibrationConfiguration(markers=[Marker(1, Pose())])
    markers = Markers(tmp_path / "markers.json", given)
    markers.load(damage(tmp_path))
    with pytest.raises(Conflict, match="marker file"):
        await markers.set(CalibrationConfiguration())
    assert markers.configuration == given
    unwritable = Markers(tmp_path / "none" / "markers.json")
    with pytest.raises(StorageError, match=r"markers\.json"):
        await unwritable.set(given)
    assert unwritable.configuration.markers == []
