"""Conversion of meshes, and of robot models with their meshes, to one glTF file for display."""

from pathlib import Path
from typing import Any, Final

from arcor2_hw.compute import glb
from arcor2_hw.compute.mesh_tasks import PrepareAsset, PreparedAsset
from arcor2_hw.compute.worker_state import WorkerState
from arcor2_hw.kinematics.errors import BadMesh, ModelError
from arcor2_hw.kinematics.model_package import MAX_PACKAGE, Package
from arcor2_hw.kinematics.xml_parser import parse_xml

MAX_SHOWN: Final = 256 * 1024 * 1024
"""Maximum size of a mesh file for display, bytes; larger than that of a collision mesh."""
MAX_TRIANGLES: Final = 3_000_000
MAX_TRIANGLES_OF_ROBOT: Final = 40_000
"""Maximum number of triangles of all meshes of a robot."""


def prepared(task: PrepareAsset, state: WorkerState) -> PreparedAsset:
    """Convert an asset for display.

    Raises:
        BadMesh: The mesh cannot be used; the message names the file.
        ModelError: The robot model cannot be used; the message names the file.
    """
    name = task.file.name
    content = _read(task)
    if content.startswith(b"PK") or name.lower().endswith(".urdf") or b"<robot" in content[:4096]:
        return _robot(content, name, state)
    return _mesh(content, name, state)


def _read(task: PrepareAsset) -> bytes:
    try:
        with Path(task.file.path).open("rb") as file:
            content = file.read(MAX_PACKAGE + 1)
    except OSError as error:
        raise BadMesh(
            "The mesh {name} cannot be read: {reason}.", name=task.file.name, reason=error.strerror
        ) from error
    if len(content) > MAX_PACKAGE:
        raise BadMesh("{name} is larger than {max_package} bytes.", name=task.file.name, max_package=MAX_PACKAGE)
    return content


def _mesh(content: bytes, name: str, state: WorkerState) -> PreparedAsset:
    from arcor2_hw.compute import simplification

    state.progress(0.0, f"reading {name}")
    surface = _surface(content, name, upright=True)
    state.progress(0.4, f"reducing {name}: {len(surface.triangles)} triangles")
    small = simplification.simplified(surface, simplification.budget(surface.vertices))
    if not len(small.triangles):
        raise BadMesh("All triangles of the mesh {name} have zero area.", name=name)
    state.progress(0.8, f"normals of {name}")
    made = glb.encode_glb({"mesh": simplification.with_normals(small)}, {})
    return PreparedAsset(made, len(small.triangles), len(surface.triangles))


def _surface(content: bytes, name: str, *, upright: bool) -> Any:
    from arcor2_hw.kinematics.meshes import read_surface

    return read_surface(content, name, upright=upright, most_bytes=MAX_SHOWN, most_triangles=MAX_TRIANGLES)


def _robot(content: bytes, name: str, state: WorkerState) -> PreparedAsset:
    """Convert the meshes of a robot. The result contains the URDF and the mesh of each reference in it."""
    state.progress(0.0, f"reading {name}")
    package = Package.open(content, name)
    at, text = package.urdf()
    root = parse_xml(text, at)
    if root.tag != "robot":
        raise ModelError("{at} describes a {tag}, not a robot.", at=at, tag=root.tag)
    found = root.iterfind("link/visual/geometry/mesh")
    references = list(dict.fromkeys(each.get("filename", "") for each in found))
    surfaces: dict[str, Any] = {}
    meshes: dict[str, str] = {}
    problems: dict[str, str] = {}
    for number, reference in enumerate(references):
        try:
            path = package.locate(reference, at)
            if path not in surfaces:
                state.progress(0.5 * number / len(references), f"reading {path}")
                surfaces[path] = _surface(package.read(path, MAX_SHOWN), path, upright=False)
            meshes[reference] = path
        except ModelError as error:
            problems[reference] = str(error)
        except ModuleNotFoundError as error:  # the rest of the robot is still shown
            problems[reference] = f"The mesh {reference} is not read: {error.name} is not installed."
    drawn, before, after = _drawn(surfaces, state)
    for reference in [each for each, path in meshes.items() if path not in drawn]:
        problems[reference] = f"All triangles of the mesh {meshes.pop(reference)} have zero area."
    extras = {"urdf": text.decode(errors="replace"), "meshes": meshes, "problems": problems}
    return PreparedAsset(glb.encode_glb(drawn, extras), after, before, list(dict.fromkeys(problems.values())))


def _drawn(surfaces: dict[str, Any], state: WorkerState) -> tuple[dict[str, Any], int, int]:
    """Return the display mesh of each surface, and the total numbers of triangles before and after."""
    if not surfaces:
        return {}, 0, 0
    from arcor2_hw.compute import simplification

    budgets = {path: min(simplification.budget(one.vertices), len(one.triangles)) for path, one in surfaces.items()}
    share = min(1.0, MAX_TRIANGLES_OF_ROBOT / max(1, sum(budgets.values())))
    drawn: dict[str, Any] = {}
    before = after = 0
    for number, (path, surface) in enumerate(surfaces.items()):
        state.progress(0.5 + 0.5 * number / len(surfaces), f"reducing {path}")
        small = simplification.simplified(surface, max(100, int(budgets[path] * share)))
        if len(small.triangles):
            drawn[path] = simplification.with_normals(small)
        before += len(surface.triangles)
        after += len(small.triangles)
    return drawn, before, after
