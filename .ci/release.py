"""Build a release from this checkout (`make dist`): a bundle for machines without a network, and a Debian package.

The bundle contains the wheels of requirements/run.txt and our own. It is installed into an empty environment, from
which the list of components is written. With MINISIGN_KEY, the path of a secret key, it is signed. The same commit
gives the same files, except for the signature.
"""

import argparse
import hashlib
import json
import os
import shutil
import subprocess
import sys
import sysconfig
import tarfile
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from packaging.utils import canonicalize_name, parse_wheel_filename

ROOT = Path(__file__).parents[1]
KEY = "MINISIGN_KEY"
DEPENDS = "python3 (>= 3.11), python3-venv, passwd, systemd, libegl1, libgl1, libgomp1, libusb-1.0-0"
BUNDLE = "usr/share/arcor2-hw/bundle"
"""Where the Debian package stores the bundle."""


def run(*command: str | Path, **options: Any) -> str:
    """Run a command and return its output; end this program if it fails."""
    done = subprocess.run(  # noqa: S603 - the commands are ours
        [str(each) for each in command], stdout=subprocess.PIPE, text=True, check=False, **options
    )
    if done.returncode:
        sys.exit(f"{' '.join(map(str, command[:4]))} failed with status {done.returncode}")
    output: str = done.stdout
    return output


def environment() -> dict[str, str]:
    """Return the environment for tools that store times: that of the commit, so that a release can be reproduced."""
    stamp = run("git", "-C", ROOT, "log", "-1", "--format=%ct").strip()
    return os.environ | {"SOURCE_DATE_EPOCH": stamp, "PIP_DISABLE_PIP_VERSION_CHECK": "1"}


def collect_wheels(target: Path, lock: Path) -> None:
    """Build our wheel, and download or build those of a lock file."""
    pip = (sys.executable, "-m", "pip", "wheel", "--quiet", "--wheel-dir", target)
    run(*pip, "--require-hashes", "--requirement", lock, env=environment())
    run(*pip, "--no-deps", "--no-build-isolation", ROOT, env=environment())


def write_requirements(bundle: Path) -> str:
    """List the wheels with their digests; return the version of ours."""
    lines, ours = [], ""
    for wheel in sorted((bundle / "wheels").glob("*.whl")):
        name, version, *_ = parse_wheel_filename(wheel.name)
        lines.append(f"{name}=={version} --hash=sha256:{hashlib.sha256(wheel.read_bytes()).hexdigest()}\n")
        if name == canonicalize_name("arcor2-hw"):
            ours = str(version)
    (bundle / "requirements.txt").write_text("".join(lines))
    return ours


def write_components(bundle: Path) -> None:
    """Install the bundle into an empty environment, run the demo, and list the components (CycloneDX)."""
    with tempfile.TemporaryDirectory() as folder:
        run(sys.executable, "-m", "venv", folder)
        python = Path(folder, "bin", "python")
        install = ("install", "--quiet", "--no-index", "--find-links", bundle / "wheels", "--require-hashes")
        run(python, "-m", "pip", *install, "--requirement", bundle / "requirements.txt", env=environment())
        tool = (
            sys.executable,
            "-m",
            "cyclonedx_py",
            "environment",
            "--output-reproducible",
            "--mc-type",
            "application",
        )
        run(*tool, "--pyproject", ROOT / "pyproject.toml", "--output-file", bundle / "components.cdx.json", python)
    listed = json.loads(run("npm", "sbom", "--sbom-format", "cyclonedx", "--omit", "dev", cwd=ROOT / "editor"))
    listed.pop("serialNumber", None)  # a random number and the present time
    listed["metadata"].pop("timestamp", None)
    (bundle / "components-editor.cdx.json").write_text(json.dumps(listed, indent=2, sort_keys=True) + "\n")


def write_sums(bundle: Path) -> None:
    """Write the digests of all files, and sign them if there is a key."""
    names = sorted(path.relative_to(bundle).as_posix() for path in bundle.rglob("*") if path.is_file())
    lines = [f"{hashlib.sha256((bundle / name).read_bytes()).hexdigest()}  {name}\n" for name in names]
    (bundle / "SHA256SUMS").write_text("".join(lines))
    if key := os.environ.get(KEY):
        run("minisign", "-S", "-s", key, "-m", bundle / "SHA256SUMS", "-t", bundle.name)


def pack(bundle: Path, target: Path) -> None:
    """Pack the files of a bundle into a tar file without compression, since wheels are compressed."""
    stamp = int(environment()["SOURCE_DATE_EPOCH"])

    def same(info: tarfile.TarInfo) -> tarfile.TarInfo:
        info.uid = info.gid = 0
        info.uname = info.gname = "root"
        info.mtime = stamp
        info.mode = 0o755 if info.isdir() or info.name.endswith(".sh") else 0o644
        return info

    with tarfile.open(target, "w", format=tarfile.PAX_FORMAT) as archive:
        for path in sorted(bundle.rglob("*")):
            archive.add(path, path.relative_to(bundle).as_posix(), recursive=False, filter=same)


def build_debian(bundle: Path, version: str, target: Path) -> None:
    """Build a Debian package that contains the bundle, and installs or upgrades the service from it."""
    architecture = run("dpkg", "--print-architecture").strip()
    with tempfile.TemporaryDirectory() as folder:
        tree = Path(folder)
        tree.chmod(0o755)
        shutil.copytree(bundle, tree / BUNDLE)
        (tree / "DEBIAN").mkdir()
        control = {
            "Package": "arcor2-hw",
            "Version": version,
            "Architecture": architecture,
            "Section": "science",
            "Priority": "optional",
            "Maintainer": "The ARCOR2-HW developers <arcor2-hw@localhost>",
            "Depends": DEPENDS,
            "Description": "set up, program and run robotic workplaces from a tablet\n"
            " A server that integrates the devices of a robot cell, and an editor in the browser.",
        }
        (tree / "DEBIAN" / "control").write_text("".join(f"{key}: {value}\n" for key, value in control.items()))
        for script in sorted((Path(__file__).parent / "debian").iterdir()):
            shutil.copy(script, tree / "DEBIAN" / script.name)
        for path in tree.rglob("*"):
            executable = (
                path.is_dir() or (path.parent.name == "DEBIAN" and path.name != "control") or path.suffix == ".sh"
            )
            path.chmod(0o755 if executable else 0o644)
        run("dpkg-deb", "--root-owner-group", "-Znone", "--build", tree, target, env=environment())


def platform() -> str:
    """Return the Python version and platform that the wheels are for."""
    return f"cp{sys.version_info.major}{sys.version_info.minor}-{sysconfig.get_platform().replace('-', '_')}"


def build(folder: Path, lock: Path, *, components: bool = True) -> Iterator[Path]:
    """Build a release in a folder; yield its files."""
    shutil.rmtree(folder, ignore_errors=True)
    bundle = folder / "bundle"
    bundle.mkdir(parents=True)
    collect_wheels(bundle / "wheels", lock)
    version = write_requirements(bundle)
    if components:
        write_components(bundle)
    shutil.copy(Path(__file__).with_name("install.sh"), bundle)
    for file in ("LICENSE.md", "CHANGELOG.md"):
        shutil.copy(ROOT / file, bundle)
    write_sums(bundle)
    bundle = bundle.rename(folder / f"arcor2-hw-{version}-{platform()}")
    pack(bundle, packed := bundle.with_name(f"{bundle.name}.tar"))
    yield packed
    build_debian(bundle, version, debian := folder / f"arcor2-hw_{version}.deb")
    yield debian


def main() -> None:
    """Build the release into dist/."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--folder", type=Path, default=ROOT / "dist", help="the folder of the results (dist)")
    parser.add_argument("--lock", type=Path, default=ROOT / "requirements" / "run.txt", help="the lock file")
    parser.add_argument("--no-components", action="store_true", help="write no lists of components")
    given = parser.parse_args()
    for path in build(given.folder, given.lock, components=not given.no_components):
        sys.stdout.write(f"{path} {path.stat().st_size >> 20} MiB\n")
    if KEY not in os.environ:
        sys.stderr.write(f"not signed: set {KEY} to the path of a minisign key\n")


if __name__ == "__main__":
    main()
