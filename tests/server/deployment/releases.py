"""Small releases for tests: bundles of our own wheel, which takes all other packages from this environment."""

import base64
import hashlib
import shutil
import sysconfig
import tarfile
import zipfile
from pathlib import Path

from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey

ROOT = Path(__file__).parents[3]
SITE_PACKAGES = Path(sysconfig.get_path("purelib"))
PACKAGES = (ROOT / "arcor2_hw", ROOT / "server" / "arcor2_server")
LEFT_OUT = ("editor_files", "__pycache__", "testing", "starter")
"""Files and directories that a running server does not need."""
_KEY_NUMBER = b"number 1"


class Signer:
    """Signer of files in the format of minisign."""

    def __init__(self) -> None:
        self._key = Ed25519PrivateKey.generate()
        self.public_key = base64.b64encode(b"Ed" + _KEY_NUMBER + self._key.public_key().public_bytes_raw()).decode()

    def sign(self, path: Path, comment: str = "signed by a test") -> None:
        """Write the signature of a file next to it."""
        signature = self._key.sign(hashlib.blake2b(path.read_bytes()).digest())
        both = self._key.sign(signature + comment.encode())
        lines = (
            "untrusted comment: signature",
            base64.b64encode(b"ED" + _KEY_NUMBER + signature).decode(),
            f"trusted comment: {comment}",
            base64.b64encode(both).decode(),
        )
        path.with_name(f"{path.name}.minisig").write_text("\n".join(lines) + "\n")


def build_wheel(folder: Path, version: str, dependencies: Path, replaced: dict[str, str] | None = None) -> Path:
    """Write a wheel of this source code.

    Args:
        folder: the folder of the wheel.
        version: the version that it states.
        dependencies: the folder of all other packages.
        replaced: other content of some modules, by path.
    """
    info = f"arcor2_hw-{version}.dist-info"
    files = {
        "test-dependencies.pth": f"{dependencies}\n".encode(),
        f"{info}/METADATA": f"Metadata-Version: 2.1\nName: arcor2-hw\nVersion: {version}\n".encode(),
        f"{info}/WHEEL": b"Wheel-Version: 1.0\nGenerator: tests\nRoot-Is-Purelib: true\nTag: py3-none-any\n",
        f"{info}/entry_points.txt": b"[console_scripts]\narcor2-hw = arcor2_server.cli.main:main\n",
    }
    for package in PACKAGES:
        for path in package.rglob("*"):
            inside = path.relative_to(package.parent)
            if path.is_file() and not set(inside.parts) & set(LEFT_OUT):
                files[inside.as_posix()] = path.read_bytes()
    files |= {name: text.encode() for name, text in (replaced or {}).items()}
    folder.mkdir(parents=True, exist_ok=True)
    wheel = folder / f"arcor2_hw-{version}-py3-none-any.whl"
    with zipfile.ZipFile(wheel, "w") as archive:
        for name, content in files.items():
            archive.writestr(name, content)
        archive.writestr(f"{info}/RECORD", "".join(f"{name},,\n" for name in [*files, f"{info}/RECORD"]))
    return wheel


def complete(bundle: Path, signer: Signer | None) -> None:
    """Add the other files of a bundle to its wheels."""
    for made in ("SHA256SUMS", "SHA256SUMS.minisig"):
        (bundle / made).unlink(missing_ok=True)
    lines = []
    for wheel in (bundle / "wheels").iterdir():
        version = wheel.name.split("-")[1]
        lines.append(f"arcor2-hw=={version} --hash=sha256:{hashlib.sha256(wheel.read_bytes()).hexdigest()}\n")
    (bundle / "requirements.txt").write_text("".join(lines))
    shutil.copy(ROOT / ".ci" / "install.sh", bundle)
    names = sorted(path.relative_to(bundle).as_posix() for path in bundle.rglob("*") if path.is_file())
    sums = [f"{hashlib.sha256((bundle / name).read_bytes()).hexdigest()}  {name}\n" for name in names]
    (bundle / "SHA256SUMS").write_text("".join(sums))
    if signer is not None:
        signer.sign(bundle / "SHA256SUMS")


def pack(bundle: Path, target: Path) -> None:
    """Pack a bundle into a tar file."""
    with tarfile.open(target, "w") as archive:
        for path in sorted(bundle.rglob("*")):
            archive.add(path, path.relative_to(bundle).as_posix(), recursive=False)
