"""Fails a test that leaves a task, a thread, a process or a socket behind.

Resources of fixtures with a wider scope than one test may stay, and may start processes of their own meanwhile.
Everything else must be gone GRACE seconds after the test's own fixtures are torn down, at the latest.
"""

import asyncio
import contextlib
import gc
import inspect
import os
import threading
import time
from collections.abc import AsyncIterator, Generator, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import psutil
import pytest

GRACE = 20.0
"""Time for threads and children to end after a request to stop, s."""


@dataclass
class ProcessResources:
    """Resources of this process: threads by ident, children by pid and start time, sockets by inode."""

    threads: dict[int, str] = field(default_factory=dict)
    children: dict[tuple[int, float], str] = field(default_factory=dict)
    sockets: set[str] = field(default_factory=set)

    @classmethod
    def now(cls, *, again: bool = False) -> "ProcessResources":
        """Return the present resources. Check whether known children have ended only if `again`."""
        sockets = set()
        for fd in Path("/proc/self/fd").iterdir():
            try:
                target = str(fd.readlink())
            except OSError:
                continue
            if target.startswith("socket:"):
                sockets.add(target)
        if again or _descendants(os.getpid()) != {pid for pid, _ in _children}:
            _children.clear()
            _children.update(_running_children())
        return cls({t.ident or 0: t.name for t in threading.enumerate()}, dict(_children), sockets)

    def beyond(self, other: "ProcessResources") -> list[str]:
        """Return the names of the resources that are missing in `other`."""
        found = [f"thread {name}" for ident, name in self.threads.items() if ident not in other.threads]
        started = {pid for pid, _ in other.children} - forking
        for key, cmd in self.children.items():
            if key not in other.children and not started & _ancestors(key[0]):
                found.append(f"process {key[0]}: {cmd}")
        found += [f"socket {s}" for s in sorted(self.sockets - other.sockets)]
        return found

    def add(self, other: "ProcessResources") -> None:
        self.threads |= other.threads
        self.children |= other.children
        self.sockets |= other.sockets


_children: dict[tuple[int, float], str] = {}
"""Children of this process when they were last listed."""


def _running_children() -> dict[tuple[int, float], str]:
    """List all descendants. This reads every process of the machine, which takes 5 ms where there are 200."""
    found: dict[tuple[int, float], str] = {}
    for child in psutil.Process().children(recursive=True):
        try:
            if child.status() != psutil.STATUS_ZOMBIE:
                found[child.pid, child.create_time()] = " ".join(child.cmdline()[:4])
        except psutil.NoSuchProcess:
            continue
    return found


def _descendants(pid: int) -> set[int]:
    """Return the descendants that the kernel lists. It may omit some while others end."""
    found = set()
    with contextlib.suppress(OSError):  # it has ended
        for task in Path(f"/proc/{pid}/task").iterdir():
            with contextlib.suppress(OSError):
                found |= {int(child) for child in (task / "children").read_text().split()}
    return found.union(*map(_descendants, found))


def _ancestors(pid: int) -> set[int]:
    """Return the ancestors of a process. A forked child of a server names the server (`tests.forked_children`)."""
    try:
        process = psutil.Process(pid)
        parents = process.parents()
        servers = [each.name().partition("/")[2] for each in (process, *parents)]
    except psutil.NoSuchProcess:
        return set()
    return {each.pid for each in parents} | {int(server) for server in servers if server.isdigit()}


_before = pytest.StashKey[ProcessResources]()
_allowed = ProcessResources()
forking: set[int] = set()
"""Processes that fork programs for tests (`tests.forking`). They may stay, but not the programs that they start."""
_after: list[ProcessResources] = []
"""Resources of this process after the previous test."""


@pytest.hookimpl(wrapper=True)
def pytest_fixture_setup(fixturedef: Any) -> Generator[None, object, object]:
    """Allow the resources of fixtures with module, class, package or session scope."""
    if fixturedef.scope == "function":
        return (yield)
    with outliving_the_test():
        return (yield)


@contextlib.contextmanager
def outliving_the_test() -> Iterator[None]:
    """Allow resources created in this context to outlive the test: part of a wider fixture that is restarted."""
    before = ProcessResources.now()
    yield
    after = ProcessResources.now()
    _allowed.add(
        ProcessResources(
            {k: v for k, v in after.threads.items() if k not in before.threads},
            {k: v for k, v in after.children.items() if k not in before.children},
            after.sockets - before.sockets,
        )
    )


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_setup(item: pytest.Item) -> Generator[None, None, None]:
    item.stash[_before] = _after.pop() if _after else ProcessResources.now()
    yield


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_runtest_teardown(item: pytest.Item) -> Generator[None, None, None]:
    yield
    if _before not in item.stash:
        return
    allowed = item.stash[_before]
    allowed.add(_allowed)
    deadline = time.monotonic() + GRACE
    after = ProcessResources.now()
    leaked = after.beyond(allowed)
    while leaked and time.monotonic() < deadline:
        gc.collect()
        time.sleep(0.02)
        after = ProcessResources.now(again=True)
        leaked = after.beyond(allowed)
    _after[:] = [after]
    if leaked:
        pytest.fail("left behind: " + "; ".join(leaked), pytrace=False)


@pytest.fixture
async def no_leaked_tasks() -> AsyncIterator[None]:
    """Fail a test with remaining tasks.

    Set up before and torn down after all other fixtures of an asynchronous test.
    """
    before = asyncio.all_tasks()
    yield
    known = before | {asyncio.current_task()}
    leaked = asyncio.all_tasks() - known
    deadline = time.monotonic() + GRACE
    while leaked and time.monotonic() < deadline:
        await asyncio.sleep(0.01)
        leaked = asyncio.all_tasks() - known
    if leaked:
        for task in leaked:
            task.cancel()
        await asyncio.wait(leaked, timeout=1)
        pytest.fail("left behind: " + "; ".join(f"task {task.get_coro()}" for task in leaked), pytrace=False)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    for item in items:
        if inspect.iscoroutinefunction(getattr(item, "obj", None)):
            item.fixturenames.insert(0, "no_leaked_tasks")  # type: ignore[attr-defined]
