"""Order tests and distribute them to workers."""

import gc
from typing import Any

import hypothesis
import pytest

gc.disable()  # until all tests are collected
pytest_plugins = ["pytester", "tests.leaks", "tests.postgresql"]


# On a busy machine any example may take long; times are measured in benchmarks.
hypothesis.settings.register_profile("tests", deadline=None)
hypothesis.settings.load_profile("tests")

WAITING = ("tests/drivers/", "tests/fakes/", "tests/objects/", "tests/runtime/", "tests/testing/", "tests/e2e/")
"""Directories whose tests mostly wait for simulated devices."""
LONG = (
    "tests/demo/",
    "tests/docs/",
    "tests/client/",
    "tests/compatibility/",
    "tests/calibration/",
    "tests/server/cli/",
)
"""Directories with long tests. The short ones come last, so that no worker is left with a long one."""
BROWSER = "tests/editor/"
"""The directory of browser tests. They need most of the processor time."""
CROWDED = (
    "tests/e2e/test_alarms.py",
    "tests/e2e/test_faults.py",
    "tests/e2e/test_held_motion.py",
)
"""Files whose tests start a dozen processes each. One worker runs all of them, so that no two run at the same time."""
INDEPENDENT = (
    "tests/docs/test_tutorials.py",
    "tests/server/cli/test_device_new.py",
    "tests/testing/first_day/test_first_day.py",
    "tests/testing/test_suite_finds_the_fault.py",
    "tests/testing/test_time_limit.py",
)
"""Files of long tests that share no fixture."""


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--matrix", action="store_true", help="run all combinations, as before a change is merged")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Deselect the tests of the matrix unless they are requested, and sort the others.

    The tests of a parallel run are sorted for a queue that is read from both ends, so that short tests run last.

    The queue begins with the crowded tests and those that wait for devices. It ends with long tests, followed by
    browser tests.
    """
    if not config.getoption("--matrix"):
        parts: tuple[list[pytest.Item], list[pytest.Item]] = [], []
        for each in items:
            parts[each.get_closest_marker("matrix") is not None].append(each)
        items[:], left_out = parts
        if left_out:
            config.hook.pytest_deselected(items=left_out)
    if hasattr(config, "workerinput"):
        items.sort(key=_order)


def _order(item: pytest.Item) -> int:
    if item.nodeid.startswith(CROWDED):
        return -1
    for order, places in ((0, WAITING), (2, LONG), (3, BROWSER)):
        if item.nodeid.startswith(places):
            return order
    return 1


def pytest_collection_finish() -> None:
    """Exclude modules and collected tests from garbage collection. Each full collection would visit 600,000 objects."""
    gc.freeze()
    gc.enable()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Run tests that share a fake in one worker: those of a module, or the conformance tests of one driver.

    The tests of the files in `INDEPENDENT` run in any worker.

    Half of the workers take from the end of the queue, where the browser tests are. So browsers use the processor while
    other tests wait for devices, and a worker starts its browser, server and fakes once. The scopes come from test ids
    because the marker xdist_group has no effect with pytest 9.2 and xdist 3.8.
    """
    if config.getvalue("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class FakeScheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file, _, rest = nodeid.partition("::")
            if file in INDEPENDENT:
                return nodeid
            if file in CROWDED:
                return "crowded"
            bench = rest.rpartition("[")[2] if rest.startswith("TestConformance::") else ""
            return f"{file}:{bench}"

        def _assign_work_unit(self, node: Any) -> None:
            from_end = int(node.gateway.id.removeprefix("gw")) % 2 == 1
            if from_end:
                self.workqueue.move_to_end(next(reversed(self.workqueue)), last=False)
            super()._assign_work_unit(node)

    return FakeScheduling(config, log)
