"""The pool of cell hosts: one spare has its imports done, so that a start does not wait for Python."""

import asyncio
import contextlib
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Final

import structlog

from arcor2_hw.data.device import DEVICE_FILES
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.hosts.process import CellHost, HostUser

log = structlog.get_logger(__name__)

CLOSE_WITHIN: Final = 1.5
"""Seconds that the end of the server waits for a host that is just starting."""
READY_WITHIN: Final = 20.0
"""Seconds for the start of Python and the common imports on a machine that is busy."""


class CellHosts:
    """Hands out cell hosts. Call `prepare` when the taken host has started its devices and the processors are idle.

    device_files: the directories in which the settings of devices may name files.
    """

    def __init__(self, device_files: Sequence[Path]) -> None:
        self._environment = os.environ | {DEVICE_FILES: os.pathsep.join(map(str, device_files))}
        self._spare: asyncio.Task[CellHost] | None = None
        self._given: set[CellHost] = set()
        self._closed = False

    def prepare(self) -> None:
        """Begin to start the spare, unless there is one."""
        if self._spare is None and not self._closed:
            self._spare = asyncio.create_task(self._start(), name="spare cell host")
            self._spare.add_done_callback(_look)

    async def take(self, user: HostUser) -> CellHost:
        """Return a ready host, the spare one or a new one. Raise Arcor2Error if none can be started."""
        while True:
            self.prepare()
            if self._spare is None:
                raise Arcor2Error("The server is ending.")
            spare, self._spare = self._spare, None
            host = await spare
            if host.alive:
                break
            await host.gone()
        host.user = user
        self._given.add(host)
        host.ended.add_done_callback(lambda _: self._given.discard(host))
        return host

    async def close(self) -> None:
        """End all hosts."""
        self._closed = True
        hosts = set(self._given)
        spare, self._spare = self._spare, None
        if spare is not None:
            # One that is just starting is let finish, which is sooner over than a start cut off in the middle.
            await asyncio.wait({spare}, timeout=CLOSE_WITHIN)
            spare.cancel()
            with contextlib.suppress(Arcor2Error, asyncio.CancelledError):
                hosts.add(await spare)
        await asyncio.gather(*(host.close() for host in hosts))

    async def _start(self) -> CellHost:
        host = await CellHost.start(self._environment)
        try:
            async with asyncio.timeout(READY_WITHIN):
                await asyncio.shield(host.ready)
        except (TimeoutError, Arcor2Error) as error:
            host.kill()
            await host.gone()
            raise Arcor2Error("No cell host can be started.", str(error)) from error
        except BaseException:
            host.kill()
            await host.gone()
            raise
        return host


def _look(spare: "asyncio.Task[CellHost]") -> None:
    if not spare.cancelled() and (error := spare.exception()) is not None:
        log.error("no spare cell host", reason=str(error), detail=getattr(error, "detail", ""))
