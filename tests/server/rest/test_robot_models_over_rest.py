"""Models of the robots of installed drivers, as an editor fetches them."""

import io
import zipfile
from pathlib import Path

import httpx
import pytest
from msgspec import UNSET

from arcor2_server.app import Server
from arcor2_server.object_types.robot_packages import robot_packages
from tests.server.rest.rest_client import granted, refused

pytestmark = pytest.mark.asyncio(loop_scope="module")


async def test_every_named_robot_model_is_served(http: httpx.AsyncClient, services: Server) -> None:
    named = {robot.type: robot.urdf_package_filename for robot in services.types.robot_metas()}
    assert {"UR3e", "UR5e", "UR10e", "DobotMagician", "TwoAxisRobot"} <= {k for k, v in named.items() if v is not UNSET}
    for name in filter(None, named.values()):
        assert granted(await http.get(f"/assets/{name}/exists")) is True
        answer = await http.get(f"/assets/{name}/data")
        assert answer.status_code == 200
        with zipfile.ZipFile(io.BytesIO(answer.content)) as archive:
            (urdf,) = [each for each in archive.namelist() if each.endswith(".urdf")]
            assert archive.read(urdf).rstrip().endswith(b"</robot>")
    refused(await http.delete("/assets/ur5e.zip"), 409, "Conflict", "ur5e.zip")


async def test_folders_are_packed_reproducibly_and_archives_are_unchanged(tmp_path: Path) -> None:
    arm = tmp_path / "urdf" / "arm"
    (arm / "meshes").mkdir(parents=True)
    (arm / "arm.urdf").write_text("<robot/>")
    (arm / "meshes" / "link.stl").write_bytes(b"solid")
    (tmp_path / "urdf" / "other.zip").write_bytes(b"PK")
    (tmp_path / "urdf" / "notes.txt").write_text("no model")
    first = robot_packages(tmp_path)
    assert set(first) == {"arm.zip", "other.zip"}
    assert first["other.zip"] == b"PK"
    with zipfile.ZipFile(io.BytesIO(first["arm.zip"])) as archive:
        assert archive.namelist() == ["arm/arm.urdf", "arm/meshes/link.stl"]
    (arm / "arm.urdf").touch()
    assert robot_packages(tmp_path) == first
    assert robot_packages(tmp_path / "urdf") == {}
