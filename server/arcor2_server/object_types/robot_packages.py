"""Robots' models that lie in the folders of installed drivers, packed as the assets that clients ask for.

In the folder of a driver's type, `urdf/ur5e/` with a URDF and what it needs becomes the asset `ur5e.zip`; a zip archive
or URDF file that lies in `urdf/` is an asset as it is. The type names it: `urdf_package_name = "ur5e.zip"`.
"""

import io
import zipfile
from pathlib import Path
from typing import Final

FOLDER: Final = "urdf"
KINDS: Final = (".zip", ".urdf")
_LONG_AGO: Final = (1980, 1, 1, 0, 0, 0)


def robot_packages(driver: Path) -> dict[str, bytes]:
    """Return the assets in a driver's folder, by id; none when it has no models. OSError when they cannot be read."""
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
    """Pack a folder; the same files make the same bytes, whenever and wherever that is done."""
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for path in sorted(folder.rglob("*")):
            if path.is_file():
                entry = zipfile.ZipInfo(path.relative_to(folder.parent).as_posix(), _LONG_AGO)
                entry.compress_type = zipfile.ZIP_DEFLATED
                archive.writestr(entry, path.read_bytes())
    return packed.getvalue()
