"""`arcor2-hw object-type`: upload types written for ARCOR2, with bases and mixins, to a running server."""

import asyncio
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import NamedTuple

import pytest

from arcor2_hw.analysis import module_name
from arcor2_hw.client import Client
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.main import app
from arcor2_server.exchange.import_ import HIDES_INSTALLED
from tests.runtime.older_sources import SOURCES
from tests.server.core.serving import ServerProcess


class Ran(NamedTuple):
    returncode: int
    stdout: str
    stderr: str


Cli = Callable[..., Ran]


@pytest.fixture
def object_type(capsys: pytest.CaptureFixture[str]) -> Cli:
    """Run the command line in this process."""

    def run(server: ServerProcess | None, *arguments: str | Path) -> Ran:
        url = "ws://127.0.0.1:9" if server is None else server.url
        capsys.readouterr()
        status = app(["object-type", *map(str, arguments), "--url", url])
        return Ran(status, *capsys.readouterr())

    return run


@pytest.fixture
def loop() -> Iterator[asyncio.Runner]:
    with asyncio.Runner() as runner:
        yield runner


@pytest.fixture
def server(loop: asyncio.Runner, tmp_path: Path) -> Iterator[ServerProcess]:
    process = ServerProcess(tmp_path / "data")
    loop.run(process.start())
    yield process
    loop.run(process.stop())


async def types(url: str) -> dict[str, tuple[bool, str]]:
    async with Client(url) as client:
        return {meta.type: (meta.disabled, meta.base) for meta in await client.get_object_types()}


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    for name, source in SOURCES.items():
        (tmp_path / f"{module_name(name)}.py").write_text(source)
    return tmp_path


def test_related_types_are_uploaded_together_and_separately(
    sources: Path, server: ServerProcess, loop: asyncio.Runner, object_type: Cli
) -> None:
    arm, base, mixin = (sources / f"{name}.py" for name in ("arm_m1", "abstract_arm", "kinematics_mixin"))
    helper = sources / "gains.py"
    helper.write_text("SLOW = 0.1\n")
    arm.write_text(f"{arm.read_text()}\n\nfrom .gains import SLOW\n")
    assert object_type(server, "add", helper).stdout == "gains uploaded\n"
    incomplete = object_type(server, "add", arm)
    assert incomplete.returncode == ExitStatus.ANALYSIS_PROBLEMS
    assert "arm_m1.py:3: the imported module abstract_arm does not exist" in incomplete.stderr
    together = object_type(server, "add", arm, base, mixin)
    assert (together.returncode, together.stderr) == (0, "")
    assert together.stdout == "AbstractArm uploaded\nArmM1 uploaded with kinematics_mixin\n"
    assert object_type(server, "add", helper).stdout == "gains uploaded, used by ArmM1\n"
    known = loop.run(types(server.url))
    assert known["ArmM1"] == (False, "AbstractArm")
    assert "gains" not in known
    # Its dependencies are uploaded already.
    arm.write_text(arm.read_text().replace("arm-m1.zip", "arm-m2.zip"))
    assert object_type(server, "add", arm).returncode == 0
    listed = object_type(server, "list").stdout
    assert all(name in listed for name in ("AbstractArm", "ArmM1", "gains"))
    assert object_type(server, "remove", "gains").returncode == 0
    assert object_type(server, "remove", "gains").returncode == ExitStatus.NOT_FOUND
    again = object_type(server, "add", arm)
    assert again.returncode == ExitStatus.ANALYSIS_PROBLEMS
    assert "gains" in again.stderr
    # The name of an installed type: a notice says so, and how to undo it.
    flow = sources / "flow_actions.py"
    flow.write_text(
        "from arcor2_hw.objects import Generic\n\n\n"
        'class FlowActions(Generic):\n    _ABSTRACT = False\n    display_name = "Own flow"\n'
    )
    notice = object_type(server, "add", flow).stdout
    assert "FlowActions replaces the installed type of arcor2-hw" in notice
    assert "until you remove it" in notice
    assert "Own flow" in object_type(server, "list").stdout
    exported = sources / "flow.zip"
    assert object_type(server, "export", "FlowActions", "--output", exported).returncode == 0
    assert object_type(server, "remove", "FlowActions").returncode == 0
    imported = object_type(server, "import", exported)
    assert imported.stdout == f"object type FlowActions: new, {HIDES_INSTALLED}\n", imported.stderr


def test_invalid_types_are_refused(sources: Path, object_type: Cli) -> None:
    two = sources / "two.py"
    two.write_text(
        "from arcor2_hw.objects import Generic\n\n\n"
        "class A(Generic):\n    _ABSTRACT = False\n\n\nclass B(A):\n    pass\n"
    )
    wrong = sources / "wrong.py"
    wrong.write_text("class (")
    cases = (
        ((two,), ExitStatus.USAGE, "--name: A, B"),
        ((two, "--name", "C"), ExitStatus.USAGE, "--name: A, B"),
        ((), ExitStatus.USAGE, "specify the files"),
        ((two, wrong, "--name", "A"), ExitStatus.USAGE, "only with a single file"),
        ((wrong,), ExitStatus.ANALYSIS_PROBLEMS, "wrong.py:1"),
        ((sources / "nothing.py",), ExitStatus.NOT_FOUND, "nothing.py"),
        ((two, "--name", "A"), ExitStatus.NO_SERVER, "127.0.0.1:9"),
    )
    for arguments, status, words in cases:
        done = object_type(None, "add", *arguments)
        assert (done.returncode, words in done.stderr) == (status, True), done.stderr
