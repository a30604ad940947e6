"""`arcor2-hw calibrate`: from files, and on a running server."""

import math
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cv2
import httpx
import msgspec
import numpy as np
import pytest

from arcor2_hw.calibration.camera_results import CameraPose, LensCheck
from arcor2_hw.data.camera import CameraParameters
from arcor2_hw.data.cell import read_cell
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.exceptions import InvalidData
from arcor2_server.cli.calibration_files import angles
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.serve import _markers
from benchmarks import rendering
from tests.server.cli.in_process import Ran, run_app, serving

LENS = rendering.Lens(600.0, 599.0, 322.0, 237.0, (0.06, -0.1, 0.0005, -0.0004, 0.02), 640, 480)
PARAMETERS = CameraParameters(600.0, 599.0, 322.0, 237.0, list(LENS.coefficients))
CAMERA = rendering.looking_at(np.array([0.25, -0.6, 0.5]), np.zeros(3), 0.2)


Cli = Callable[..., Ran]


def flat(x: float, y: float) -> np.ndarray[Any, np.dtype[np.float64]]:
    pose = np.eye(4)
    pose[:2, 3] = x, y
    return pose


PLACES = {3: flat(-0.12, -0.02), 17: flat(0.12, -0.05)}


@pytest.fixture
def calibrate(capsys: pytest.CaptureFixture[str]) -> Cli:
    return lambda *arguments: run_app(capsys, "calibrate", *arguments)


@pytest.fixture(scope="module")
def files(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a picture of two markers, an empty picture, the lens, and the marker poses."""
    folder = tmp_path_factory.mktemp("calibrate")
    background = rendering.table(np.random.default_rng(1), side=3.0)
    plates = [rendering.marker(number, 0.1, place) for number, place in PLACES.items()]
    for name, shown in (("markers", [background, *plates]), ("empty", [background])):
        cv2.imwrite(str(folder / f"{name}.png"), rendering.render(LENS, CAMERA, shown, np.random.default_rng(2)))
    write(folder / "lens.yaml", PARAMETERS)
    poses = {number: {"pose": msgspec.to_builtins(Pose.from_matrix(place))} for number, place in PLACES.items()}
    write(folder / "markers.yaml", {"marker_size": 0.1, "markers": poses})
    return folder


def write(path: Path, content: Any) -> Path:
    path.write_bytes(msgspec.yaml.encode(content))
    return path


def test_a_camera_pose_is_calibrated(files: Path, tmp_path: Path, calibrate: Cli) -> None:
    inputs = ("--lens", files / "lens.yaml", "--markers", files / "markers.yaml")
    ran = calibrate("camera", files / "markers.png", *inputs, "--save", tmp_path / "out", "-o", tmp_path / "pose.json")
    assert ran.status == ExitStatus.OK, ran
    assert "marker 17" in ran.out
    assert "standard deviation" in ran.out
    found = msgspec.json.decode((tmp_path / "pose.json").read_bytes(), type=Pose)
    truth = Pose.from_matrix(CAMERA)
    assert found.position.distance_to(truth.position) < 0.003
    assert cv2.imread(str(tmp_path / "out" / "markers-markers.png")).shape[1] > 640
    ran = calibrate("camera", files / "markers.png", *inputs, "--json", "--method", "averaged")
    whole = msgspec.json.decode(ran.out, type=CameraPose)
    assert whole.method == "averaged"
    assert len(whole.markers) == 2


def test_a_lens_is_checked(files: Path, tmp_path: Path, calibrate: Cli) -> None:
    markers = ("--markers", files / "markers.yaml")
    ran = calibrate("check-lens", files / "markers.png", "--lens", files / "lens.yaml", *markers, "--above", "0.1")
    assert ran.status == ExitStatus.OK, ran
    assert "of the given focal length" in ran.out
    long = write(tmp_path / "long.yaml", msgspec.structs.replace(PARAMETERS, fx=660.0, fy=658.9))
    inputs = ("--lens", long, *markers, "-o", tmp_path / "fitting.json")
    ran = calibrate("check-lens", files / "markers.png", *inputs)
    assert ran.status == ExitStatus.CALIBRATION_REFUSED, ran
    assert "smaller" in ran.out
    fitting = msgspec.json.decode((tmp_path / "fitting.json").read_bytes(), type=CameraParameters)
    assert fitting.fx == pytest.approx(600.0, rel=0.02)
    ran = calibrate("check-lens", files / "markers.png", *inputs, "--json")
    assert msgspec.json.decode(ran.out, type=LensCheck).state == "contradicted"
    ran = calibrate("check-lens", files / "empty.png", *inputs)
    assert (ran.status, ran.out) == (ExitStatus.CALIBRATION_REFUSED, "")


def test_errors_have_an_exit_status_and_one_line(files: Path, tmp_path: Path, calibrate: Cli) -> None:
    inputs = ("--lens", files / "lens.yaml", "--markers", files / "markers.yaml")
    twice = tmp_path / "twice.yaml"
    twice.write_text("markers:\n  3: {pose: {}}\n  3: {pose: {}}\n")
    lens = write(tmp_path / "lens.yaml", {"fx": 1})
    others = write(tmp_path / "others.yaml", {"markers": [{"marker_id": 44, "pose": Pose()}]})
    cases: list[tuple[list[str | Path], ExitStatus, str]] = [
        (["camera", files / "empty.png", *inputs], ExitStatus.CALIBRATION_REFUSED, "No configured marker"),
        (["camera", files / "markers.png", *inputs[:2], "--markers", others], ExitStatus.CALIBRATION_REFUSED, "marker"),
        (["camera", files / "none.png", *inputs], ExitStatus.NOT_FOUND, "none.png"),
        (["camera", files / "lens.yaml", *inputs], ExitStatus.DOCUMENT_PROBLEMS, "picture"),
        (["camera", files / "markers.png", *inputs[:2], "--markers", twice], ExitStatus.DOCUMENT_PROBLEMS, "marker 3"),
        (["camera", files / "markers.png", "--lens", lens, *inputs[2:]], ExitStatus.DOCUMENT_PROBLEMS, "fy"),
        (["camera", *inputs], ExitStatus.DOCUMENT_PROBLEMS, "picture"),
    ]
    for arguments, status, words in cases:
        ran = calibrate(*arguments)
        assert (ran.status, ran.out) == (status, ""), (arguments, ran)
        assert words in ran.err
        assert ran.err.count("\n") == 1
        assert "Traceback" not in ran.err


def test_frames_and_tips_are_computed_from_touched_points(tmp_path: Path, calibrate: Cli) -> None:
    turned = Orientation.from_rotation_vector(0.0, 0.0, math.radians(30))
    known = [Position(0, 0, 0), Position(0.3, 0, 0), Position(0, 0.2, 0), Position(0.3, 0.2, 0)]
    touched = [point.rotated(turned) + Position(0.5, 0.1, 0.0) for point in known]
    file = write(tmp_path / "points.yaml", {"known": known, "touched": touched})
    ran = calibrate("touch", file, "-o", tmp_path / "frame.json")
    assert ran.status == ExitStatus.OK, ran
    assert "30.00°" in ran.out
    frame = msgspec.json.decode((tmp_path / "frame.json").read_bytes(), type=Pose)
    assert frame.position.distance_to(Position(0.5, 0.1, 0.0)) < 1e-9

    tip = Position(0.01, 0.02, 0.15)
    turns = [(0, 0, 0), (0.6, 0, 0), (0, 0.6, 0), (-0.6, 0.4, 0), (0.3, -0.5, 0.2)]
    flanges = []
    for turn in turns:
        orientation = Orientation.from_rotation_vector(*turn)
        flanges.append(Pose(Position(0.4, 0, 0.2) - tip.rotated(orientation), orientation))
    ran = calibrate("touch", write(tmp_path / "tip.yaml", {"flanges": flanges}))
    assert "z 150.00 mm" in ran.out
    ran = calibrate("touch", write(tmp_path / "few.yaml", {"flanges": flanges[:1] * 5}))
    assert (ran.status, ran.out) == (ExitStatus.CALIBRATION_REFUSED, "")
    ran = calibrate("touch", write(tmp_path / "odd.yaml", {"known": known}))
    assert (ran.status, ran.out) == (ExitStatus.DOCUMENT_PROBLEMS, "")
    assert "touched" in ran.err


def test_intrinsics_and_hand_eye_read_and_write_files(files: Path, tmp_path: Path, calibrate: Cli) -> None:
    """Other tests check the results. This one checks that the files are read, and that refusals are reported."""
    board = write(tmp_path / "board.yaml", {"columns": 7, "rows": 5, "square": 0.03, "marker": 0.0225})
    ran = calibrate("intrinsics", files / "markers.png", "--board", board)
    assert (ran.status, ran.out) == (ExitStatus.CALIBRATION_REFUSED, ""), ran
    ran = calibrate("intrinsics", files / "markers.png", "--board", board, "--coefficients", "3")
    assert ran.status == ExitStatus.USAGE
    stations = write(tmp_path / "stations.yaml", [{"picture": "gone.png", "flange": Pose()}])
    target = write(tmp_path / "target.yaml", {"markers": [{"marker_id": 3, "pose": Pose()}], "size": 0.1})
    more = ("--lens", files / "lens.yaml", "--target", target, "--mounting", "eye_in_hand")
    ran = calibrate("hand-eye", stations, *more)
    assert (ran.status, ran.out) == (ExitStatus.NOT_FOUND, "")
    assert "gone.png" in ran.err
    (tmp_path / "gone.png").write_bytes((files / "markers.png").read_bytes())
    ran = calibrate("hand-eye", stations, *more)
    assert (ran.status, ran.out) == (ExitStatus.DOCUMENT_PROBLEMS, ""), ran


def test_angles_are_about_fixed_axes() -> None:
    for roll, pitch, yaw in ((0.3, -0.4, 1.2), (-2.0, 0.9, -3.0), (0.0, 0.0, 0.0)):
        about_x = Orientation.from_rotation_vector(roll, 0, 0)
        about_y = Orientation.from_rotation_vector(0, pitch, 0)
        about_z = Orientation.from_rotation_vector(0, 0, yaw)
        assert angles(Pose(orientation=about_z * about_y * about_x)) == pytest.approx((roll, pitch, yaw))


def test_markers_are_read_from_a_file_or_from_the_cell(files: Path, tmp_path: Path) -> None:
    path = tmp_path / "cell.yaml"
    path.write_text("devices: []\ncalibration:\n  marker_size: 0.05\n  markers:\n    4: {pose: {}}\n")
    found = _markers(None, path, read_cell(path))
    assert found is not None
    assert (found.marker_size, [marker.marker_id for marker in found.markers]) == (0.05, [4])
    given = _markers(files / "markers.yaml", path, read_cell(path))
    assert given is not None
    assert [marker.marker_id for marker in given.markers] == [3, 17]
    assert _markers(None, None, None) is None
    path.write_text(path.read_text() + "    4: {pose: {}}\n")
    with pytest.raises(InvalidData, match=r"cell\.yaml.*marker 4 is listed twice"):
        _markers(None, path, read_cell(path))


def test_calibrations_are_sent_to_and_read_from_a_running_server(files: Path, tmp_path: Path, calibrate: Cli) -> None:
    with serving(tmp_path / "data") as server:
        url = ("--url", server.url)
        ran = calibrate("online", "markers", files / "markers.yaml", *url)
        assert (ran.status, ran.out.strip()) == (ExitStatus.OK, "Stored 2 markers and 0 boards.")
        base = server.url.replace("ws", "http", 1)
        assert [m["marker_id"] for m in httpx.get(f"{base}/api/calibration/markers").json()["markers"]] == [3, 17]
        by_hand = {"object_id": "obj_1", "object_name": "cam", "pose": {"position": {"x": 0.25}}, "before": {}}
        stored = httpx.post(f"{base}/api/calibrations", json=by_hand).json()
        ran = calibrate("online", "records", *url)
        assert "by_hand" in ran.out
        assert "250.0 mm" in ran.out
        assert "There are no calibrations" in calibrate("online", "records", "other", *url).out
        checked = httpx.put(f"{base}/api/calibrations/{stored['id']}/check", json={"pose": {"position": {"x": 0.26}}})
        assert checked.json()["passed"] is False
        near, far = tmp_path / "near.yaml", tmp_path / "far.yaml"
        near.write_text("position: {x: 0.2515}")
        far.write_text("position: {x: 0.26}")
        ran = calibrate("online", "check", "cam", "--pose", near, *url)
        assert (ran.status, "cam is still as calibrated" in ran.out, "1.5 mm" in ran.out) == (0, True, True)
        ran = calibrate("online", "check", "cam", "--pose", far, "--record", stored["id"], *url)
        assert (ran.status, ran.out) == (ExitStatus.DIFFERENT, "")
        assert "cam differs by 10.0 mm" in ran.err
        ran = calibrate("online", "check", "cam", "--pose", far, "--distance", "0.011", *url)
        assert ran.status == 0
        for words, status in (
            (("other", "--pose", near), ExitStatus.NOT_FOUND),
            (("other", "--pose", near, "--record", stored["id"]), ExitStatus.DOCUMENT_PROBLEMS),
            (("cam", "--pose", near, "--record", "cal_none"), ExitStatus.NOT_FOUND),
            (("cam",), ExitStatus.CONFLICT),
        ):
            assert calibrate("online", "check", *words, *url).status == status, words
        ran = calibrate("online", "camera", "cam", *url)
        assert (ran.status, ran.out) == (ExitStatus.CONFLICT, "")
        assert "No scene is open" in ran.err
    ran = calibrate("online", "records", "--url", "ws://127.0.0.1:9")
    assert ran.status == ExitStatus.NO_SERVER
