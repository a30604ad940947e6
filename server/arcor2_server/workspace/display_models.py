"""Converts meshes and robot models for display, in the compute worker on first use, and caches them on disk.

A file is named by the hash of the asset and the version of the converter, so it never becomes outdated. It may be
deleted at any time.
"""

import asyncio
import contextlib
import gzip
import os
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import structlog

from arcor2_hw.collision.description import StoredFile
from arcor2_hw.compute.mesh_tasks import CONVERSION, PrepareAsset, PreparedAsset
from arcor2_hw.data.base import Unset
from arcor2_hw.data.editor import TaskKind
from arcor2_hw.exceptions import Arcor2Error, InvalidData, StorageError
from arcor2_hw.messages import Message
from arcor2_server.collaboration.tasks import Task, Tasks
from arcor2_server.compute.workers import Compute
from arcor2_server.files import replace_file
from arcor2_server.storage import AssetStore
from arcor2_server.storage.assets import Asset

log = structlog.get_logger(__name__)

SHOWN_AFTER: Final = 1.0
"""Time after which a conversion is shown as a task, s."""
MAX_SIZE: Final = 1024 * 1024 * 1024
"""Maximum size of the cache on disk, bytes. Beyond it, the least recently used files are deleted."""
MAX_REFUSALS: Final = 1000
_GZIP_LEVEL: Final = 6
_WORTH: Final = 0.9
"""A compressed copy is stored if it is smaller than this fraction of the original."""


@dataclass(frozen=True, slots=True)
class DisplayModel:
    """A converted asset: the file, and a compressed copy if it is much smaller. `etag` identifies the content."""

    etag: str
    plain: Path
    packed: Path | None


class DisplayModels:
    """The converted assets, for use in one event loop. `directory` is created when it is needed."""

    def __init__(self, assets: AssetStore, compute: Compute, tasks: Tasks, directory: Path) -> None:
        self._assets = assets
        self._compute = compute
        self._tasks = tasks
        self._directory = directory
        self._making: dict[str, asyncio.Task[DisplayModel]] = {}
        self._refusals: dict[tuple[str, str], Arcor2Error] = {}

    async def get(self, key: str) -> DisplayModel:
        """Return a converted asset. Concurrent callers share one conversion.

        Raises:
            NotFound: The asset does not exist.
            InvalidData: The asset is neither a mesh nor a robot model.
            StorageError: The result cannot be stored.
            ComputeStopped, ComputeTimeout, ComputeBusy, NotInstalled: The worker failed.
        """
        asset = self._assets.info(key)
        name = _named(asset)
        # The converter may need the extension to recognize the format.
        extension = Path(name).suffix.lower()
        name_on_disk = f"{asset.digest}.{CONVERSION}{extension if extension[1:].isalnum() else ''}"
        if (found := await asyncio.to_thread(self._find, name_on_disk)) is not None:
            return found
        if (refusal := self._refusals.get((name_on_disk, name))) is not None:
            raise refusal.with_traceback(None)
        making = self._making.get(name_on_disk)
        if making is None:
            making = asyncio.create_task(self._make(name_on_disk, key, name), name=f"preparing {key}")
            self._making[name_on_disk] = making
            making.add_done_callback(lambda done: self._made(name_on_disk, done))
        return await asyncio.shield(making)

    async def close(self) -> None:
        """Cancel the running conversions."""
        making = list(self._making.values())
        for each in making:
            each.cancel()
        await asyncio.gather(*making, return_exceptions=True)

    # ------------------------------------------------------------------------------------------------ internals
    def _made(self, name_on_disk: str, done: asyncio.Task[DisplayModel]) -> None:
        self._making.pop(name_on_disk, None)
        if not done.cancelled():
            done.exception()  # marks it as retrieved, since the callers may be gone

    async def _make(self, name_on_disk: str, key: str, name: str) -> DisplayModel:
        task = PrepareAsset(StoredFile(str(self._assets.file(key)), name))
        try:
            with _ShownTask(self._tasks, name) as on_progress:
                made = await self._compute.run(task, on_progress=on_progress)
        except InvalidData as error:
            if await asyncio.to_thread(Path(task.file.path).is_file):  # otherwise the asset was deleted in the meantime
                self._refusals[name_on_disk, name] = error
            while len(self._refusals) > MAX_REFUSALS:
                del self._refusals[next(iter(self._refusals))]
            raise
        log.info(
            "mesh prepared", asset=key, triangles=made.triangles, before=made.before, size=len(made.content),
            problems=made.problems,
        )  # fmt: skip
        try:
            return await asyncio.to_thread(self._store, name_on_disk, made)
        except OSError as error:
            text = "Converted models cannot be stored in {directory}: {reason}"
            raise StorageError(text, str(error), directory=self._directory, reason=error.strerror) from error

    def _find(self, name_on_disk: str) -> DisplayModel | None:
        plain, packed = self._directory / f"{name_on_disk}.glb", self._directory / f"{name_on_disk}.glb.gz"
        try:
            os.utime(plain)  # time of the last use
        except OSError:
            return None
        return DisplayModel(f'"{name_on_disk}"', plain, packed if packed.is_file() else None)

    def _store(self, name_on_disk: str, made: PreparedAsset) -> DisplayModel:
        self._directory.mkdir(parents=True, exist_ok=True)
        self._make_room(len(made.content))
        temporary = self._directory / f"half.{CONVERSION}"
        packed = gzip.compress(made.content, _GZIP_LEVEL, mtime=0)
        if len(packed) < _WORTH * len(made.content):
            replace_file(self._directory / f"{name_on_disk}.glb.gz", packed, durable=False, temporary=temporary)
        replace_file(self._directory / f"{name_on_disk}.glb", made.content, durable=False, temporary=temporary)
        found = self._find(name_on_disk)
        if found is None:
            raise FileNotFoundError(2, "the file was deleted in the meantime")
        return found

    def _make_room(self, needed: int) -> None:
        """Delete files of other converter versions, and the least recently used files if the cache is too large."""
        files = []
        for file in self._directory.iterdir():
            if file.name.split(".")[1:2] != [str(CONVERSION)]:
                file.unlink(missing_ok=True)
            elif file.suffix == ".glb":
                files.append((file.stat().st_mtime, file.stat().st_size, file))
        total = needed + sum(size for _, size, _ in files)
        for _, size, file in sorted(files):
            if total <= MAX_SIZE:
                break
            file.unlink(missing_ok=True)
            file.with_name(f"{file.name}.gz").unlink(missing_ok=True)
            total -= size


def _named(asset: Asset) -> str:
    """Return the file name of an asset, or else its id."""
    return asset.id if isinstance(asset.file_name, Unset) or not asset.file_name else asset.file_name


class _ShownTask(contextlib.AbstractContextManager[Callable[[float, str], None]]):
    """Shows a conversion as a task if it takes longer than `SHOWN_AFTER`."""

    def __init__(self, tasks: Tasks, name: str) -> None:
        self._tasks = tasks
        self._name = name
        self._task: Task | None = None
        self._last: tuple[float, str] = (0.0, "")
        self._timer = asyncio.get_running_loop().call_later(SHOWN_AFTER, self._begin)

    def _begin(self) -> None:
        self._task = self._tasks.begin(
            TaskKind.COMPUTATION, Message.of("Preparing {name} for the editor", name=self._name)
        )
        self._task.at(*self._last)

    def _at(self, share: float, message: str) -> None:
        self._last = (share, message)
        if self._task is not None:
            self._task.at(share, message)

    def __enter__(self) -> Callable[[float, str], None]:
        return self._at

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, _: object) -> None:
        self._timer.cancel()
        if self._task is None:
            return
        if error is None:
            self._task.finish()
        else:
            self._task.cancel()  # the callers receive the error
