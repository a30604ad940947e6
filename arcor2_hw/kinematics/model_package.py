"""Packages of robot models: a folder, a zip archive or a single URDF file. Sizes and paths are checked."""

import io
import posixpath
import zipfile
from collections.abc import Callable
from pathlib import Path
from typing import Final, Self
from urllib.parse import unquote

from arcor2_hw.kinematics.errors import MissingMesh, ModelError, UnsafeDescription

MAX_FILES: Final = 10_000
MAX_URDF: Final = 16 * 1024 * 1024
MAX_MESH: Final = 64 * 1024 * 1024
"""Maximum size of a mesh, bytes; the largest in packages of manufacturers have some 20 MB."""
MAX_PACKAGE: Final = 512 * 1024 * 1024
"""Maximum unpacked size of an archive, bytes."""
_CHUNK: Final = 1024 * 1024


class Package:
    """The files of one robot model, read when needed. Created by `open`.

    Attributes:
        name: Name of the folder or archive in messages.
        names: Relative paths with forward slashes.
    """

    def __init__(self, name: str, sizes: dict[str, int], read: Callable[[str, int], bytes]) -> None:
        self.name = name
        self.names = tuple(sorted(sizes))
        self._sizes = sizes
        self._read = read

    @classmethod
    def open(cls, source: Path | bytes, name: str = "") -> Self:
        """Open a folder, a zip archive or a URDF file, or the bytes of an archive or URDF file.

        Raises:
            ModelError: The source is none of these, or cannot be read.
            UnsafeDescription: The archive is too large, or has encrypted files or paths outside of it.
        """
        if isinstance(source, bytes):
            return cls._of_bytes(source, name or "upload")
        name = name or source.name
        try:
            if source.is_dir():
                return cls._of_folder(source, name)
            if not source.is_file():
                raise ModelError("Robot model {name} does not exist.", name=name)
            if source.stat().st_size > MAX_PACKAGE:
                raise UnsafeDescription(
                    "{name} is larger than {max_package} bytes.", name=name, max_package=MAX_PACKAGE
                )
            return cls._of_bytes(source.read_bytes(), name)
        except OSError as error:
            raise ModelError("{name} cannot be read: {reason}", str(error), name=name, reason=error.strerror) from error

    @classmethod
    def _of_folder(cls, folder: Path, name: str) -> Self:
        root = folder.resolve()
        sizes: dict[str, int] = {}
        for path in folder.rglob("*"):
            if not path.is_file():
                continue
            inner = path.relative_to(folder).as_posix()
            if not path.resolve().is_relative_to(root):
                raise UnsafeDescription(
                    "{name}: {inner} is a link to a file outside of the folder.", name=name, inner=inner
                )
            sizes[inner] = path.stat().st_size
            if len(sizes) > MAX_FILES:
                raise UnsafeDescription("{name} has more than {max_files} files.", name=name, max_files=MAX_FILES)

        def read(inner: str, limit: int) -> bytes:
            with (folder / inner).open("rb") as file:
                return file.read(limit + 1)

        return cls(name, sizes, read)

    @classmethod
    def _of_bytes(cls, content: bytes, name: str) -> Self:
        if not content.startswith(b"PK"):
            lone = name if name.endswith(".urdf") else "robot.urdf"
            return cls(name, {lone: len(content)}, lambda _, limit: content[: limit + 1])
        try:
            archive = zipfile.ZipFile(io.BytesIO(content))
        except (zipfile.BadZipFile, ValueError, NotImplementedError) as error:
            raise ModelError("{name} is not a zip archive.", str(error), name=name) from error
        sizes: dict[str, int] = {}
        for each in archive.infolist():
            if each.is_dir():
                continue
            if _outside(each.filename):
                raise UnsafeDescription(
                    "{name}: the file {filename!r} is outside of the archive.", name=name, filename=each.filename
                )
            if each.flag_bits & 1:
                raise UnsafeDescription(
                    "{name}: the file {filename!r} is encrypted.", name=name, filename=each.filename
                )
            sizes[posixpath.normpath(each.filename)] = each.file_size
        if len(sizes) > MAX_FILES:
            raise UnsafeDescription("{name} has more than {max_files} files.", name=name, max_files=MAX_FILES)
        if sum(sizes.values()) > MAX_PACKAGE:
            raise UnsafeDescription(
                "{name} is larger than {max_package} bytes when unpacked.", name=name, max_package=MAX_PACKAGE
            )
        entries = {posixpath.normpath(each.filename): each for each in archive.infolist()}

        def read(inner: str, limit: int) -> bytes:
            try:  # the sizes stated in an archive may be wrong
                with archive.open(entries[inner]) as file:
                    return file.read(limit + 1)
            except (zipfile.BadZipFile, NotImplementedError, EOFError, RuntimeError, ValueError, OSError) as error:
                raise ModelError("{name}: the file {inner} is damaged.", str(error), name=name, inner=inner) from error
            except Exception as error:
                if type(error).__name__ != "error":  # the error of zlib is not a public class
                    raise
                raise ModelError("{name}: the file {inner} is damaged.", str(error), name=name, inner=inner) from error

        return cls(name, sizes, read)

    def read(self, inner: str, limit: int) -> bytes:
        """Return the content of a file.

        Raises:
            UnsafeDescription: The file is larger than `limit` bytes.
            ModelError: The file is damaged.
        """
        if self._sizes[inner] <= limit:
            content = self._read(inner, limit)
            if len(content) <= limit:
                return content
        raise UnsafeDescription(
            "{name}: {inner} is larger than {limit} bytes.", name=self.name, inner=inner, limit=limit
        )

    def urdf(self) -> tuple[str, bytes]:
        """Return path and content of the URDF file.

        Raises:
            ModelError: The package contains no URDF file, or several.
            UnsafeDescription: The file is too large.
        """
        found = [name for name in self.names if name.lower().endswith(".urdf") and not name.startswith("__MACOSX/")]
        if len(found) > 1:  # the file nearest to the top, if there is only one at this level
            depth = min(name.count("/") for name in found)
            found = [name for name in found if name.count("/") == depth]
        if not found:
            raise ModelError("{name} has no URDF file.", name=self.name)
        if len(found) > 1:
            raise ModelError(
                "{name} has {count} URDF files: {found}. Exactly one is allowed.",
                name=self.name,
                count=len(found),
                found=", ".join(found),
            )
        return found[0], self.read(found[0], MAX_URDF)

    def locate(self, reference: str, beside: str) -> str:
        """Return the path of a file that a URDF refers to.

        `package://name/path`, `model://name/path`, `file:path` and relative paths are supported. Missing leading
        folders are tolerated.

        Args:
            reference: Reference in the URDF.
            beside: Path of the URDF.

        Raises:
            UnsafeDescription: The path is outside of the package, or has another scheme.
            MissingMesh: The file does not exist.
        """
        scheme, _, rest = reference.partition("://")
        if not rest:
            scheme, rest = "", reference.removeprefix("file:")
        if scheme not in ("", "package", "model"):
            raise UnsafeDescription(
                "{name}: {reference!r} is not a file of the package.", name=self.name, reference=reference
            )
        wanted = unquote(rest).replace("\\", "/")
        if _outside(wanted) and scheme:
            raise UnsafeDescription(
                "{name}: {reference!r} is outside of the package.", name=self.name, reference=reference
            )
        at = posixpath.normpath(wanted if scheme else posixpath.join(posixpath.dirname(beside), wanted))
        if _outside(at):
            raise UnsafeDescription(
                "{name}: {reference!r} is outside of the package.", name=self.name, reference=reference
            )
        parts = at.split("/")
        for first in range(len(parts)):
            tail = "/".join(parts[first:])
            if tail in self._sizes:
                return tail
            behind = [name for name in self.names if name.endswith(f"/{tail}")]
            if len(behind) == 1:
                return behind[0]
        raise MissingMesh("{name}: the mesh {reference} is missing.", name=self.name, reference=reference)


def _outside(path: str) -> bool:
    """Return whether a relative path leads outside, or is absolute or invalid."""
    normal = posixpath.normpath(path.replace("\\", "/"))
    return normal.startswith(("/", "../")) or normal == ".." or ":" in normal.split("/")[0] or "\0" in normal
