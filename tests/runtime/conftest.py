"""A cell host in its own process, controlled by the test in place of the server."""

import os
import select
import socket
import subprocess
import tempfile
import textwrap
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, TypeVar

import msgspec
import pytest
from msgspec import UnsetType

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.geometry import Pose
from arcor2_hw.data.interlocks import Interlock
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.project import Project
from arcor2_hw.data.scene import Scene, SceneObject
from arcor2_hw.runtime import messages as m
from arcor2_hw.runtime.creation import module_name
from arcor2_hw.runtime.ring import Ring, create
from tests.forking import Forker

T = TypeVar("T")
HOST = "arcor2_hw.runtime.host"
_forker = Forker()
PATIENCE = 20.0  # time limit, s; the machine may be busy


class HostProcess:
    """A cell host. Its messages are stored in `seen`, except heartbeats."""

    def __init__(self) -> None:
        ours, theirs = socket.socketpair()
        memory = create()
        self.socket = ours
        self._folder = tempfile.TemporaryDirectory()  # as the server does
        self.process = _forker.start(
            HOST,
            ["--fd", str(theirs.fileno()), "--ring", str(memory)],
            [HOST],
            subprocess.STDOUT,
            os.environ | {"TMPDIR": self._folder.name},
            inherited=[theirs.fileno(), memory],
        )
        theirs.close()
        self.ring = Ring(memory)
        self._buffer = b""
        self.seen: list[Any] = []
        self.times: list[float] = []
        self._calls = 0
        self.expect(m.Ready)

    # ---------------------------------------------------------------- messages
    def send(self, message: m.ToHost) -> None:
        self.socket.sendall(m.encode(message))

    def _next(self, deadline: float) -> Any:
        while True:
            if len(self._buffer) >= m.PREFIX_SIZE:
                end = m.PREFIX_SIZE + m.body_length(self._buffer[: m.PREFIX_SIZE])
                if len(self._buffer) >= end:
                    body, self._buffer = self._buffer[m.PREFIX_SIZE : end], self._buffer[end:]
                    return m.decode_server_bound(body)
            left = deadline - time.monotonic()
            ready, _, _ = select.select([self.socket], [], [], max(left, 0))
            if not ready:
                raise AssertionError(f"no message arrived; seen: {self.seen[-20:]}")
            chunk = self.socket.recv(1 << 20)
            if not chunk:
                raise EOFError(f"the host has ended; seen: {self.seen[-20:]}, output: {self.output()}")
            self._buffer += chunk

    def expect(self, kind: type[T], where: Callable[[T], bool] = lambda _: True, within: float = PATIENCE) -> T:
        """Return the next message of a type for which `where` is true. Others are stored in `seen`."""
        deadline = time.monotonic() + within
        while True:
            message = self._next(deadline)
            if not isinstance(message, m.Heartbeat):
                self.seen.append(message)
                self.times.append(time.monotonic())
            if isinstance(message, kind) and where(message):
                return message

    def expect_state(self, state: str, within: float = PATIENCE) -> m.ProgramChanged:
        return self.expect(m.ProgramChanged, lambda c: c.state == state, within)

    def expect_event(self, name: str, within: float = PATIENCE) -> Any:
        found = self.expect(m.ProgramEvent, lambda e: e.event == name, within)
        return msgspec.json.decode(found.encoded)["data"]

    def begin(self, object_id: str, method: str, deadline: float | None = None, **arguments: Any) -> int:
        self._calls += 1
        encoded = {name: msgspec.json.encode(value) for name, value in arguments.items()}
        self.send(m.Call(self._calls, object_id, method, encoded, deadline=deadline))
        return self._calls

    def answer(self, number: int, within: float = PATIENCE) -> Any:
        known = [s for s in self.seen if isinstance(s, m.CallDone | m.CallFailed) and s.id == number]
        got = known[0] if known else self.expect(m.CallDone | m.CallFailed, lambda a: a.id == number, within)
        if isinstance(got, m.CallFailed):
            return got.error
        return msgspec.json.decode(got.value) if got.value else None

    def call(self, object_id: str, method: str, deadline: float | None = None, **arguments: Any) -> Any:
        return self.answer(self.begin(object_id, method, deadline, **arguments))

    def events(self) -> list[str]:
        """Return the names of the events of the program so far, without streams."""
        names = []
        for message in self.seen:
            if isinstance(message, m.ProgramEvent):
                names.append(message.event)
            elif isinstance(message, m.ProgramChanged):
                names.append(message.state)
        return names

    # ---------------------------------------------------------------- process
    def output(self) -> str:
        assert self.process.stdout is not None
        os.set_blocking(self.process.stdout.fileno(), False)
        return (self.process.stdout.read() or b"").decode(errors="replace")

    def gone(self, within: float = PATIENCE) -> int:
        return self.process.wait(within)

    def end(self) -> None:
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()
        self.socket.close()
        assert self.process.stdout is not None
        self.process.stdout.close()
        self._folder.cleanup()


@pytest.fixture
def host() -> Iterator[HostProcess]:
    process = HostProcess()
    yield process
    process.end()


HEADER = """
import os, time, threading, ctypes, sys
from pathlib import Path
from dataclasses import dataclass, field
from arcor2_hw.actions import action, observation
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.robot import Joint
from arcor2_hw.data.project import ProjectRobotJoints
from arcor2_hw.exceptions import *
from arcor2_hw.objects import Generic, GenericWithPose, CollisionObject, Robot, Settings
"""


def type_code(name: str, source: str) -> m.TypeCode:
    return m.TypeCode(name, module=module_name(name), source=HEADER + textwrap.dedent(source))


def scene_object(name: str, kind: str, *, pose: bool = False, **settings: Any) -> SceneObject:
    parameters = [Parameter(key, "x", msgspec.json.encode(value).decode()) for key, value in settings.items()]
    return SceneObject(name, kind, Pose() if pose else UNSET, parameters, f"obj_{name}")


def open_scene(types: list[m.TypeCode], *objects: SceneObject, **more: Any) -> m.OpenScene:
    return m.OpenScene(Scene("scene", id="scn_1", objects=list(objects)), types, **more)


SCRIPT = """
from arcor2_hw.runtime.exceptions import print_exception
from arcor2_hw.runtime.resources import Resources
from arcor2_hw.exceptions import *
import threading, time, sys, os, ctypes

def main(res):
{body}

if __name__ == "__main__":
    try:
        with Resources() as res:
            main(res)
    except Exception as e:
        print_exception(e)
"""


class Package:
    """Write a package. `types`: sources by type name; `body`: body of main()."""

    def __init__(self, directory: Path) -> None:
        self.directory = directory

    def write(
        self,
        types: dict[str, str],
        objects: list[SceneObject],
        project: Project,
        body: str,
        *,
        script: str = SCRIPT,
        interlocks: list[Interlock] | UnsetType = UNSET,
    ) -> Path:
        data = self.directory / "data"
        (data / "models").mkdir(parents=True)
        scene = Scene("scene", id="scn_1", objects=objects, interlocks=interlocks)
        (data / "scene.json").write_bytes(msgspec.json.encode(scene))
        (data / "project.json").write_bytes(msgspec.json.encode(project))
        package = self.directory / "object_types"
        package.mkdir()
        (package / "__init__.py").write_text("")
        for name, source in types.items():
            (package / f"{module_name(name)}.py").write_text(HEADER + textwrap.dedent(source))
        indented = textwrap.indent(textwrap.dedent(body).strip("\n"), "    ")
        (self.directory / "script.py").write_text(script.replace("{body}", indented))
        (self.directory / "package.json").write_text('{"name": "demo", "built": "2026-01-01T00:00:00+00:00"}')
        return self.directory


@pytest.fixture
def package(tmp_path: Path) -> Package:
    return Package(tmp_path / "pkg_1")
