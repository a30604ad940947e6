"""Files of messages travel by the hash of their content, so that each is sent to a node only once.

A message names a file of its sender's computer. The relay replaces the name by a reference, `sha256:HASH:NAME`, and a
directory by a reference to the list of its files. The node replaces references by names of its own files.
"""

import hashlib
import os
import shutil
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any, Final

import msgspec
import structlog
from msgspec.structs import replace

from arcor2_hw.exceptions import InvalidData, NotFound
from arcor2_hw.runtime import messages as m
from arcor2_server.files import replace_file

log = structlog.get_logger(__name__)

WITH_FILES: Final = frozenset({"AddBody", "AddObject", "OpenScene", "RunPackage"})
"""Messages that name files."""
HASH_SIZE: Final = 32
"""Length of a hash, bytes."""
MAX_STORE_SIZE: Final = 4 * 1024**3
"""Size above which files are removed from the store of a node, bytes; on a small disk a quarter of it."""
KEEP_TIME: Final = 600.0
"""Time for which a file is kept after its last use, s: messages on their way may need it, also those of other nodes."""
PRUNE_PERIOD: Final = 60.0
"""Time between two searches for files that can be removed, s."""
_SCHEME: Final = "sha256:"


class Content:
    """The files that a message needs, by the hexadecimal hash of their content."""

    def __init__(self) -> None:
        self._sources: dict[str, Path | bytes] = {}

    @property
    def hashes(self) -> list[str]:
        """Return the hashes of all files."""
        return list(self._sources)

    def read(self, digest: str) -> bytes:
        """Return a file. Raise OSError if it cannot be read."""
        source = self._sources[digest]
        return source if isinstance(source, bytes) else source.read_bytes()

    def packed(self, body: bytes) -> bytes:
        """Replace the files of a message by references.

        Raises:
            NotFound: a file does not exist.
        """
        message = m.decode_host_bound(body)
        if isinstance(message, m.RunPackage):
            message = replace(
                message,
                directory=self._add_directory(message.directory),
                records="",
                recordings="",  # the relay stores it
                records_at_server=bool(message.records),
            )
        return msgspec.msgpack.encode(_with_file_names(message, self._add_named))

    def _add_named(self, name: str) -> str:
        return f"{_SCHEME}{self._add(Path(name))}:{Path(name).name}"

    def _add(self, source: Path | bytes) -> str:
        try:
            content = source if isinstance(source, bytes) else source.read_bytes()
        except OSError as error:
            raise NotFound("{file} cannot be read: {reason}", file=source, reason=error.strerror) from error
        digest = hashlib.sha256(content).hexdigest()
        self._sources[digest] = source
        return digest

    def _add_directory(self, name: str) -> str:
        top = Path(name)
        files = sorted(path for path in top.rglob("*") if path.is_file() and "__pycache__" not in path.parts)
        listed = {path.relative_to(top).as_posix(): self._add(path) for path in files}
        return f"{_SCHEME}{self._add(msgspec.json.encode(listed))}:{top.name}"


class ContentStore:
    """The files that a node has received. Those that were not used for the longest time are removed.

    Sessions use copies of the files, so a file that is removed does not concern a session that has started.

    Args:
        directory: is created when it is needed.
        limit: size above which files are removed, bytes.
    """

    def __init__(self, directory: Path, limit: int = MAX_STORE_SIZE) -> None:
        self.directory, self._limit = directory, limit
        self._size: int | None = None
        """Size of all files, bytes; None until they were listed."""
        self._pruned_at = -PRUNE_PERIOD

    def missing(self, hashes: list[str]) -> list[str]:
        """Return the hashes of files that the store does not have. The others are kept for `KEEP_TIME` at least."""
        return [digest for digest in hashes if not self._mark_used(self._file(digest))]

    def _mark_used(self, file: Path) -> bool:
        """Note that a file is used; return whether it exists."""
        try:
            os.utime(file)
        except FileNotFoundError:
            return False
        return True

    def prune(self) -> None:
        """Remove the files that were not used for the longest time while the store is too large."""
        self._pruned_at = time.monotonic()
        try:
            self._prune()
        except FileNotFoundError:
            return  # there is no store yet, or another node removes files; the next file repeats it
        except OSError as error:
            log.warning("received files not removed", directory=str(self.directory), reason=str(error))

    def _prune(self) -> None:
        limit = min(self._limit, shutil.disk_usage(self.directory).total // 4)
        with os.scandir(self.directory) as entries:
            files = sorted((status.st_mtime, status.st_size, each.path) for each in entries if (status := each.stat()))
        self._size = sum(size for _, size, _ in files)
        for used, size, path in files:
            if self._size <= limit or time.time() - used < KEEP_TIME:
                return
            Path(path).unlink(missing_ok=True)
            self._size -= size

    def add(self, received: bytes) -> None:
        """Store a file that follows its hash.

        Raises:
            InvalidData: the content does not have this hash.
            OSError: the file cannot be written.
        """
        digest, content = received[:HASH_SIZE], received[HASH_SIZE:]
        if hashlib.sha256(content).digest() != digest:
            raise InvalidData("A file was damaged on its way.")
        self.directory.mkdir(mode=0o700, parents=True, exist_ok=True)
        replace_file(self._file(digest.hex()), content, durable=False)
        if self._size is not None:
            self._size += len(content)
        if self._size is None or (self._size > self._limit and time.monotonic() - self._pruned_at > PRUNE_PERIOD):
            self.prune()

    def unpacked(self, body: bytes, folder: Path) -> bytes:
        """Replace the references of a message by names of files.

        Args:
            body: the encoded message.
            folder: for the files; it is removed at the end of the session.

        Raises:
            NotFound: the store does not have a file.
            InvalidData: a reference is invalid.
        """
        message = m.decode_host_bound(body)
        if isinstance(message, m.RunPackage):
            message = replace(message, directory=str(self._directory_of(message.directory, folder)))
        return msgspec.msgpack.encode(_with_file_names(message, lambda reference: str(self._named(reference, folder))))

    def _named(self, reference: str, folder: Path) -> Path:
        digest, name = _parts(reference)
        return self._copy(digest, folder / digest / name)

    def _directory_of(self, reference: str, folder: Path) -> Path:
        digest, name = _parts(reference)
        try:
            listed = msgspec.json.decode(self._file(digest).read_bytes(), type=dict[str, str])
        except (OSError, msgspec.MsgspecError) as error:
            raise NotFound("The list of the files of a package is missing.", str(error)) from error
        top = Path(tempfile.mkdtemp(dir=folder)) / name
        for path, content in listed.items():
            if Path(path).is_absolute() or ".." in Path(path).parts:
                raise InvalidData("{path} is not a path in a package.", path=path)
            self._copy(content, top / path)
        return top

    def _copy(self, digest: str, target: Path) -> Path:
        """Copy a file, because whoever uses it may change it."""
        source = self._file(digest)
        if not target.exists():
            try:
                target.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
                shutil.copyfile(source, target)
            except OSError as error:
                raise NotFound("{file} cannot be copied: {reason}", file=target.name, reason=error.strerror) from error
        return target

    def _file(self, digest: str) -> Path:
        if len(digest) != 2 * HASH_SIZE or not set(digest) <= set("0123456789abcdef"):
            raise InvalidData("{digest!r} is not a hash.", digest=digest)
        return self.directory / digest


def default_store() -> Path:
    """Return the directory of the files that a node has received."""
    cache = os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache"
    return Path(cache) / "arcor2-hw" / "node-files"


def _parts(reference: str) -> tuple[str, str]:
    """Return hash and name of a reference. Raise InvalidData if it is invalid."""
    digest, separator, name = reference.removeprefix(_SCHEME).partition(":")
    if not reference.startswith(_SCHEME) or not separator or Path(name).name != name:
        raise InvalidData("{reference!r} is not a reference to a file.", reference=reference)
    return digest, name


def _with_file_names(message: Any, convert: Callable[[str], str]) -> Any:
    """Return a message with other names of its files."""

    def body(given: m.AddedBody) -> m.AddedBody:
        return replace(given, file=convert(given.file)) if given.file else given

    match message:
        case m.AddBody():
            return replace(message, body=body(message.body))
        case m.AddObject():
            return replace(message, opening=_with_file_names(message.opening, convert))
        case m.OpenScene() | m.RunPackage():
            assets = {key: convert(file) for key, file in message.assets.items()}
            return replace(message, assets=assets, bodies=[body(each) for each in message.bodies])
    return message
