"""The release that `make dist` builds: the same commit gives the same files, and a bundle that is accepted."""

import hashlib
import importlib.util
import shutil
import subprocess
import sys
import tarfile
from pathlib import Path
from types import ModuleType

import pytest
from packaging.version import Version

from arcor2_server.deployment.bundle import check
from tests.server.deployment.releases import ROOT

SCRIPTS = [ROOT / ".ci" / "install.sh", *sorted((ROOT / ".ci" / "debian").iterdir())]
pytestmark = pytest.mark.skipif(shutil.which("dpkg-deb") is None, reason="dpkg-deb is not installed")


@pytest.fixture
def release(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """Return the module that builds releases, with simulated wheels."""
    spec = importlib.util.spec_from_file_location("release", ROOT / ".ci" / "release.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, "release", module)
    spec.loader.exec_module(module)

    def collect(target: Path, lock: Path) -> None:
        target.mkdir()
        for name in ("arcor2_hw-0.1.0-py3-none-any", "some_package-2.0-py3-none-any"):
            (target / f"{name}.whl").write_bytes(name.encode())

    monkeypatch.setattr(module, "collect_wheels", collect)
    return module


def test_the_same_commit_gives_the_same_files(release: ModuleType, tmp_path: Path) -> None:
    digests = []
    for folder in (tmp_path / "first", tmp_path / "second"):
        packed, debian = release.build(folder, Path("run.txt"), components=False)
        assert debian.name == "arcor2-hw_0.1.0.deb"
        digests.append([hashlib.sha256(path.read_bytes()).hexdigest() for path in (packed, debian)])
    assert digests[0] == digests[1]

    unpacked = tmp_path / "unpacked"
    with tarfile.open(packed, "r:") as archive:
        assert {member.mode for member in archive if member.isfile()} == {0o644, 0o755}
        archive.extractall(unpacked, filter="data")
    assert check(unpacked, None) == Version("0.1.0")
    names = [line.split()[0] for line in (unpacked / "requirements.txt").read_text().splitlines()]
    assert names == ["arcor2-hw==0.1.0", "some-package==2.0"]

    listed = subprocess.run(["dpkg-deb", "--contents", str(debian)], capture_output=True, text=True, check=True).stdout
    assert "root/root" in listed
    assert "./usr/share/arcor2-hw/bundle/SHA256SUMS" in listed
    described = subprocess.run(["dpkg-deb", "--info", str(debian)], capture_output=True, text=True, check=True).stdout
    assert all(f"*  {script}" in described for script in ("postinst", "postrm", "prerm")), described


@pytest.mark.parametrize("script", SCRIPTS, ids=lambda path: path.name)
def test_the_shell_scripts_are_valid(script: Path) -> None:
    subprocess.run(["sh", "-n", str(script)], check=True)
