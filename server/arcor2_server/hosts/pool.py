"""The pool of cell hosts. One spare host is already started, so that going online does not wait for Python."""

import asyncio
import contextlib
import os
from collections.abc import Callable, Iterable, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Final

import structlog

from arcor2_hw.data.cell import BROKER_CREDENTIALS, BROKER_URL, Cell, node_of
from arcor2_hw.data.device import DEVICE_FILES
from arcor2_hw.data.scene import SceneObject
from arcor2_hw.exceptions import Arcor2Error, ConnectionLost, NotFound
from arcor2_hw.messages import Message
from arcor2_hw.runtime import messages as m
from arcor2_server.hosts.group import GroupUser, HostGroup
from arcor2_server.hosts.placement import Placement, place
from arcor2_server.hosts.process import CellHost, HostUser

log = structlog.get_logger(__name__)

CLOSE_TIMEOUT: Final = 1.5
"""Time limit for a host that is still starting when the server ends, s."""
READY_TIMEOUT: Final = 20.0
"""Time limit for the start of a host on a busy machine, s."""


class CellHosts:
    """Provides cell hosts. Call `prepare` when the taken host has connected its devices and the processor is idle.

    Args:
        device_files: directories of the files that settings of devices may name.
        cell: names the nodes of devices that are not on this computer.
        broker: file with the credentials of the server for the broker of nodes; it may be missing.
        derives: returns whether an object type derives from a base class.
    """

    def __init__(
        self,
        device_files: Sequence[Path],
        cell: Cell | None = None,
        broker: Path | None = None,
        derives: Callable[[str, str], bool] = lambda *_: False,
    ) -> None:
        self._cell, self._derives = cell, derives
        self._environment = os.environ | {DEVICE_FILES: os.pathsep.join(map(str, device_files))}
        if broker is not None:
            self._environment.setdefault(BROKER_CREDENTIALS, str(broker))
        self._spare: asyncio.Task[CellHost] | None = None
        self._taken: set[CellHost] = set()
        self._retiring: set[asyncio.Task[None]] = set()
        self._closed = False

    def prepare(self) -> None:
        """Start a spare host unless there is one."""
        if self._spare is None and not self._closed:
            self._spare = asyncio.create_task(self._start(), name="spare cell host")
            self._spare.add_done_callback(_log_failure)

    def node_of(self, scene_object: SceneObject) -> str:
        """Return the node that an object names; empty for this computer."""
        return node_of(self._cell, scene_object)

    def place(self, objects: Iterable[SceneObject], running: str | None = None) -> Placement:
        """Return the placement of the objects of a scene.

        Raise SeveralNodes if they cannot work together on these nodes.

        Args:
            objects: the objects.
            running: node on which the main host already runs.
        """

        def derives(name: str, base: str) -> bool:
            try:
                return self._derives(name, base)
            except NotFound:  # only the package contains this type; its host reports errors
                return False

        return place(self._cell, objects, derives, running)

    async def take_all(self, user: GroupUser, placement: Placement) -> HostGroup:
        """Return hosts for a scene or program, which are started together.

        Args:
            user: receives the messages of the hosts.
            placement: nodes of the objects.

        Raises:
            Arcor2Error: one of the hosts cannot be started. The others are closed.
        """
        if self._retiring:
            await asyncio.wait(self._retiring)  # they may still use the devices
        nodes = placement.all
        started = await asyncio.gather(*(self._take(node) for node in nodes), return_exceptions=True)
        hosts = [each for each in started if isinstance(each, CellHost)]
        for node, each in zip(nodes, started, strict=True):
            error = each if isinstance(each, BaseException) else None
            if isinstance(each, CellHost) and each.reason is not None:
                error = ConnectionLost(each.reason)
            if error is None:
                continue
            await asyncio.gather(*(host.close() for host in hosts))
            if isinstance(error, Arcor2Error) and len(nodes) > 1:
                text = "{reason} These objects run there: {names}."
                raise error.with_message(Message.of(text, reason=error.message, names=placement.on(node)))
            raise error
        return HostGroup(user, placement, hosts, self._retire)

    async def extend(self, group: HostGroup, node: str, opening: m.OpenScene) -> None:
        """Add a host to those of an online scene, unless one runs on this node.

        Args:
            group: the hosts of the scene.
            node: node of the new host.
            opening: the scene without objects on this node.

        Raises:
            Arcor2Error: the host cannot be started, or the scene went offline in the meantime.
        """
        if group.has(node):
            return
        host = await self._take(node)
        try:
            await group.join(host, opening)
        except BaseException:
            await host.close()
            raise

    def _retire(self, host: CellHost) -> None:
        """Close a host in the background, because another one of its group has ended."""
        task = asyncio.create_task(host.close(), name=f"end of cell host {host.pid}")
        self._retiring.add(task)
        task.add_done_callback(self._retiring.discard)

    async def take(self, user: HostUser, node: str = "") -> CellHost:
        """Return the spare host, or a new one. Raise Arcor2Error if no host can be started.

        Args:
            user: receives the messages of the host.
            node: node on which it runs; empty for this computer.
        """
        host = await self._take(node)
        host.user = user
        return host

    async def _take(self, node: str) -> CellHost:
        if node and find_spec("nats") is None:
            raise Arcor2Error("Devices on nodes need the extra `nodes` of arcor2-hw. Install it on the server.")
        host = await (self._start(node) if node else self._take_local())
        self._taken.add(host)
        host.ended.add_done_callback(lambda _: self._taken.discard(host))
        return host

    async def _take_local(self) -> CellHost:
        while True:
            new = self._spare is None
            self.prepare()
            if self._spare is None:
                raise Arcor2Error("The server is ending.")
            spare, self._spare = self._spare, None
            try:
                host = await spare
            except Arcor2Error:
                if new:
                    raise
                continue  # the spare host has failed, for example because it was killed while it was starting
            if host.alive:
                return host
            await host.wait_or_kill()

    async def renew(self) -> None:
        """Replace the spare host, which does not find packages that were installed after its start."""
        if self._spare is not None:
            hosts = await self._withdraw_spare()
            self.prepare()
            await asyncio.gather(*(host.close() for host in hosts))

    async def close(self) -> None:
        """Close all hosts."""
        self._closed = True
        hosts = self._taken | await self._withdraw_spare()
        await asyncio.gather(*(host.close() for host in hosts), *self._retiring)

    async def _withdraw_spare(self) -> set[CellHost]:
        """Return the spare host, which the caller closes; empty if there is none."""
        spare, self._spare = self._spare, None
        if spare is not None:
            # Completing a start takes less time than interrupting it.
            await asyncio.wait({spare}, timeout=CLOSE_TIMEOUT)
            spare.cancel()
            with contextlib.suppress(Arcor2Error, asyncio.CancelledError):
                return {await spare}
        return set()

    async def _start(self, node: str = "") -> CellHost:
        environment = dict(self._environment)
        if not node:
            for variable in (BROKER_URL, BROKER_CREDENTIALS):  # devices and programs must not inherit these
                environment.pop(variable, None)
        host = await CellHost.start(environment, node)
        try:
            async with asyncio.timeout(READY_TIMEOUT):
                await asyncio.shield(host.ready)
        except BaseException as error:
            host.kill()
            await host.wait_or_kill()
            if node and isinstance(error, Arcor2Error):
                raise
            if isinstance(error, TimeoutError | Arcor2Error):
                raise Arcor2Error("No cell host can be started.", str(error)) from error
            raise
        return host


def _log_failure(spare: "asyncio.Task[CellHost]") -> None:
    if not spare.cancelled() and (error := spare.exception()) is not None:
        log.error("spare cell host not started", reason=str(error), detail=getattr(error, "detail", ""))
