"""Release bundles: directories with everything that an installation without a network needs.

A bundle contains `wheels/`, `requirements.txt` with their digests, `install.sh`, lists of components (CycloneDX), and
`SHA256SUMS` with the digests of all files, which `SHA256SUMS.minisig` signs.
"""

import hashlib
import re
from pathlib import Path, PurePosixPath
from typing import Final

from packaging.utils import parse_wheel_filename
from packaging.version import Version

from arcor2_hw.exceptions import InvalidData, StorageError
from arcor2_server.deployment import minisign

SUMS: Final = "SHA256SUMS"
SIGNATURE: Final = "SHA256SUMS.minisig"
REQUIREMENTS: Final = "requirements.txt"
WHEELS: Final = "wheels"
PROJECT: Final = "arcor2-hw"
_SUM: Final = re.compile(r"([0-9a-f]{64})  (\S+)")


def digest(path: Path) -> str:
    """Return the SHA-256 digest of a file as hexadecimal text. Raises OSError."""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def check(bundle: Path, public_key: bytes | None) -> Version:
    """Check the signature and all files of a bundle, and return its version.

    Args:
        bundle: the directory.
        public_key: the key of its signature; None: do not check the signature.

    Raises:
        InvalidData: the bundle is incomplete or was changed.
        StorageError: it cannot be read.
    """
    try:
        if public_key is not None:
            if not (bundle / SIGNATURE).is_file():
                raise InvalidData("{bundle} is not signed.", bundle=bundle)
            minisign.verify(bundle / SUMS, bundle / SIGNATURE, public_key)
        sums = _sums(bundle)
        found = {path.relative_to(bundle).as_posix() for path in bundle.rglob("*") if not path.is_dir()}
        if others := found - {SUMS, SIGNATURE} - set(sums):
            raise InvalidData("{bundle} contains the unknown file {path}.", bundle=bundle, path=min(others))
        for path, expected in sums.items():
            if path not in found or (bundle / path).is_symlink():
                raise InvalidData("{bundle} does not contain {path}.", bundle=bundle, path=path)
            if digest(bundle / path) != expected:
                raise InvalidData("{path} of {bundle} was changed or is damaged.", path=path, bundle=bundle)
    except OSError as error:
        raise StorageError("{bundle} cannot be read: {reason}.", bundle=bundle, reason=error) from error
    return version_of(bundle)


def version_of(bundle: Path) -> Version:
    """Return the version of ARCOR2-HW in a bundle.

    Raises:
        InvalidData: the bundle does not contain exactly one.
    """
    wheels = list((bundle / WHEELS).glob("arcor2_hw-*.whl"))
    if len(wheels) != 1:
        raise InvalidData("{bundle} does not contain ARCOR2-HW.", bundle=bundle)
    return parse_wheel_filename(wheels[0].name)[1]


def _sums(bundle: Path) -> dict[str, str]:
    sums = {}
    for line in (bundle / SUMS).read_text().splitlines():
        match = _SUM.fullmatch(line)
        path = PurePosixPath(match[2]) if match else PurePosixPath("/")
        if match is None or path.is_absolute() or ".." in path.parts:
            raise InvalidData("{path} has an invalid line: {line}", path=bundle / SUMS, line=line)
        sums[match[2]] = match[1]
    return sums
