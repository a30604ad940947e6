"""Order tests and distribute them to workers."""

from typing import Any

import hypothesis
import pytest

pytest_plugins = ["pytester", "tests.leaks"]


# On a busy machine any example may take long; times are measured in benchmarks.
hypothesis.settings.register_profile("tests", deadline=None)
hypothesis.settings.load_profile("tests")

TIMED = ("tests/drivers/", "tests/fakes/", "tests/objects/", "tests/runtime/", "tests/testing/", "tests/e2e/")
HEAVY = "tests/editor/"


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Sort tests in a worker: those that wait for devices, then browser tests, then those that use the processor.

    Browser tests stay together because their browser, server and fakes run as long as a worker runs browser tests.
    """
    if hasattr(config, "workerinput"):
        items.sort(key=_order)


def _order(item: pytest.Item) -> int:
    return 0 if item.nodeid.startswith(TIMED) else 1 if item.nodeid.startswith(HEAVY) else 2


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Run tests that share a fake in one worker: those of a module, or the conformance tests of one driver.

    The scopes come from test ids because the marker xdist_group has no effect with pytest 9.2 and xdist 3.8.
    """
    if config.getvalue("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class FakeScheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file, _, rest = nodeid.partition("::")
            bench = rest.rpartition("[")[2] if rest.startswith("TestConformance::") else ""
            return f"{file}:{bench}"

    return FakeScheduling(config, log)
