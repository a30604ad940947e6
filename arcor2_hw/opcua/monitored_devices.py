"""The devices whose values clients monitor or read; other devices are not read."""

import asyncio
import contextlib
import time
from collections.abc import Callable, Iterable, Mapping
from typing import Final

from asyncua import ua

from arcor2_hw.opcua.devices import Device

LEASE: Final = 10.0
"""Time for which a device is read after a client has read or browsed it, s."""
FIRST_VALUES: Final = 2.0
"""Time limit for the first values of a device that was not read before, s. Then clients get the last ones."""


class MonitoredDevices:
    """The devices whose values clients monitor, or have read or browsed within LEASE.

    Args:
        devices: the devices in the address space, by id.
        watch: requests the values of these devices, and of no others.
    """

    def __init__(self, devices: Mapping[str, Device], watch: Callable[[list[str]], None]) -> None:
        self._devices, self._watch = devices, watch
        self._leases: dict[str, float] = {}
        """When leases end, by the ids of devices."""
        self._first: dict[str, tuple[asyncio.Event, float]] = {}
        """Whether the first values have arrived, and until when clients wait for them, by the nodes of devices."""
        self._wanted: set[str] | None = None

    def update(self) -> None:
        """Request the values of the devices that clients need now."""
        at = time.monotonic()
        self._leases = {key: end for key, end in self._leases.items() if end > at and key in self._devices}
        wanted = {key for key, device in self._devices.items() if key in self._leases or device.monitored}
        if wanted == self._wanted:
            return
        before, self._wanted = self._wanted or set(), wanted
        for key in wanted - before:
            for node in self._devices[key].nodes:
                self._first[str(node.Identifier)] = asyncio.Event(), at + FIRST_VALUES
        nodes = {str(node.Identifier) for key in wanted for node in self._devices[key].nodes}
        self._first = {node: first for node, first in self._first.items() if node in nodes}
        self._watch(sorted(wanted))

    def arrived(self, node: ua.NodeId) -> None:
        """Release clients that wait for the values below a node of a device."""
        if (first := self._first.get(str(node.Identifier))) is not None:
            first[0].set()

    async def need(self, nodes: Iterable[ua.NodeId]) -> None:
        """Wait until the values below nodes are current, or FIRST_VALUES have passed."""
        await self._need(filter(None, map(self._device_of, dict.fromkeys(nodes))))

    async def need_all(self) -> None:
        """Wait until the values of all devices are current, or FIRST_VALUES have passed."""
        await self._need((key, str(node.Identifier)) for key, device in self._devices.items() for node in device.nodes)

    async def _need(self, wanted: Iterable[tuple[str, str]]) -> None:
        found = {(key, node) for key, node in wanted if self._devices[key].connected}
        if not found:
            return
        end = time.monotonic() + LEASE
        self._leases |= {key: end for key, _ in found}
        self.update()
        for event, until in [self._first[node] for _, node in found if node in self._first]:
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(max(0.0, until - time.monotonic())):
                    await event.wait()

    def _device_of(self, node: ua.NodeId) -> tuple[str, str] | None:
        """Return the id of the device to which a node belongs, and its own node above it."""
        path = str(node.Identifier).split("/", 2)
        if len(path) < 2 or (device := self._devices.get(path[1])) is None or node.NamespaceIndex == 0:
            return None
        return next(
            ((path[1], top) for each in device.nodes if (top := str(each.Identifier)) == "/".join(path[:2])), None
        )
