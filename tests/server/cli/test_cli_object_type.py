"""`arcor2-hw object-type`: upload types written for ARCOR2, with bases and mixins, to a running server."""

import asyncio
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from arcor2_hw.analysis import module_name
from arcor2_hw.client import Client
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.exchange.import_ import HIDES_INSTALLED
from tests.runtime.older_sources import SOURCES
from tests.server.cli.in_process import Ran, run_app, serving
from tests.server.core.serving import ServerProcess

Cli = Callable[..., Ran]


@pytest.fixture
def object_type(capsys: pytest.CaptureFixture[str]) -> Cli:
    """Run the command line in this process."""

    def run(server: ServerProcess | None, *arguments: str | Path) -> Ran:
        url = "ws://127.0.0.1:9" if server is None else server.url
        return run_app(capsys, "object-type", *arguments, "--url", url)

    return run


@pytest.fixture
def server(tmp_path: Path) -> Iterator[ServerProcess]:
    with serving(tmp_path / "data") as process:
        yield process


async def types(url: str) -> dict[str, tuple[bool, str]]:
    async with Client(url) as client:
        return {meta.type: (meta.disabled, meta.base) for meta in await client.get_object_types()}


@pytest.fixture
def sources(tmp_path: Path) -> Path:
    for name, source in SOURCES.items():
        (tmp_path / f"{module_name(name)}.py").write_text(source)
    return tmp_path


def test_related_types_are_uploaded_together_and_separately(
    sources: Path, server: ServerProcess, object_type: Cli
) -> None:
    arm, base, mixin = (sources / f"{name}.py" for name in ("arm_m1", "abstract_arm", "kinematics_mixin"))
    helper = sources / "gains.py"
    helper.write_text("SLOW = 0.1\n")
    arm.write_text(f"{arm.read_text()}\n\nfrom .gains import SLOW\n")
    assert object_type(server, "add", helper).out == "gains uploaded\n"
    incomplete = object_type(server, "add", arm)
    assert incomplete.status == ExitStatus.ANALYSIS_PROBLEMS
    assert "arm_m1.py:3: the imported module abstract_arm does not exist" in incomplete.err
    together = object_type(server, "add", arm, base, mixin)
    assert (together.status, together.err) == (0, "")
    assert together.out == "AbstractArm uploaded\nArmM1 uploaded with kinematics_mixin\n"
    assert object_type(server, "add", helper).out == "gains uploaded, used by ArmM1\n"
    known = asyncio.run(types(server.url))
    assert known["ArmM1"] == (False, "AbstractArm")
    assert "gains" not in known
    # Its dependencies are uploaded already.
    arm.write_text(arm.read_text().replace("arm-m1.zip", "arm-m2.zip"))
    assert object_type(server, "add", arm).status == 0
    listed = object_type(server, "list").out
    assert all(name in listed for name in ("AbstractArm", "ArmM1", "gains"))
    assert object_type(server, "remove", "gains").status == 0
    assert object_type(server, "remove", "gains").status == ExitStatus.NOT_FOUND
    again = object_type(server, "add", arm)
    assert again.status == ExitStatus.ANALYSIS_PROBLEMS
    assert "gains" in again.err
    # The name of an installed type: a notice says so, and how to undo it.
    flow = sources / "flow_actions.py"
    flow.write_text(
        "from arcor2_hw.objects import Generic\n\n\n"
        'class FlowActions(Generic):\n    _ABSTRACT = False\n    display_name = "Own flow"\n'
    )
    notice = object_type(server, "add", flow).out
    assert "FlowActions replaces the installed type of arcor2-hw" in notice
    assert "until you remove it" in notice
    assert "Own flow" in object_type(server, "list").out
    exported = sources / "flow.zip"
    assert object_type(server, "export", "FlowActions", "--output", exported).status == 0
    assert object_type(server, "remove", "FlowActions").status == 0
    imported = object_type(server, "import", exported)
    assert imported.out == f"object type FlowActions: new, {HIDES_INSTALLED}\n", imported.err


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
        assert (done.status, words in done.err) == (status, True), done.err
