"""Import of a package: its scene, project and object types go back among the saved documents."""

from pathlib import Path
from typing import TYPE_CHECKING

from arcor2_hw.data.base import Data
from arcor2_hw.exceptions import Arcor2NotImplemented

if TYPE_CHECKING:
    from arcor2_server.services import Services


class ImportOptions(Data, frozen=True, rename="camel"):
    """What of the package may take the place of something else that is saved (protocol, section 11)."""

    overwrite_scene: bool = False
    overwrite_project: bool = False
    overwrite_object_types: bool = False
    overwrite_project_sources: bool = False
    overwrite_collision_models: bool = False
    update_project_from_script: bool = False


class ImportedIds(Data, frozen=True, rename="camel"):
    """What was imported; also the answer over REST."""

    scene_id: str
    project_id: str


async def import_package(services: "Services", data: Path | bytes, options: ImportOptions) -> ImportedIds:  # noqa: ARG001
    """Save what a package (a zip, or the path of one) holds; nothing is saved before all of it is checked.

    Raises InvalidPackage for a damaged, too large or contradictory package, NotFound for an object type or asset that
    is neither in it nor here, Conflict naming everything that differs from what is saved or is open, InvalidProject
    naming the line of a script that cannot be read back, StorageError.
    """
    raise Arcor2NotImplemented("Packages cannot be imported yet.")
