"""Packages on disk, one directory each. Uploads are checked before they replace a package."""

import base64
import binascii
import hashlib
import re
import shutil
import stat
import tempfile
import zipfile
from collections.abc import Callable
from io import BytesIO
from pathlib import Path, PurePosixPath
from typing import IO, Any, Final

import msgspec
import structlog

from arcor2_hw.data.base import UNSET, Unset, now
from arcor2_hw.data.package import PackageMeta, PackageSummary, ProjectMeta
from arcor2_hw.data.project import BareProject, Project
from arcor2_hw.exceptions import InvalidPackage, NotFound, StorageError
from arcor2_hw.runtime.documents import decode_document
from arcor2_server.files import replace_file

log = structlog.get_logger(__name__)

MAX_FILES: Final = 10_000
"""Maximum number of files in an upload."""
MAX_SIZE: Final = 512 * 1024 * 1024
"""Maximum size of an unpacked upload, bytes. It is counted while unpacking, since a zip may state wrong sizes."""
MAX_UPLOAD: Final = 128 * 1024 * 1024
"""Maximum size of a zip that is sent as a file, bytes."""
_CHUNK: Final = 1 << 20
_ID: Final = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.-]{0,127}")
_TEMPORARY: Final = ".temporary-"
"""Prefix of the file that marks a temporary package; its content is the id of the project."""
_UNFINISHED: Final = (".new-", ".old-", ".pkg_")
"""Prefixes of directories that are being written or deleted."""
_TRANSIENT: Final = re.compile(r"traceback-[0-9T-]+\.txt|\.package\.json\.[0-9a-f]+")
"""Files that the server and runs write: tracebacks, and package.json while it is replaced."""
_NO_META: Final = PackageMeta("N/A", "1970-01-01T00:00:00+00:00")


class Packages:
    """The directory of packages. Methods access files, so call them in a thread. All may raise StorageError."""

    def __init__(self, root: Path, hide_secrets: Callable[[Path], bool] = lambda _: False) -> None:
        self._root = root
        self._hide_secrets = hide_secrets
        """Replaces secrets in the documents of a package by references."""

    def path_of(self, package_id: str) -> Path:
        """Return the path for a package id. Raise InvalidPackage for an invalid id."""
        if not _ID.fullmatch(package_id):
            raise InvalidPackage("{package_id!r} is not a valid package id.", package_id=package_id[:80])
        return self._root / package_id

    def directory(self, package_id: str) -> Path:
        """Return the directory of a package. Raise NotFound if there is none."""
        path = self.path_of(package_id)
        if not (path / "script.py").is_file():
            raise NotFound("Package {package_id} does not exist.", package_id=package_id)
        return path

    def all(self) -> list[PackageSummary]:
        """Return all packages, newest first."""
        if not self._root.is_dir():
            return []
        found = [
            self.summary(path.name)
            for path in self._root.iterdir()
            if _ID.fullmatch(path.name) and (path / "script.py").is_file()
        ]
        return sorted(found, key=lambda summary: summary.package_meta.built, reverse=True)

    def summary(self, package_id: str) -> PackageSummary:
        """Return one package. Raise NotFound if there is none."""
        path = self.directory(package_id)
        try:
            meta = msgspec.json.decode((path / "package.json").read_bytes(), type=PackageMeta)
        except (OSError, msgspec.MsgspecError):
            meta = _NO_META
        return PackageSummary(package_id, meta, _project_meta(path / "data" / "project.json"))

    def rename(self, package_id: str, name: str) -> PackageSummary:
        """Rename a package.

        Raises:
            NotFound: The package does not exist.
            InvalidPackage: The name is empty.
            StorageError: The package cannot be written.
        """
        if not name:
            raise InvalidPackage("A package needs a name.")
        self._set(package_id, name=name)
        return self.summary(package_id)

    def mark_executed(self, package_id: str) -> PackageSummary:
        """Store the present time as the last run of a package; return the package."""
        self._set(package_id, executed=now())
        return self.summary(package_id)

    def project_id(self, package_id: str) -> str:
        """Return the id of the project that a package was built from, empty if unknown."""
        project = _project_meta(self.directory(package_id) / "data" / "project.json")
        return "" if isinstance(project, Unset) else project.id

    def file_digests(self, package_id: str) -> dict[str, str]:
        """Return the SHA-256 of each file of a package by its path. Raise NotFound if there is no such package.

        Name and last run do not belong to the content of package.json. Tracebacks of runs are not part of the package.
        """
        directory = self.directory(package_id)
        found: dict[str, str] = {}
        try:
            for path in sorted(directory.rglob("*")):
                relative = path.relative_to(directory)
                if not path.is_file() or "__pycache__" in relative.parts or _TRANSIENT.fullmatch(str(relative)):
                    continue
                content = path.read_bytes()
                if str(relative) == "package.json":
                    content = _fixed_part(content)
                found[relative.as_posix()] = hashlib.sha256(content).hexdigest()
        except OSError as error:
            raise StorageError(
                "The package {package_id} cannot be read: {reason}.", package_id=package_id, reason=error.strerror
            ) from error
        return found

    def digest(self, package_id: str) -> str:
        """Return the SHA-256 of all files of a package. Raise NotFound if there is none."""
        listed = "".join(f"{digest}  {path}\n" for path, digest in self.file_digests(package_id).items())
        return hashlib.sha256(listed.encode()).hexdigest()

    def script(self, package_id: str) -> str:
        """Return the script of a package. Raise NotFound if there is none."""
        try:
            return (self.directory(package_id) / "script.py").read_text(errors="replace")
        except OSError as error:
            raise StorageError(
                "The package {package_id} cannot be read: {reason}.", package_id=package_id, reason=error.strerror
            ) from error

    def project(self, package_id: str) -> Project:
        """Return the project of a package. Raise NotFound if there is none, InvalidPackage if it cannot be read."""
        try:
            return decode_document((self.directory(package_id) / "data" / "project.json").read_bytes(), Project)
        except (OSError, msgspec.MsgspecError, RecursionError) as error:
            raise InvalidPackage(
                "The project of the package {package_id} cannot be read: {reason}.",
                package_id=package_id,
                reason=error,
            ) from error

    def _set(self, package_id: str, **values: str) -> None:
        path = self.directory(package_id) / "package.json"
        try:
            known: Any = msgspec.json.decode(path.read_bytes())
        except (OSError, msgspec.MsgspecError):
            known = None
        if not isinstance(known, dict):
            known = msgspec.to_builtins(_NO_META)
        try:
            replace_file(path, msgspec.json.format(msgspec.json.encode(known | values), indent=2), mode=0o666)
        except OSError as error:
            raise StorageError(
                "The package {package_id} cannot be written: {reason}.", package_id=package_id, reason=error.strerror
            ) from error

    def delete(self, package_id: str) -> PackageSummary:
        """Delete a package; return its summary. Raise NotFound if there is none."""
        summary = self.summary(package_id)
        self.delete_temporary(package_id)
        return summary

    def mark_temporary(self, package_id: str, project_id: str) -> None:
        """Mark a package that will be created for one run, so that `remove_leftovers` deletes it after a crash."""
        try:
            self._root.mkdir(parents=True, exist_ok=True)
            replace_file(self._marker(package_id), project_id.encode(), mode=0o666)
        except OSError as error:
            raise StorageError("Packages cannot be written: {reason}.", reason=error.strerror) from error

    def delete_temporary(self, package_id: str) -> None:
        """Delete a package, if it exists, and its mark."""
        try:
            if (path := self.path_of(package_id)).exists():
                self._discard(path)
            self._marker(package_id).unlink(missing_ok=True)
        except OSError as error:
            raise StorageError(
                "The package {package_id} cannot be deleted: {reason}.", package_id=package_id, reason=error.strerror
            ) from error

    def remove_leftovers(self) -> list[str]:
        """Delete the remains of a crash; return the ids of the projects that were running."""
        projects: list[str] = []
        try:
            for marker in sorted(self._root.glob(f"{_TEMPORARY}*")):
                projects.append(marker.read_text(errors="replace"))
                self.delete_temporary(marker.name.removeprefix(_TEMPORARY))
            for path in self._root.glob(".*"):
                if path.is_dir() and path.name.startswith(_UNFINISHED):
                    shutil.rmtree(path, ignore_errors=True)
        except OSError as error:
            raise StorageError("Packages cannot be read: {reason}.", reason=error.strerror) from error
        return projects

    def hide_secrets(self) -> int:
        """Replace secrets in all packages by references; return the number of changed packages."""
        try:
            return sum(self._hide_secrets(self.directory(summary.id)) for summary in self.all())
        except OSError as error:
            raise StorageError("Packages cannot be written: {reason}.", reason=error.strerror) from error

    def _marker(self, package_id: str) -> Path:
        return self._root / f"{_TEMPORARY}{package_id}"

    def to_zip(self, package_id: str) -> IO[bytes]:
        """Return a package as a zip, in a file that is deleted when it is closed. Raise NotFound if there is none."""
        directory = self.directory(package_id)
        file = tempfile.TemporaryFile()  # noqa: SIM115 - the caller reads it
        try:
            with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED, strict_timestamps=False) as archive:
                for path in sorted(directory.rglob("*")):
                    if path.is_file() and not path.is_symlink() and "__pycache__" not in path.parts:
                        archive.write(path, path.relative_to(directory))
            file.seek(0)
        except OSError as error:
            file.close()
            raise StorageError(
                "The package {package_id} cannot be read: {reason}.", package_id=package_id, reason=error.strerror
            ) from error
        return file

    def _discard(self, path: Path) -> None:
        """Delete a directory. It is renamed first, so that a crash leaves no incomplete package."""
        temporary = Path(tempfile.mkdtemp(prefix=".old-", dir=self._root))
        path.rename(temporary / path.name)
        shutil.rmtree(temporary, ignore_errors=True)

    def upload(self, package_id: str, data: str) -> PackageSummary:
        """Create or replace a package from a zip in base64. Raise InvalidPackage if it is invalid."""
        self.path_of(package_id)
        try:
            content = base64.b64decode(data, validate=True)
        except (binascii.Error, ValueError) as error:
            raise InvalidPackage("The package is not base64: {reason}.", reason=error) from error
        return self.put_zip(package_id, BytesIO(content))

    def put_zip(self, package_id: str, content: IO[bytes]) -> PackageSummary:
        """Create or replace a package from a zip. Raise InvalidPackage if it is invalid."""
        target = self.path_of(package_id)
        try:
            self._root.mkdir(parents=True, exist_ok=True)
            temporary = Path(tempfile.mkdtemp(prefix=".new-", dir=self._root))
        except OSError as error:
            raise StorageError("Packages cannot be written: {reason}.", reason=error.strerror) from error
        try:
            unpack(content, temporary)
            if not (temporary / "script.py").is_file():
                raise InvalidPackage("The package has no script.py.")
            self._hide_secrets(temporary)
            if target.exists():
                self._discard(target)
            temporary.rename(target)
        except OSError as error:
            raise StorageError("The package cannot be written: {reason}.", reason=error.strerror) from error
        finally:
            shutil.rmtree(temporary, ignore_errors=True)
        return self.summary(package_id)


def unpack(content: IO[bytes], directory: Path) -> None:
    """Unpack a zip into an empty directory. Raise InvalidPackage if it is damaged, unsafe or too large."""
    remaining = MAX_SIZE
    try:
        with zipfile.ZipFile(content) as archive:
            entries = archive.infolist()
            if len(entries) > MAX_FILES:
                raise InvalidPackage("The package has more than {max_files} files.", max_files=MAX_FILES)
            for entry in entries:
                target = directory / inside(entry)
                if entry.is_dir():
                    target.mkdir(parents=True, exist_ok=True)
                    continue
                target.parent.mkdir(parents=True, exist_ok=True)
                with archive.open(entry) as source, target.open("xb") as file:
                    while chunk := source.read(_CHUNK):
                        remaining -= len(chunk)
                        if remaining < 0:
                            raise InvalidPackage(
                                "The package is larger than {max_size} bytes when unpacked.", max_size=MAX_SIZE
                            )
                        file.write(chunk)
    except FileExistsError as error:
        raise InvalidPackage("The package contains a file twice.") from error
    except NotADirectoryError as error:
        raise InvalidPackage("The package contains a path below a file.") from error
    except (zipfile.BadZipFile, NotImplementedError, RuntimeError, EOFError, ValueError) as error:
        raise InvalidPackage("The package is not a valid zip file: {reason}.", reason=error) from error


def inside(entry: zipfile.ZipInfo) -> PurePosixPath:
    """Return the path of a file in a package. Raise InvalidPackage for a link, a device or a path outside of it."""
    name = entry.filename
    path = PurePosixPath(name)
    kind = stat.S_IFMT(entry.external_attr >> 16)
    if not path.parts or path.is_absolute() or ".." in path.parts or "\\" in name or ":" in path.parts[0]:
        raise InvalidPackage("The package contains a path that leads outside of it: {name!r}.", name=name[:80])
    if kind not in (0, stat.S_IFREG, stat.S_IFDIR):
        raise InvalidPackage("The package contains an entry that is not a file: {name!r}.", name=name[:80])
    return path


def _fixed_part(content: bytes) -> bytes:
    """Return the content of package.json without the fields that change while the package is used."""
    try:
        known: Any = msgspec.json.decode(content)
    except msgspec.MsgspecError:
        return content
    if isinstance(known, dict):
        known = {key: value for key, value in known.items() if key not in ("name", "executed")}
    return msgspec.json.encode(known, order="sorted")


def _project_meta(path: Path) -> ProjectMeta | Unset:
    try:
        project = decode_document(path.read_bytes(), BareProject)
    except OSError:
        return UNSET
    except (msgspec.MsgspecError, RecursionError):
        log.warning("package with a damaged project", file=str(path))
        return UNSET
    if isinstance(project.modified, Unset):
        return UNSET
    return ProjectMeta(project.id, project.name, project.description, project.modified)
