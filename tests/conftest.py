"""What all tests share."""

from typing import Any

import pytest

pytest_plugins = ["pytester", "tests.leaks"]


def pytest_addoption(parser: pytest.Parser) -> None:
    parser.addoption("--once-more", action="store_true", help="run what failed last time, with what it goes on from")


@pytest.hookimpl(trylast=True)
def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if config.getoption("once_more"):
        _keep_what_failed(config, items)
    elif hasattr(config, "workerinput"):
        items[:] = _spread(items)


TIMED = ("tests/drivers/", "tests/fakes/", "tests/objects/", "tests/runtime/", "tests/testing/", "tests/e2e/")
HEAVY = "tests/editor/"


def _spread(items: list[pytest.Item]) -> list[pytest.Item]:
    """Put first what keeps times of a tenth of a second; spread the browsers over the others, none of them last."""
    first = [each for each in items if each.nodeid.startswith(TIMED)]
    modules: dict[str, list[pytest.Item]] = {}
    others = []
    for each in items:
        if each.nodeid.startswith(HEAVY):
            modules.setdefault(each.nodeid.partition("::")[0], []).append(each)
        elif not each.nodeid.startswith(TIMED):
            others.append(each)
    spread: list[pytest.Item] = []
    done = 0
    for number, module in enumerate(modules.values()):
        until = len(others) * number // (len(modules) + 3)
        while 0 < until < len(others) and _scope(others[until].nodeid) == _scope(others[until - 1].nodeid):
            until += 1
        spread += others[done:until] + module
        done = until
    return first + spread + others[done:]


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
