"""Object types and scripts written for ARCOR2 run unchanged: in the analysis, a scene and a package."""

import contextlib
import json
import socketserver
import subprocess
import sys
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

import msgspec
import pytest

from arcor2_hw.analysis import Library, SourceFile
from arcor2_hw.data.geometry import Orientation, Pose, Position
from arcor2_hw.data.object_type import Box, ObjectModel
from arcor2_hw.data.older_names import OLDER_NAMES
from arcor2_hw.data.project import Action, ActionPoint, NamedOrientation, Project
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.creation import module_name

from .conftest import HostProcess, Package, open_scene, scene_object
from .older_sources import ACTION_POINTS, SCRIPT, SOURCES


# ---------------------------------------------------------------------------------------------- services that they use
class ArmService(ThreadingHTTPServer):
    """A REST service of a robot: camelCase, 204 for success, WebApiError for errors."""

    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), ArmHandler)
        self.requests: list[tuple[str, str, Any]] = []
        self.started = False
        self.url = f"http://127.0.0.1:{self.server_address[1]}"

    def received(self, prefix: str) -> list[tuple[str, Any]]:
        return [(path, body) for method, path, body in self.requests if f"{method} {path}".startswith(prefix)]


class ArmHandler(BaseHTTPRequestHandler):
    server: ArmService
    protocol_version = "HTTP/1.1"

    def answer(self, status: int, value: Any = None) -> None:
        body = b"" if value is None else json.dumps(value).encode()
        self.send_response(status)
        if status != 204:
            self.send_header("Content-Length", str(len(body)))
        self.end_headers()
        self.wfile.write(body)

    def record(self) -> None:
        length = int(self.headers.get("Content-Length") or 0)
        body = json.loads(self.rfile.read(length)) if length else None
        self.server.requests.append((self.command, self.path, body))
        joint = {"name": "j1", "value": 0.5}
        match f"{self.command} {self.path.partition('?')[0]}":
            case "GET /state/started":
                self.answer(200, self.server.started)
            case "PUT /state/start" | "PUT /state/stop":
                self.server.started = self.path == "/state/start"
                self.answer(204)
            case "GET /eef/pose":
                self.answer(200, {"position": {"x": 1, "y": 2, "z": 3}, "orientation": {"w": 1.0}})
            case "GET /joints":
                self.answer(200, [joint, {"name": "j2", "value": 1}])
            case "PUT /ik" if body["pose"]["position"]["x"] < 5:
                self.answer(200, [joint])
            case "PUT /ik":
                self.answer(500, {"service": "Arm", "message": "Out of reach.", "type": "General", "description": "x"})
            case "PUT /eef/pose":
                self.answer(204)
            case _:
                self.answer(404, {"message": None})

    do_GET = do_PUT = record  # noqa: N815

    def log_message(self, format: str, *args: Any) -> None:  # noqa: A002
        pass


class BenchHandler(socketserver.StreamRequestHandler):
    server: "BenchService"

    def handle(self) -> None:
        for line in self.rfile:
            if line == b"bye\n":
                self.server.left.set()
                return
            match json.loads(line):
                case {"programs": group}:
                    answer: Any = {"programs": [f"{group}1", f"{group}2"]}
                case {"test": "none"}:
                    answer = {"error": "no such program"}
                case {"test": _, "level": level}:
                    answer = {"good": level == 2, "volts": 4.5}
            self.wfile.write(json.dumps(answer).encode() + b"\n")


class BenchService(socketserver.ThreadingTCPServer):
    def __init__(self) -> None:
        super().__init__(("127.0.0.1", 0), BenchHandler)
        self.left = threading.Event()


@contextlib.contextmanager
def serving(server: Any) -> Iterator[Any]:
    thread = threading.Thread(target=server.serve_forever, args=(0.02,))
    thread.start()
    try:
        yield server
    finally:
        server.shutdown()
        thread.join()
        server.server_close()


@pytest.fixture
def arm_service() -> Iterator[ArmService]:
    with serving(ArmService()) as server:
        yield server


@pytest.fixture
def bench_service() -> Iterator[BenchService]:
    with serving(BenchService()) as server:
        yield server


def codes(*names: str) -> list[m.TypeCode]:
    return [m.TypeCode(name, module=module_name(name), source=SOURCES[name]) for name in names or SOURCES]


# ---------------------------------------------------------------------------------------------- analysis
def test_older_sources_are_analysed() -> None:
    library = Library(SourceFile(name, module_name(name), source) for name, source in SOURCES.items())
    for name in SOURCES:
        analysis = library.analyse(name)
        assert analysis.problem is None, name
        assert not [action for action in analysis.actions if action.disabled], name
    assert not library.analyse("KinematicsMixin").is_object_type

    arm = library.analyse("ArmM1")
    assert (arm.meta.abstract, arm.meta.base, arm.bases) == (
        False,
        "AbstractArm",
        ("AbstractArm", "Robot", "GenericWithPose", "Generic"),
    )
    assert [(s.name, s.type, s.default_value) for s in arm.meta.settings] == [
        ("url", "string", msgspec.UNSET),
        ("slow", "boolean", "false"),
    ]
    assert arm.robot is not None
    assert arm.robot.robot_type == "scara"
    assert arm.robot.urdf_package_filename == "arm-m1.zip"
    features = arm.robot.features
    assert (features.inverse_kinematics, features.move_to_pose, features.stop) == (True, True, False)
    (move,) = [action for action in arm.actions if action.name == "move"]
    assert move.origins == "AbstractArm"
    assert [(p.name, p.type, p.description) for p in move.parameters] == [
        ("pose", "pose", "Where to."),
        ("move_type", "string_enum", "Way of moving."),
        ("velocity", "double", "Percent."),
    ]

    bench = {action.name: action for action in library.analyse("TestBench").actions}
    assert list(bench) == ["both", "test", "wait"]
    assert bench["test"].returns == ["boolean", "double"]
    assert (bench["wait"].meta.cancellable, bench["test"].meta.cancellable) == (True, False)
    assert bench["both"].meta.composite
    group, program, level = bench["test"].parameters
    assert (group.dynamic_value, group.dynamic_value_parents) == (True, msgspec.UNSET)
    assert (program.dynamic_value, program.dynamic_value_parents) == (True, {"group"})
    assert (level.type, level.extra) == ("integer_enum", '{"allowed_values":[1,2]}')
    assert library.analyse("ShopCamera").actions[0].returns == ["integer"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (
            "from arcor2.data.common import Pose, Gadget",
            "arcor2.data.common.Gadget is not available. Available in arcor2.data.common: ActionMetadata, ",
        ),
        (
            "from arcor2.clients import scene_service",
            "arcor2.clients is not available. Available in arcor2: DynamicParamTuple, data, exceptions, json, ",
        ),
        ("import arcor2.helpers", "arcor2.helpers is not available. Available in arcor2: "),
        ("from arcor2 import rpc", "arcor2.rpc is not available. Available in arcor2: "),
        (
            "from arcor2_web import dataclasses",
            "arcor2_web.dataclasses is not available. Available in arcor2_web: rest",
        ),
        ("from arcor2_object_types.upload import up", "arcor2_object_types.upload is not available"),
    ],
)
def test_analysis_and_import_name_missing_older_modules(host: HostProcess, line: str, words: str) -> None:
    source = f"from arcor2_object_types.abstract import Generic\n{line}\n\nclass Odd(Generic):\n    _ABSTRACT = False\n"
    problem = Library([SourceFile("Odd", "odd", source)]).analyse("Odd").problem
    assert problem is not None
    assert words in str(problem)
    assert problem.line == 2
    host.send(open_scene([m.TypeCode("Odd", module="odd", source=source)], scene_object("odd", "Odd")))
    error = host.expect(m.SceneFailed).error
    assert words in error.message.text
    assert "Odd" in error.message.text


def test_a_source_may_handle_the_import_error_of_a_missing_module(host: HostProcess) -> None:
    source = """
from arcor2_object_types.abstract import Generic
try:
    from arcor2.data.common import Gadget
except ImportError:
    Gadget = None

class Odd(Generic):
    _ABSTRACT = False
"""
    assert Library([SourceFile("Odd", "odd", source)]).analyse("Odd").problem is None
    host.send(open_scene([m.TypeCode("Odd", module="odd", source=source)], scene_object("odd", "Odd")))
    host.expect(m.SceneOpened)


# ---------------------------------------------------------------------------------------------- scene
def test_an_older_robot_behind_a_rest_service_works_in_a_scene(host: HostProcess, arm_service: ArmService) -> None:
    arm = SceneObject(
        "arm", "ArmM1", Pose(Position(10, 0, 0)), scene_object("arm", "x", url=arm_service.url).parameters, "obj_arm"
    )
    host.send(open_scene(codes("KinematicsMixin", "AbstractArm", "ArmM1"), arm))
    host.expect(m.SceneOpened)
    ((_, start),) = arm_service.received("PUT /state/start")
    assert start["position"]["x"] == 10
    assert host.call("obj_arm", "get_end_effector_pose", end_effector="default")["position"] == {
        "x": 11,
        "y": 2,
        "z": 3,
    }
    assert host.call("obj_arm", "robot_joints") == [{"name": "j1", "value": 0.5}, {"name": "j2", "value": 1}]
    target = {"position": {"x": 12, "y": 0, "z": 0}, "orientation": {"x": 0, "y": 0, "z": 0, "w": 1}}
    assert host.call("obj_arm", "move", pose=target, move_type="LINEAR") is None
    ((path, body),) = arm_service.received("PUT /eef/pose")
    assert path == "/eef/pose?moveType=LINEAR&velocity=50.0&safe=true"
    assert body["position"] == {"x": 2, "y": 0, "z": 0}
    near = {"position": {"x": 1, "y": 0, "z": 0}, "orientation": target["orientation"]}
    found = host.call("obj_arm", "inverse_kinematics", end_effector_id="default", pose=near)
    assert found == [{"name": "j1", "value": 0.5}]
    ((_, body),) = arm_service.received("PUT /ik")
    assert set(body) == {"pose", "avoidCollisions"}
    refused = host.call("obj_arm", "inverse_kinematics", end_effector_id="default", pose=target)
    assert (refused.code, refused.type) == ("rest_refused", "RestHttpException")
    assert refused.message.text.endswith("/ik: Out of reach.")
    assert "arm" in refused.message.text
    assert host.call("obj_arm", "home").message.text.endswith("404 Not Found")
    logged = host.expect(m.LogLine, within=0.1) if not any(isinstance(s, m.LogLine) for s in host.seen) else None
    lines = [s.text for s in [*host.seen, logged] if isinstance(s, m.LogLine)]
    assert any("arm started" in line for line in lines)
    host.send(m.CloseScene())
    assert host.expect(m.SceneClosed).error is None
    assert arm_service.received("PUT")[-1][0] == "/state/stop"


def test_the_error_of_a_constructor_is_reported(host: HostProcess, arm_service: ArmService) -> None:
    arm_service.started = True
    arm = scene_object("arm", "ArmM1", pose=True, url=arm_service.url)
    host.send(open_scene(codes("KinematicsMixin", "AbstractArm", "ArmM1"), arm))
    error = host.expect(m.SceneFailed).error
    assert "Somebody uses the arm." in error.message.text
    assert "arm" in error.message.text
    assert arm_service.url in error.message.text


def test_an_unreachable_service_is_named(host: HostProcess) -> None:
    arm = scene_object("arm", "ArmM1", pose=True, url="http://127.0.0.1:1")
    host.send(open_scene(codes("KinematicsMixin", "AbstractArm", "ArmM1"), arm))
    error = host.expect(m.SceneFailed).error
    assert (error.code, "GET http://127.0.0.1:1/state/started" in error.message.text) == ("rest", True)


def test_an_older_machine_supports_settings_dynamic_values_and_cancel(
    host: HostProcess, bench_service: BenchService
) -> None:
    bench = scene_object("bench", "TestBench", port=bench_service.server_address[1], level=2)
    host.send(open_scene(codes("TestBench"), bench))
    host.expect(m.SceneOpened)
    assert set(host.call("obj_bench", "programs", group="b")) == {"b1", "b2"}
    assert host.call("obj_bench", "test", group="a", program="fast", level=2) == [True, 4.5]
    refused = host.call("obj_bench", "test", group="a", program="none", level=1)
    assert (refused.type, "no such program" in refused.message.text) == ("BenchException", True)
    waiting = host.begin("obj_bench", "wait", seconds=60.0)
    host.send(m.Call(1000, "obj_bench", "wait", cancel=True))
    assert host.answer(1000) is None
    assert host.answer(waiting) is True
    host.send(m.CloseScene())
    assert host.expect(m.SceneClosed).error is None
    assert bench_service.left.wait(30)


def test_an_older_camera_and_collision_object_work_in_a_scene(host: HostProcess) -> None:
    crate = scene_object("crate", "Crate", pose=True)
    models = {"Crate": ObjectModel.of(Box("Crate", 0.1, 0.2, 0.5))}
    camera = scene_object("camera", "ShopCamera", pose=True)
    host.send(open_scene(codes("ShopCamera", "Crate"), crate, camera, models=models))
    host.expect(m.SceneOpened)
    assert host.call("obj_crate", "volume") == pytest.approx(0.01)
    assert host.call("obj_camera", "color_camera_params")["fx"] == 900.0
    picture = host.call("obj_camera", "color_image")
    assert host.call("obj_camera", "brightness", image=picture) == 76


# ---------------------------------------------------------------------------------------------- package
def test_a_package_built_by_arcor2_runs(
    host: HostProcess, package: Package, arm_service: ArmService, bench_service: BenchService
) -> None:
    names = [f"a{number}" for number in range(1, 7)]
    objects = {"a1": "arm/move", "a2": "bench/test", "a3": "camera/color_image", "a4": "camera/brightness"}
    actions = [Action(name, f"obj_{objects.get(name, 'bench/test')}", f"act_{name}") for name in names]
    point = ActionPoint(
        "top", Position(1, 2, 3), id="acp_top", orientations=[NamedOrientation("o", Orientation(), "ori_top")]
    )
    project = Project("p", "scn_1", id="pro_1", action_points=[msgspec.structs.replace(point, actions=actions)])
    directory = package.write(
        {},
        [
            scene_object("arm", "ArmM1", pose=True, url=arm_service.url),
            scene_object("bench", "TestBench", port=bench_service.server_address[1]),
            scene_object("camera", "ShopCamera", pose=True),
        ],
        project,
        "pass",
        script=SCRIPT,
    )
    (directory / "action_points.py").write_text(ACTION_POINTS)
    for name, source in SOURCES.items():
        (directory / "object_types" / f"{module_name(name)}.py").write_text(source)
    host.send(m.RunPackage("pkg_1", str(directory), False, [], 0.05))
    ended = host.expect_state("stopped")
    assert ended.error is not None
    reported = [(e.event, json.loads(e.encoded)["data"]) for e in host.seen if isinstance(e, m.ProgramEvent)]
    before = [data["action_id"] for name, data in reported if name == "ActionStateBefore"]
    assert before == [f"act_{name}" for name in ["a1", "a2", "a3", "a4"] * 2 + ["a5", "a6"]], ended.error
    (exception,) = [data for name, data in reported if name == "ProjectException"]
    assert exception["type"] == "BenchException"
    assert exception["handled"] is True
    assert "no such program" in exception["message"]
    assert [body["position"] for _, body in arm_service.received("PUT /eef/pose")] == [{"x": 1, "y": 2, "z": 3}] * 2
    assert arm_service.received("PUT")[-1][0] == "/state/stop"
    assert bench_service.left.wait(30)


def test_a_script_with_older_types_runs_by_hand(package: Package, bench_service: BenchService) -> None:
    script = """
from arcor2_hw.runtime.resources import Resources
from object_types.test_bench import Level, TestBench

with Resources() as res:
    bench: TestBench = res.objects["obj_bench"]
    assert bench.test("a", "fast", Level.HIGH, an="a1") == (True, 4.5)
"""
    bench = scene_object("bench", "TestBench", port=bench_service.server_address[1])
    point = ActionPoint("top", Position(), id="acp_top", actions=[Action("a1", "obj_bench/test", "act_a1")])
    directory = package.write({}, [bench], Project("p", "scn_1", action_points=[point]), "", script=script)
    (directory / "object_types" / "test_bench.py").write_text(SOURCES["TestBench"])
    done = subprocess.run(
        [sys.executable, "script.py"],
        cwd=directory,
        capture_output=True,
        text=True,
        timeout=60,
        stdin=subprocess.DEVNULL,
    )
    assert done.returncode == 0, done.stderr
    events = [json.loads(line) for line in done.stdout.splitlines()]
    assert [event["event"] for event in events][:4] == [
        "PackageState",
        "PackageInfo",
        "ActionStateBefore",
        "ActionStateAfter",
    ]
    assert events[3]["data"] == {"action_id": "act_a1", "results": ["true", "4.5"]}


# ---------------------------------------------------------------------------------------------- the import finder
def run_python(code: str, path: Path | None = None) -> str:
    prefix = "" if path is None else f"import sys; sys.path.insert(0, {str(path)!r})\n"
    done = subprocess.run([sys.executable, "-P", "-c", prefix + code], capture_output=True, text=True, timeout=60)
    assert done.returncode == 0, done.stderr
    return done.stdout


def test_every_older_name_can_be_imported() -> None:
    lines = [f"from {module} import {', '.join(names)}" for module, names in OLDER_NAMES.items() if names]
    code = "from arcor2_hw.runtime.older import install\ninstall(); install()\n" + "\n".join(lines)
    code += """
import sys, arcor2
print(sum("_Finder" in repr(finder) for finder in sys.meta_path))
print(arcor2.data.common.Pose.__module__)
"""
    out = run_python(code)
    assert out.split() == ["1", "arcor2_hw.data.geometry"]


def test_an_installed_package_of_the_same_name_is_ignored(tmp_path: Path) -> None:
    (tmp_path / "arcor2").mkdir()
    (tmp_path / "arcor2" / "__init__.py").write_text("raise SystemExit('looked at')")
    code = """
from arcor2_hw.runtime.older import install
install()
import arcor2 as peer
from arcor2_hw.data import geometry
assert peer.data.common.Pose is geometry.Pose
from arcor2.data.common import Pose
assert Pose is geometry.Pose
import arcor2
assert not hasattr(arcor2, "nothing")
try:
    import arcor2.nothing
except ImportError as error:
    print(error)
"""
    assert "arcor2.nothing is not available" in run_python(code, tmp_path)


def test_the_server_does_not_import_older_modules() -> None:
    out = run_python("""
import sys
import arcor2_server.cli.serve
import arcor2_server.app
print([name for name in sys.modules if name.startswith(("arcor2.", "arcor2_object_types", "arcor2_web"))])
print("arcor2_hw.runtime.older" in sys.modules, any("older" in repr(finder) for finder in sys.meta_path))
""")
    assert out.split("\n")[:2] == ["[]", "False False"]
