"""The Build service over REST: a project becomes a package, and a package a project again (protocol, section 11)."""

import asyncio
import tempfile
from pathlib import Path
from typing import IO

from arcor2_hw.data.base import Data
from arcor2_hw.data.role import Role
from arcor2_server.build.importing import ImportedIds, ImportOptions, import_package
from arcor2_server.rest.operations import MIB, Binary, Upload, operation
from arcor2_server.services import Services
from arcor2_server.storage.packages import MAX_UPLOAD

BUILD = "Build"
ZIP = "application/zip"


class PublishQuery(Data, frozen=True, rename="camel"):
    """Of which project, and how the package is to be named: without a name as the project."""

    project_id: str
    package_name: str = ""


@operation("GET", "/project/publish", BUILD, Role.STANDARD_USER, media_type=ZIP)
async def publish(services: Services, query: PublishQuery) -> Binary:
    """Give the package of a saved project as a zip."""
    content = await services.build.publish(query.project_id, query.package_name)
    name = query.package_name or (await services.storage.project(query.project_id)).name
    return Binary(content, ZIP, f"{name}_package.zip")


@operation(
    "PUT",
    "/project/import",
    BUILD,
    Role.PROGRAMMER,
    file="executionPackage",
    title="Taking in a project",
    limit=MAX_UPLOAD + MIB,
)
async def import_project(services: Services, query: ImportOptions, upload: Upload) -> ImportedIds:
    """Save the scene, the project and the object types that a package holds; what differs must be allowed to go."""
    with tempfile.TemporaryDirectory(prefix="arcor2-import-") as directory:
        path = Path(directory) / "package.zip"
        await asyncio.to_thread(_copy, upload.file, path)
        return await import_package(services, path, query)


def _copy(source: IO[bytes], target: Path) -> None:
    with target.open("wb") as file:
        while chunk := source.read(MIB):
            file.write(chunk)
