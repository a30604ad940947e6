"""Packs the robot models in the folders of installed drivers as assets.

A folder `urdf/ur5e/` in the folder of a driver, with a URDF and its meshes, becomes the asset `ur5e.zip`. A zip archive
or URDF file in `urdf/` becomes an asset unchanged. The object type names it: `urdf_package_name = "ur5e.zip"`.
"""

import io
import zipfile
from pathlib import Path
from typing import Final

FOLDER: Final = "urdf"
KINDS: Final = (".zip", ".urdf")
_TIMESTAMP: Final = (1980, 1, 1, 0, 0, 0)


def robot_packages(driver: Path) -> dict[str, bytes]:
    """Return the assets in a driver's folder, by id. Raise OSError if they cannot be read."""
    folder = driver / FOLDER
    if not folder.is_dir():
        return {}
    found: dict[str, bytes] = {}
    for path in sorted(folder.iterdir()):
        if path.is_dir() and not path.name.startswith((".", "__")):
            found[f"{path.name}.zip"] = _packed(path)
        elif path.suffix.lower() in KINDS:
            found[path.name] = path.read_bytes()
    return found


def _packed(folder: Path) -> bytes:
    """Pack a folder. Equal files result in equal bytes."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                entry = zipfile.ZipInfo(path.relative_to(folder.parent).as_posix(), _TIMESTAMP)
                entry.compress_type = zipfile.ZIP_DEFLATED
                archive.writestr(entry, path.read_bytes())
    return packed.getvalue()
