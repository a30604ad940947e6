"""The Build service over REST: builds and imports packages (protocol, section 11)."""

import asyncio
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import IO

from arcor2_hw.data.base import Data
from arcor2_hw.data.role import Role
from arcor2_hw.messages import translatable
from arcor2_server.build.importing import ImportedIds, ImportOptions, PackageImport
from arcor2_server.build.service import BuildService
from arcor2_server.rest.operations import MIB, Binary, Upload, operation
from arcor2_server.storage import Storage
from arcor2_server.storage.packages import MAX_UPLOAD

BUILD = "Build"
ZIP = "application/zip"


class PublishQuery(Data, frozen=True, rename="camel"):
    """Id of the project, and name of the package, by default that of the project."""

    project_id: str
    package_name: str = ""


def _copy(source: IO[bytes], target: Path) -> None:
    with target.open("wb") as file:
        while chunk := source.read(MIB):
            file.write(chunk)


@dataclass(frozen=True, slots=True)
class BuildOperations:
    """The Build service over REST: builds and imports packages (protocol, section 11)."""

    _storage: Storage
    _build: BuildService
    _package_import: PackageImport

    @operation("GET", "/project/publish", BUILD, Role.STANDARD_USER, media_type=ZIP)
    async def publish(self, query: PublishQuery) -> Binary:
        """Build a package from a saved project; return it as a zip file."""
        content = await self._build.publish(query.project_id, query.package_name)
        name = query.package_name or (await self._storage.project(query.project_id)).name
        return Binary(content, ZIP, f"{name}_package.zip")

    @operation(
        "PUT",
        "/project/import",
        BUILD,
        Role.PROGRAMMER,
        file="executionPackage",
        title=translatable("Importing a project"),
        limit=MAX_UPLOAD + MIB,
    )
    async def import_project(self, query: ImportOptions, upload: Upload) -> ImportedIds:
        """Import the scene, project and object types of a package. The query allows overwriting existing ones."""
        with tempfile.TemporaryDirectory(prefix="arcor2-import-") as directory:
            path = Path(directory) / "package.zip"
            await asyncio.to_thread(_copy, upload.file, path)
            return await self._package_import.import_package(path, query)
