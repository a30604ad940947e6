"""Preparation of meshes for the browser: time and size for a robot of 124,000 triangles."""

import io
import time
import zipfile
from collections.abc import AsyncIterator
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

import numpy as np
import trimesh

from arcor2_hw.collision.description import StoredFile
from arcor2_hw.compute.mesh_tasks import PrepareAsset
from arcor2_server.app import running_server
from arcor2_server.compute.workers import Compute
from arcor2_server.settings import ServerSettings
from benchmarks.metrics import Metric, Report, median

LINKS: Final = 7
ROUNDS: Final = 5
AGAIN: Final = 100


async def run(report: Report) -> None:
    """Measure everything in this group."""
    with TemporaryDirectory() as folder:
        for metric in await preparing(Path(folder)):
            report.add(metric)
        report.add(await again(Path(folder)))


def link(number: int) -> trimesh.Trimesh:
    """Return a link as exported by CAD programs: a tube with grooves, much finer than visible."""
    mesh = trimesh.creation.capsule(height=0.3 - 0.03 * number, radius=0.07 - 0.005 * number, count=[92, 96])
    around = np.arctan2(mesh.vertices[:, 1], mesh.vertices[:, 0])
    mesh.vertices *= 1.0 + 0.02 * np.sin(40.0 * mesh.vertices[:, 2:]) * np.cos(3.0 * around)[:, None]
    return mesh


def robot() -> tuple[bytes, int, int]:
    """Return a package of seven links in COLLADA and STL, the size of its meshes, and the number of triangles."""
    links, size, triangles = "", 0, 0
    packed = io.BytesIO()
    with zipfile.ZipFile(packed, "w", zipfile.ZIP_DEFLATED) as archive:
        for number in range(LINKS):
            mesh, kind = link(number), ("dae", "stl")[number % 2]
            content = mesh.export(file_type=kind)
            content = content if isinstance(content, bytes) else str(content).encode()
            archive.writestr(f"arm/link_{number}.{kind}", content)
            visual = f'<visual><geometry><mesh filename="link_{number}.{kind}"/></geometry></visual>'
            links += f'<link name="link_{number}">{visual}</link>'
            size, triangles = size + len(content), triangles + len(mesh.faces)
        archive.writestr("arm/arm.urdf", f'<robot name="arm">{links}</robot>')
    return packed.getvalue(), size, triangles


async def preparing(folder: Path) -> list[Metric]:
    """Measure the preparation in a running worker."""
    content, size, triangles = robot()
    (folder / "arm.zip").write_bytes(content)
    task = PrepareAsset(StoredFile(str(folder / "arm.zip"), "arm.zip"))
    compute = Compute(idle=60.0)
    taken = []
    try:
        made = await compute.run(task)
        for _ in range(ROUNDS):
            began = time.perf_counter()
            made = await compute.run(task)
            taken.append(time.perf_counter() - began)
    finally:
        await compute.close()
    assert not made.problems, made.problems
    assert made.before == triangles
    note = f"{LINKS} meshes, {triangles} triangles, {size / 1e6:.1f} MB"
    return [
        Metric("meshes_robot_triangles", made.triangles, 1, note),
        Metric("meshes_robot_mb", len(made.content) / 1e6, 1, note),
        Metric("meshes_robot_s", median(taken), len(taken), note),
    ]


async def again(folder: Path) -> Metric:
    """Measure repeated requests, read from the disk."""
    taken = []
    (folder / "data").mkdir()
    async with running_server(ServerSettings(data_dir=folder / "data")) as services:

        async def pieces() -> AsyncIterator[bytes]:
            yield (folder / "arm.zip").read_bytes()

        await services.assets.put(pieces(), "arm.zip")
        await services.display_models.get("arm.zip")
        for _ in range(AGAIN):
            began = time.perf_counter()
            shown = await services.display_models.get("arm.zip")
            (shown.packed or shown.plain).read_bytes()
            taken.append(1e3 * (time.perf_counter() - began))
    return Metric("meshes_again_ms", median(taken), len(taken), "including reading the compressed file")
