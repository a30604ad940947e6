"""Stored results of an analysis, so that the next process with the same sources need not parse them."""

import hashlib
import sys
from pathlib import Path
from typing import Final

import msgspec
from msgspec.structs import asdict

from arcor2_hw.analysis.library import BUILT_IN, Library
from arcor2_hw.analysis.source import SourceFile, Stamp, stamp_of
from arcor2_hw.analysis.type_analysis import TypeAnalysis
from arcor2_hw.data.base import Data

_LIBRARY: Final = Path(__file__).resolve().parents[1]
_CODE: Final = ("analysis", "data", "actions")
"""Packages of the library on which a result depends in addition to the sources."""


class StoredSource(Data, frozen=True, array_like=True):
    """A SourceFile with separate fields for text and bytes, which a decoder could not distinguish."""

    name: str
    module: str
    path: str
    is_package: bool
    text: str | None
    content: bytes
    modules: "tuple[StoredSource, ...]" = ()

    @classmethod
    def of(cls, file: SourceFile) -> "StoredSource":
        """Return the stored form of a file."""
        text, content = (file.source, b"") if isinstance(file.source, str) else (None, file.source)
        modules = tuple(map(cls.of, file.modules))
        return cls(file.name, file.module, file.path, file.is_package, text, content, modules)

    def file(self) -> SourceFile:
        """Return the original file."""
        source = self.content if self.text is None else self.text
        modules = tuple(each.file() for each in self.modules)
        return SourceFile(self.name, self.module, source, self.path, self.is_package, modules)


class StoredAnalysis(TypeAnalysis, frozen=True):
    """A TypeAnalysis whose modules are indices into the sources of its snapshot, since several types share some."""

    modules: tuple[int, ...] = ()  # type: ignore[assignment]


class Snapshot(Data, frozen=True):
    """The analyses of all types of a library, and their inputs.

    Attributes:
        inputs: Digest of the added sources and of the code of the analysis.
        stamps: Every file that was looked for on the disk, with its stamp; None for a missing one.
        analyses: Results by type name.
        sources: The modules that the types need.
    """

    inputs: str
    stamps: dict[str, Stamp | None]
    analyses: dict[str, StoredAnalysis]
    sources: tuple[StoredSource, ...]


_encode = msgspec.msgpack.Encoder().encode


def take(library: Library) -> bytes:
    """Return the analyses of all types of a library, encoded for `restore`."""
    indices: dict[SourceFile, int] = {}
    analyses = {}
    for name in library.names():
        analysis = library.analyse(name)
        modules = tuple(indices.setdefault(file, len(indices)) for file in analysis.modules)
        analyses[name] = StoredAnalysis(**asdict(analysis) | {"modules": modules})
    stored = tuple(StoredSource.of(file) for file in indices)
    return _encode(Snapshot(_digest(library), library.stamps, analyses, stored))


def restore(library: Library, encoded: bytes) -> bool:
    """Add the stored analyses to a library with the same sources.

    Returns:
        False, with the library unchanged, if anything differs: a source, a file that was read or missing, our own code,
        the Python version, or if `encoded` is damaged.
    """
    try:
        snapshot = msgspec.msgpack.decode(encoded, type=Snapshot)
    except msgspec.MsgspecError:
        return False
    if snapshot.inputs != _digest(library):
        return False
    if any(stamp_of(Path(path)) != stamp for path, stamp in snapshot.stamps.items()):
        return False
    files = [stored.file() for stored in snapshot.sources]
    analyses = {
        name: TypeAnalysis(**asdict(stored) | {"modules": tuple(files[index] for index in stored.modules)})
        for name, stored in snapshot.analyses.items()
    }
    library.put_analyses(analyses, snapshot.stamps)
    return True


def code_digest(*packages: Path) -> str:
    """Return a digest of the sources in these folders, by their stamps, and of the Python version."""
    digest = hashlib.sha256(repr(sys.version_info).encode())
    for package in packages:
        for file in sorted(package.rglob("*.py")):
            digest.update(repr((str(file), stamp_of(file))).encode())
    return digest.hexdigest()


def _digest(library: Library) -> str:
    digest = hashlib.sha256(code_digest(*(_LIBRARY / package for package in _CODE)).encode())
    # Sorted: two processes may add the same sources in a different order.
    for name in sorted(library.names()):
        if name not in BUILT_IN:
            digest.update(_encode(StoredSource.of(library.file(name))))
    return digest.hexdigest()
