"""Makes meshes, and robots' descriptions with theirs, ready for clients: one file, few triangles, normals, colours."""

from pathlib import Path
from typing import Any, Final

from arcor2_hw.compute import glb
from arcor2_hw.compute.desk import Desk
from arcor2_hw.compute.preparing_tasks import PrepareAsset, Prepared
from arcor2_hw.kinematics.errors import BadMesh, ModelError
from arcor2_hw.kinematics.markup import parse_xml
from arcor2_hw.kinematics.source import MAX_PACKAGE, Package

MAX_SHOWN: Final = 256 * 1024 * 1024
"""Bytes of a mesh file that is only shown: it may be larger than one that things collide with."""
MAX_TRIANGLES: Final = 3_000_000
MOST_OF_ROBOT: Final = 40_000
"""Triangles of all meshes of a robot."""


def prepared(task: PrepareAsset, desk: Desk) -> Prepared:
    """Give an asset as clients show it. Raises BadMesh, ModelError and its kinds, naming the file."""
    name = task.file.name
    content = _read(task)
    if content.startswith(b"PK") or name.lower().endswith(".urdf") or b"<robot" in content[:4096]:
        return _robot(content, name, desk)
    return _mesh(content, name, desk)


def _read(task: PrepareAsset) -> bytes:
    try:
        with Path(task.file.path).open("rb") as file:
            content = file.read(MAX_PACKAGE + 1)
    except OSError as error:
        raise BadMesh(f"The mesh {task.file.name} cannot be read: {error.strerror}.") from error
    if len(content) > MAX_PACKAGE:
        raise BadMesh(f"{task.file.name} has more than {MAX_PACKAGE} bytes.")
    return content


def _mesh(content: bytes, name: str, desk: Desk) -> Prepared:
    from arcor2_hw.compute import reducing

    desk.progress(0.0, f"reading {name}")
    surface = _surface(content, name, upright=True)
    desk.progress(0.4, f"reducing {name}: {len(surface.triangles)} triangles")
    small = reducing.reduced(surface, reducing.budget(surface.vertices))
    if not len(small.triangles):
        raise BadMesh(f"The mesh {name} has only triangles without extent.")
    desk.progress(0.8, f"normals of {name}")
    made = glb.written({"mesh": reducing.drawn(small)}, {})
    return Prepared(made, len(small.triangles), len(surface.triangles))


def _surface(content: bytes, name: str, *, upright: bool) -> Any:
    from arcor2_hw.kinematics.meshes import read_surface

    return read_surface(content, name, upright=upright, most_bytes=MAX_SHOWN, most_triangles=MAX_TRIANGLES)


def _robot(content: bytes, name: str, desk: Desk) -> Prepared:
    """Give the meshes of a robot by their paths, and the description itself with what it calls each of them."""
    desk.progress(0.0, f"reading {name}")
    package = Package.open(content, name)
    at, text = package.urdf()
    root = parse_xml(text, at)
    if root.tag != "robot":
        raise ModelError(f"{at} describes no robot but a {root.tag}.")
    found = root.iterfind("link/visual/geometry/mesh")
    references = list(dict.fromkeys(each.get("filename", "") for each in found))
    surfaces: dict[str, Any] = {}
    meshes: dict[str, str] = {}
    problems: dict[str, str] = {}
    for number, reference in enumerate(references):
        try:
            path = package.locate(reference, at)
            if path not in surfaces:
                desk.progress(0.5 * number / len(references), f"reading {path}")
                surfaces[path] = _surface(package.read(path, MAX_SHOWN), path, upright=False)
            meshes[reference] = path
        except ModelError as error:
            problems[reference] = str(error)
        except ModuleNotFoundError as error:  # the rest of the robot is shown all the same
            problems[reference] = f"The mesh {reference} is not read: {error.name} is not installed."
    drawn, before, after = _drawn(surfaces, desk)
    for reference in [each for each, path in meshes.items() if path not in drawn]:
        problems[reference] = f"The mesh {meshes.pop(reference)} has only triangles without extent."
    extras = {"urdf": text.decode(errors="replace"), "meshes": meshes, "problems": problems}
    return Prepared(glb.written(drawn, extras), after, before, list(dict.fromkeys(problems.values())))


def _drawn(surfaces: dict[str, Any], desk: Desk) -> tuple[dict[str, Any], int, int]:
    """Give what is drawn of each surface, and how many triangles all were and are."""
    if not surfaces:
        return {}, 0, 0
    from arcor2_hw.compute import reducing

    budgets = {path: min(reducing.budget(one.vertices), len(one.triangles)) for path, one in surfaces.items()}
    share = min(1.0, MOST_OF_ROBOT / max(1, sum(budgets.values())))
    drawn: dict[str, Any] = {}
    before = after = 0
    for number, (path, surface) in enumerate(surfaces.items()):
        desk.progress(0.5 + 0.5 * number / len(surfaces), f"reducing {path}")
        small = reducing.reduced(surface, max(100, int(budgets[path] * share)))
        if len(small.triangles):
            drawn[path] = reducing.drawn(small)
        before += len(surface.triangles)
        after += len(small.triangles)
    return drawn, before, after
