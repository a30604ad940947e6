"""What all tests share."""

from typing import Any

import pytest

# The clock comes before the check for leaks: its thread lives as long as the process.
pytest_plugins = ["pytester", "tests.own_time", "tests.leaks"]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--once-more", action="store_true", help="run what failed last time, with what it goes on from")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("once_more"):
        _keep_what_failed(config, items)
    elif hasattr(config, "workerinput"):
        items[:] = _in_order(items)


TIMED = ("tests/drivers/", "tests/fakes/", "tests/objects/", "tests/runtime/", "tests/testing/", "tests/e2e/")
HEAVY = "tests/editor/"


def _in_order(items: list[pytest.Item]) -> list[pytest.Item]:
    """Put tests that depend on tenths of a second first, then the browser tests, so that none of these comes last.

    The browser tests stay together: their browser, server and fakes run as long as a worker runs browser tests.
    """

    def place(item: pytest.Item) -> int:
        return 0 if item.nodeid.startswith(TIMED) else 1 if item.nodeid.startswith(HEAVY) else 2

    return sorted(items, key=place)


def _scope(nodeid: str) -> str:
    """What shares a fake."""
    file, _, rest = nodeid.partition("::")
    bench = rest.rpartition("[")[2] if rest.startswith("TestConformance::") else ""
    return f"{file}:{bench}"


def _keep_what_failed(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Keep what failed last time; where the tests of a module go on from each other, those before it, too."""
    assert config.cache is not None
    failed = set(config.cache.get("cache/lastfailed", {}))
    last = {each.path: place for place, each in enumerate(items) if each.nodeid in failed}
    kept = [
        each
        for place, each in enumerate(items)
        if each.nodeid in failed or (_goes_on(each) and place < last.get(each.path, 0))
    ]
    config.hook.pytest_deselected(items=[each for each in items if each not in kept])
    items[:] = kept


def _goes_on(item: pytest.Item) -> bool:
    mark = item.get_closest_marker("asyncio")
    return mark is not None and mark.kwargs.get("loop_scope") == "module"


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: Any) -> Any:
    """Keep in one process what shares a fake: a module, or the suite's cases on one bench.

    By the ids of the tests: the marker xdist_group has no effect with pytest 9.2 and xdist 3.8.
    """
    if config.getvalue("dist") != "loadgroup":
        return None
    from xdist.scheduler import LoadScopeScheduling

    class TogetherOnOneFake(LoadScopeScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return _scope(nodeid)

    return TogetherOnOneFake(config, log)
