"""Fork cell hosts, compute workers and relays of servers instead of starting them. Import this module in a server.

The children are forked from a process that has already imported their modules. Starting an interpreter and importing
takes most of the processor time of a short-lived child. Servers that tests start by the real command start real
children.
"""

import asyncio
import functools
import os
import subprocess
from collections.abc import Mapping, Sequence
from typing import Any, Final

import psutil

from arcor2_server import child_process
from tests.forking import Forker, awaited

ADDRESS: Final = "ARCOR2_HW_TEST_FORKING_PROCESS"
"""Environment variable of a forked server: the address of the process that forks its children."""
IMPORTS: Final = {
    "arcor2_hw.runtime.host": ("arcor2_hw.runtime.host", "numpy", "pinocchio", "coal"),
    "arcor2_hw.compute": ("arcor2_hw.compute.worker", "arcor2_hw.compute.kinematics_functions"),
    "arcor2_server.nodes.relay": ("arcor2_server.nodes.relay",),
    "arcor2_hw.opcua": ("arcor2_hw.opcua.process",),
}
"""Children that are forked, and the modules that they need."""
start_python: Final = child_process._start_python
"""Starts the real process."""


@functools.cache
def _forker() -> Forker:
    return Forker(os.environ.get(ADDRESS, ""))


def environment() -> dict[str, str]:
    """Return the environment variables of a forked server whose children are forked, too."""
    return {ADDRESS: _forker().address}


def children(pid: int, module: str) -> list[psutil.Process]:
    """Return the children of a server that run a module, the oldest first."""
    found = []
    for process in psutil.process_iter():
        try:
            started = process.ppid() == pid and module in process.cmdline()
            if started or process.name() == _name(pid, module):
                found.append(process)
        except psutil.NoSuchProcess:
            continue
    return sorted(found, key=psutil.Process.create_time)


def _name(pid: int, module: str) -> str:
    """Name a process, in at most 15 characters."""
    return f"{module.rpartition('.')[2]}/{pid}"


async def _fork(command: Sequence[str], inherited: Sequence[int], environment: Mapping[str, str]) -> Any:
    match command:
        case ["-P", "-m", module, *arguments] if module in IMPORTS:
            process = await asyncio.to_thread(
                _forker().start,
                *(module, arguments, IMPORTS[module], subprocess.STDOUT, environment, inherited),
                _name(os.getpid(), module),
            )
            return await awaited(process)
    return await start_python(command, inherited, environment)


child_process._start_python = _fork
