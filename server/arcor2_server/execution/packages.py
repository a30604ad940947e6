"""Uploads, renames and deletes packages, one of which may be running."""

import abc
import asyncio
from collections.abc import Awaitable, Callable
from typing import IO

from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.package import PackageSummary
from arcor2_server.events import EventHub, make_event
from arcor2_server.storage.packages import Packages


class PackageLibrary(abc.ABC):
    """Operations on stored packages. The running package may only be renamed."""

    def __init__(self, hub: EventHub, packages: Packages) -> None:
        self.packages = packages
        self.before_replacing: list[Callable[[str], Awaitable[None]]] = []
        """Called with the id of a package before it is deleted or replaced; may raise RequestRefused."""
        self._hub = hub

    @abc.abstractmethod
    def _require_not_used(self, package_id: str) -> None:
        """Raise RequestRefused if the package is running."""

    async def _require_replaceable(self, package_id: str) -> None:
        """Raise RequestRefused if the package is running or needed."""
        self._require_not_used(package_id)
        for check in self.before_replacing:
            await check(package_id)

    async def list(self) -> list[PackageSummary]:
        """Return all packages."""
        return await asyncio.to_thread(self.packages.all)

    async def upload(self, package_id: str, data: str) -> PackageSummary:
        """Store a package from a zip archive in Base64. It replaces a package with the same id."""
        await self._require_replaceable(package_id)
        return await asyncio.to_thread(self.packages.upload, package_id, data)

    async def take(self, package_id: str, content: IO[bytes]) -> PackageSummary:
        """Store a package from a zip archive. It replaces a package with the same id."""
        await self._require_replaceable(package_id)
        return await asyncio.to_thread(self.packages.put_zip, package_id, content)

    async def delete(self, package_id: str) -> PackageSummary:
        """Delete a package."""
        await self._require_replaceable(package_id)
        return await asyncio.to_thread(self.packages.delete, package_id)

    async def rename(self, package_id: str, name: str) -> PackageSummary:
        """Rename a package."""
        return await asyncio.to_thread(self.packages.rename, package_id, name)

    async def added(self, package_id: str) -> None:
        """Notify all clients of a new package, after the answer to the present request."""
        summary = await asyncio.to_thread(self.packages.summary, package_id)
        event = make_event("PackageChanged", summary, ChangeType.ADD)
        asyncio.get_running_loop().call_soon(self._hub.broadcast, event)
