"""Order tests and distribute them to workers."""

from typing import Any

import hypothesis
import pytest

pytest_plugins = ["pytester", "tests.leaks"]


# On a busy machine any example may take long; times are measured in benchmarks.
hypothesis.settings.register_profile("tests", deadline=None)
hypothesis.settings.load_profile("tests")

WAITING = ("tests/drivers/", "tests/fakes/", "tests/objects/", "tests/runtime/", "tests/testing/", "tests/e2e/")
"""Directories whose tests mostly wait for simulated devices."""
BROWSER = "tests/editor/"
"""The directory of browser tests. They need most of the processor time."""


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Sort the tests of a parallel run: first those that wait for devices, at the end browser tests."""
    if hasattr(config, "workerinput"):
        items.sort(key=_order)


def _order(item: pytest.Item) -> int:
    return 0 if item.nodeid.startswith(WAITING) else 2 if item.nodeid.startswith(BROWSER) else 1


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Run tests that share a fake in one worker: those of a module, or the conformance tests of one driver.

    Half of the workers start with the browser tests, at the end of the queue. So browsers use the processor while
    other tests wait for devices, and a worker starts its browser, server and fakes once. The scopes come from test ids
    because the marker xdist_group has no effect with pytest 9.2 and xdist 3.8.
    """
    if config.getvalue("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class FakeScheduling(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            file, _, rest = nodeid.partition("::")
            bench = rest.rpartition("[")[2] if rest.startswith("TestConformance::") else ""
            return f"{file}:{bench}"

        def _assign_work_unit(self, node: Any) -> None:
            from_end = int(node.gateway.id.removeprefix("gw")) % 2 == 1
            if from_end:
                self.workqueue.move_to_end(next(reversed(self.workqueue)), last=False)
            super()._assign_work_unit(node)

    return FakeScheduling(config, log)
