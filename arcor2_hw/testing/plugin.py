"""The pytest plugin: options and fixtures of the suite. It costs nothing until a test class asks for the suite."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from arcor2_hw.testing.bench import Bench

pytest.register_assert_rewrite("arcor2_hw.testing.conformance", "arcor2_hw.testing.life")

PENDING = pytest.StashKey[list[str]]()
"""What the terminal summary has to tell of drivers that the suite does not cover yet."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    parser.getgroup("arcor2_hw", "ARCOR2-HW drivers").addoption(
        "--real-device",
        action="append",
        default=[],
        metavar="TYPE",
        help="run the conformance suite on the real device of this object type too; repeatable",
    )


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Name the drivers that are not covered."""
    if lines := config.stash.get(PENDING, []):
        terminalreporter.section("drivers without conformance", sep="-", yellow=True)
        for line in lines:
            terminalreporter.write_line(line)


@pytest.fixture(scope="class")
def arcor2_running_bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """Give the bench with its fake running, one for all cases of a class."""
    kind: type[Bench] = request.param
    if kind.real and kind.type_name() not in request.config.getoption("--real-device"):
        pytest.skip(f"the bench of {kind.type_name()} is a real device: name it by --real-device {kind.type_name()}")
    bench = kind()
    try:
        bench.start()
        yield bench
    finally:
        bench.end()


@pytest.fixture
def arcor2_bench(request: pytest.FixtureRequest, arcor2_running_bench: Bench) -> Iterator[Bench]:
    """Give the bench, reset, for one case that it has the hooks for; otherwise a written reason is asked for."""
    from arcor2_hw.exceptions import Arcor2Error
    from arcor2_hw.testing import quality

    bench = arcor2_running_bench
    case = request.function.__name__.removeprefix("test_")
    lacking = [hook for hook in getattr(request.function, "needs", ()) if not bench.has(hook)]
    try:
        reason = quality.read(bench.quality_file()).reason(bench.type_name(), case)
    except Arcor2Error as error:
        pytest.fail(str(error), pytrace=False)
    if lacking and reason is None:
        pytest.fail(
            f"the bench of {bench.type_name()} lacks {', '.join(lacking)}: implement it, or give the reason in "
            f"quality.yaml under not_run, as {case}",
            pytrace=False,
        )
    if lacking:
        pytest.skip(f"{bench.type_name()}: {reason}")
    if reason is not None:
        pytest.fail(f"quality.yaml says that {case} is not run, but the bench can run it", pytrace=False)
    try:
        bench.reset()
        yield bench
    finally:
        bench.release()
        bench.reset()
