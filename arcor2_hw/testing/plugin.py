"""The pytest plugin: options and fixtures of the conformance suite. It only acts on test classes of the suite."""

from __future__ import annotations

import functools
import os
import random
import sys
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any, cast

import pytest

if TYPE_CHECKING:
    from arcor2_hw.testing.bench import Bench
    from arcor2_hw.testing.outcomes import Outcomes, Ran, Verdict
    from arcor2_hw.testing.quality import Quality

_REWRITTEN = ("acting_cases", "conformance", "connecting_cases", "life", "loss_cases", "steps", "written_cases")
pytest.register_assert_rewrite(*(f"arcor2_hw.testing.{each}" for each in _REWRITTEN))

OUTCOMES: pytest.StashKey[Outcomes] = pytest.StashKey()
STATUS: pytest.StashKey[int] = pytest.StashKey()
HANGING: list[Bench] = []
"""Benches on which a call did not return."""
RELEASE_TIMEOUT = 10.0
"""Time in which the objects of a case are disconnected, s."""
COLLECTED: pytest.StashKey[Mapping[str, frozenset[str]]] = pytest.StashKey()
"""Names of collected tests by path of their file."""


def pytest_addoption(parser: pytest.Parser) -> None:
    """Add the options."""
    group = parser.getgroup("arcor2_hw", "ARCOR2-HW drivers")
    group.addoption(
        "--device",
        action="append",
        default=[],
        metavar="FILE",
        help="run the conformance suite on every device of this cell.yaml, with `--pyargs arcor2_hw.testing`; "
        "repeatable",
    )
    group.addoption("--real", action="store_true", help="use real devices, but only those named by --real-device")
    group.addoption(
        "--real-device",
        action="append",
        default=[],
        metavar="NAME",
        help="with --real, run the conformance suite on this real device: its name in the cell.yaml, or the object "
        "type of its bench; repeatable",
    )
    group.addoption(
        "--report", metavar="FILE", help="write the results of the conformance suite, as evidence for level gold"
    )
    group.addoption(
        "--phases",
        type=int,
        metavar="SEED",
        help="repeat the random moments of an earlier run, which printed this seed",
    )


# ---------------------------------------------------------------------------------------------------- results
@pytest.hookimpl(tryfirst=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Record the collected tests before any is deselected."""
    found: dict[str, set[str]] = {}
    for item in items:
        found.setdefault(str(item.path), set()).add(getattr(item, "originalname", None) or item.name)
    config.stash[COLLECTED] = {path: frozenset(names) for path, names in found.items()}


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """With `--dist loadgroup`, run all cases of a bench in one process, because they share a fake or a device."""
    if config.getvalue("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadGroupScheduling  # type: ignore[import-untyped]

    from arcor2_hw.testing.conformance import Conformance
    from arcor2_hw.testing.outcomes import LEVEL_CASE

    cases = {f"test_{case}" for case in (*Conformance.cases(), LEVEL_CASE)}

    class OneProcessPerBench(LoadGroupScheduling):  # type: ignore[misc] # xdist has no type hints
        def _split_scope(self, nodeid: str) -> str:
            place, _, test = nodeid.rpartition("::")
            case, _, bench = test.partition("[")
            return f"{place}[{bench}" if bench and case in cases else str(super()._split_scope(nodeid))

    return OneProcessPerBench(config, log)


def _bench_of(item: pytest.Item) -> type[Bench] | None:
    callspec = getattr(item, "callspec", None)
    return callspec.params.get("arcor2_running_bench") if callspec is not None else None


@pytest.hookimpl(tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> None:
    """Store the bench and the case in the reports, also those of xdist processes."""
    from arcor2_hw.testing.outcomes import PROPERTY

    kind = _bench_of(item)
    if kind is not None:
        case = getattr(item, "originalname", item.name).removeprefix("test_")
        values = {"bench": kind.name(), "type": kind.type_name(), "real": kind.real, "case": case}
        item.user_properties.append((PROPERTY, values))


def _values(item: pytest.Item) -> dict[str, Any]:
    from arcor2_hw.testing.outcomes import PROPERTY

    values = next(value for key, value in item.user_properties if key == PROPERTY)
    assert isinstance(values, dict)
    return values


class _Recorder:
    """Record the reports of the suite, in the main process and in the processes that run the cases."""

    def __init__(self, config: pytest.Config) -> None:
        self._config = config

    def pytest_runtest_logreport(self, report: pytest.TestReport) -> None:
        """Record one report."""
        if any(key == "arcor2_case" for key, _ in report.user_properties):
            from arcor2_hw.testing.outcomes import Outcomes

            outcomes = self._config.stash.setdefault(OUTCOMES, Outcomes())
            text = _problem(report) if report.failed else ""
            outcomes.add(report.user_properties, report.passed, report.failed, report.when, text, report.duration)


def _problem(report: pytest.TestReport) -> str:
    crash = getattr(report.longrepr, "reprcrash", None)
    return str(report.longrepr if crash is None else crash.message).partition("\n")[0][:300]


def pytest_configure(config: pytest.Config) -> None:
    """Start recording."""
    config.pluginmanager.register(_Recorder(config), "arcor2_hw_outcomes")


def pytest_sessionfinish(session: pytest.Session, exitstatus: int) -> None:
    """Write the requested report. With xdist, only the main process has all results."""
    session.config.stash[STATUS] = int(exitstatus)
    file = session.config.getoption("--report")
    if file and not hasattr(session.config, "workerinput"):
        from arcor2_hw.testing import report
        from arcor2_hw.testing.outcomes import Outcomes

        report.write(Path(file), session.config.stash.get(OUTCOMES, Outcomes()))


def pytest_terminal_summary(terminalreporter: pytest.TerminalReporter, config: pytest.Config) -> None:
    """Print the level of each driver."""
    outcomes = config.stash.get(OUTCOMES, None)
    judged = {} if outcomes is None else {name: ran for name, ran in outcomes.items() if ran.reached is not None}
    if judged:
        terminalreporter.section("levels of the drivers", sep="-")
        for name, ran in sorted(judged.items()):
            terminalreporter.write_line(_line(name, ran))


def _line(name: str, ran: Ran) -> str:
    from arcor2_hw.testing.outcomes import Kind

    assert ran.reached is not None
    counts = ", ".join(f"{number} {kind}" for kind in Kind if (number := ran.count(kind)))
    missing = f"; next: {'; '.join(ran.missing[:3])}" + (" …" if len(ran.missing) > 3 else "") if ran.missing else ""
    return f"{name}: {ran.reached.name.lower()} (claimed {ran.claimed.name.lower()}), {counts}{missing}"


# ---------------------------------------------------------------------------------------------------- time limits
def _within(bench: Bench, limit: float, call: Callable[[], Any], what: str) -> Any:
    """Call with a time limit. If it does not return, fail with the name of the device, the call and its stack."""
    from arcor2_hw.testing.time_limit import CallHangs, within

    try:
        return within(limit, call, what)
    except CallHangs as error:
        hang = error
    bench.hanging = hang
    HANGING.append(bench)
    pytest.fail(f"{bench.name()}: {hang}\n\nStack of the call:\n{hang.stack}", pytrace=False)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_pyfunc_call(pyfuncitem: pytest.Function) -> Generator[None, object, object]:
    """Run a case of the suite with a time limit."""
    bench = cast("Bench | None", pyfuncitem.funcargs.get("arcor2_bench"))
    if bench is None:
        return (yield)
    case, name = pyfuncitem.obj, pyfuncitem.name
    limited = functools.partial(_limited, bench, case, f"the case {name.partition('[')[0].removeprefix('test_')}")
    pyfuncitem.obj = limited
    try:
        return (yield)
    finally:
        pyfuncitem.obj = case


def _limited(bench: Bench, case: Callable[..., None], what: str, **arguments: Any) -> None:
    _within(bench, bench.case_within, lambda: case(**arguments), what)


@pytest.hookimpl(trylast=True)
def pytest_unconfigure(config: pytest.Config) -> None:
    """End the process while a call hangs: Python would wait for a thread pool that the call uses."""
    hangs = any(bench.hanging is not None and not bench.hanging.returned(0.0) for bench in HANGING)
    if hangs and STATUS in config.stash and not hasattr(config, "workerinput"):
        sys.stdout.flush()
        sys.stderr.flush()
        os._exit(config.stash[STATUS])


# ---------------------------------------------------------------------------------------------------- fixtures
@pytest.fixture(scope="class")
def arcor2_running_bench(request: pytest.FixtureRequest) -> Iterator[Bench]:
    """Return the bench with its fake running, for all cases of a class."""
    kind: type[Bench] = request.param
    option = request.config.getoption
    if kind.real and not (option("--real") and kind.name() in option("--real-device")):
        pytest.skip(f"{kind.name()} is a real device. Use --real --real-device {kind.name()}.")
    bench = kind()
    try:
        _within(bench, bench.case_within, bench.start, "the start of the bench")
        yield bench
    finally:
        _within(bench, bench.case_within, bench.end, "the end of the bench")


@pytest.fixture(scope="class")
def arcor2_identity(request: pytest.FixtureRequest, arcor2_running_bench: Bench) -> dict[str, str]:
    """Return the identity of the device, read once when a report is written."""
    from arcor2_hw.exceptions import Arcor2Error

    bench = arcor2_running_bench
    if not request.config.getoption("--report"):
        return {}
    try:
        who = _within(bench, bench.case_within, lambda: bench.connected().identify(), "reading the identity")
    except Arcor2Error:
        return {}
    finally:
        _within(bench, RELEASE_TIMEOUT, bench.release, "disconnecting after reading the identity")
    return {"vendor": who.vendor, "model": who.model, "serial": who.serial, "firmware": who.firmware}


@pytest.fixture
def arcor2_bench(
    request: pytest.FixtureRequest, arcor2_running_bench: Bench, arcor2_identity: dict[str, str]
) -> Iterator[Bench]:
    """Return the bench after a reset. Skip or fail a case for which it lacks hooks."""
    bench = arcor2_running_bench
    values = _values(request.node)
    values |= {"address": bench.address, "identity": arcor2_identity, "folder": str(bench.quality_file().parent)}
    case = values["case"]
    if bench.hanging is not None and not bench.hanging.returned(RELEASE_TIMEOUT):
        pytest.fail(f"{bench.name()}: {case} was not run, because of a call that hangs: {bench.hanging}", pytrace=False)
    _check_hooks(request, bench, values)
    try:
        _within(bench, bench.case_within, bench.reset, f"the reset before the case {case}")
        yield bench
    finally:
        try:
            _within(bench, RELEASE_TIMEOUT, bench.release, f"disconnecting after the case {case}")
        finally:
            _within(bench, bench.case_within, bench.reset, f"the reset after the case {case}")


def _check_hooks(request: pytest.FixtureRequest, bench: Bench, values: dict[str, Any]) -> None:
    """Skip or fail a case for which the bench lacks hooks, or that quality.yaml excludes."""
    from arcor2_hw.testing.bench import obstacle
    from arcor2_hw.testing.outcomes import Kind

    found = obstacle(bench, request.function, values["case"])
    if found is None:
        return
    kind, why = found
    if kind is Kind.FAILED:
        pytest.fail(why, pytrace=False)
    values.update(kind=kind.value, reason=why)
    pytest.skip(f"{bench.name()}: {why}")


def _claims(bench: Bench) -> Quality:
    from arcor2_hw.testing import quality

    return quality.read(bench.quality_file())


@pytest.fixture
def arcor2_phases(request: pytest.FixtureRequest) -> random.Random:
    """Return the random numbers of a case. Their seed is printed."""
    seed = request.config.getoption("--phases")
    seed = random.SystemRandom().randrange(1 << 32) if seed is None else seed
    print(f"To repeat the moments of this case, use --phases {seed}")  # noqa: T201 - pytest shows it on failure
    return random.Random(seed)


@pytest.fixture
def arcor2_verdict(request: pytest.FixtureRequest, arcor2_running_bench: Bench) -> Verdict:
    """Return the level that the cases of the bench show, if all of them ran in this process."""
    from arcor2_hw.exceptions import Arcor2Error
    from arcor2_hw.testing import outcomes, report, rules
    from arcor2_hw.testing.quality import Level

    bench, config = arcor2_running_bench, request.config
    if bench.guessed:
        return outcomes.Verdict(not_judged="a bench created from settings alone cannot judge a level")
    ran = config.stash.get(OUTCOMES, outcomes.Outcomes()).get(bench.name())
    there = {} if ran is None else ran.outcomes
    if lacking := request.cls.cases() - set(there):
        return outcomes.Verdict(not_judged=f"{len(lacking)} cases did not run in this process")
    try:
        claims = _claims(bench)
    except Arcor2Error as error:
        return outcomes.Verdict(Level.BRONZE, Level.NONE, [str(error)])
    folder = bench.quality_file().parent
    passed = {case: kind is outcomes.Kind.PASSED for case, (kind, _) in there.items()}
    tests = rules.missing_tests(
        claims.named_tests(), _test_folders(config, claims), folder.name, config.stash.get(COLLECTED, {}), passed
    )
    lacks = report.unmatched(folder, claims, bench.type_name(), there)
    reached, missing = outcomes.judge(there, tests, lacks)
    if not bench.independent:
        reached = min(reached, Level.BRONZE)
        missing = ["the fake is written from the same source as the driver", *missing]
    _values(request.node).update(claimed=int(claims.claimed), reached=int(reached), missing=missing)
    return outcomes.Verdict(claims.claimed, reached, missing)


def _test_folders(config: pytest.Config, claims: Quality) -> Sequence[Path]:
    named = [claims.tests] if isinstance(claims.tests, str) else config.getini("testpaths")
    return [config.rootpath / each for each in named] or [config.invocation_params.dir]


# Names before version 0.2.
RELEASE_WITHIN = RELEASE_TIMEOUT
