"""A bundle is accepted only if it is complete and signed with the stored key."""

import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path

import pytest
from packaging.version import Version

from arcor2_hw.exceptions import Conflict, InvalidData, NotFound
from arcor2_server.deployment import minisign
from arcor2_server.deployment.bundle import check
from arcor2_server.deployment.installation import CommandFailed, Installation, run
from arcor2_server.deployment.upgrade import UpgradeFailed, upgrade
from tests.server.deployment.releases import Signer, complete

SIGNER = Signer()
KEY = minisign.read_public_key(SIGNER.public_key)


@pytest.fixture
def bundle(tmp_path: Path) -> Path:
    """Return a signed bundle of version 0.2.0 with an empty wheel."""
    directory = tmp_path / "bundle"
    (directory / "wheels").mkdir(parents=True)
    (directory / "wheels" / "arcor2_hw-0.2.0-py3-none-any.whl").write_bytes(b"wheel")
    complete(directory, SIGNER)
    return directory


def test_a_signed_bundle_is_accepted(bundle: Path) -> None:
    assert check(bundle, KEY) == Version("0.2.0")


@pytest.mark.skipif(shutil.which("minisign") is None, reason="minisign is not installed")
def test_minisign_accepts_the_signature(bundle: Path) -> None:
    command = ["minisign", "-V", "-q", "-P", SIGNER.public_key, "-m", str(bundle / "SHA256SUMS")]
    subprocess.run(command, check=True)


def _signed_by_another(bundle: Path) -> None:
    Signer().sign(bundle / "SHA256SUMS")


def _with_another_comment(bundle: Path) -> None:
    signature = bundle / "SHA256SUMS.minisig"
    signature.write_text(signature.read_text().replace("signed by a test", "signed by another"))


def _of_other_content(bundle: Path) -> None:
    with (bundle / "SHA256SUMS").open("a") as sums:
        sums.write(f"{'0' * 64}  more\n")


def _outside(bundle: Path) -> None:
    with (bundle / "SHA256SUMS").open("a") as sums:
        sums.write(f"{'0' * 64}  ../more\n")
    SIGNER.sign(bundle / "SHA256SUMS")


def _without_wheel(bundle: Path) -> None:
    (bundle / "wheels" / "arcor2_hw-0.2.0-py3-none-any.whl").unlink()


def _with_two_wheels(bundle: Path) -> None:
    (bundle / "wheels" / "arcor2_hw-0.3.0-py3-none-any.whl").write_bytes(b"wheel")
    complete(bundle, SIGNER)


def _link(bundle: Path) -> None:
    wheel = bundle / "wheels" / "arcor2_hw-0.2.0-py3-none-any.whl"
    wheel.rename(bundle.parent / "elsewhere")
    wheel.symlink_to(bundle.parent / "elsewhere")


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        (lambda bundle: (bundle / "SHA256SUMS.minisig").unlink(), "not signed"),
        (lambda bundle: (bundle / "SHA256SUMS.minisig").write_text("x"), "not a signature"),
        (_signed_by_another, "not valid"),
        (_with_another_comment, "not valid"),
        (_of_other_content, "not valid"),
        (_outside, "invalid line"),
        (lambda bundle: (bundle / "install.sh").write_text("x"), "install.sh .* was changed"),
        (lambda bundle: (bundle / "more.whl").write_text("x"), "unknown file more.whl"),
        (_without_wheel, "does not contain wheels"),
        (_with_two_wheels, "does not contain ARCOR2-HW"),
        (_link, "does not contain wheels"),
    ],
)
def test_a_changed_bundle_is_refused(change: Callable[[Path], object], reason: str, bundle: Path) -> None:
    change(bundle)
    with pytest.raises(InvalidData, match=reason):
        check(bundle, KEY)


@pytest.mark.parametrize("text", ["", "RWQ", "x" * 56, f"{SIGNER.public_key}\n{SIGNER.public_key}"])
def test_an_invalid_key_is_refused(text: str) -> None:
    with pytest.raises(InvalidData, match="not one of minisign"):
        minisign.read_public_key(text)


def test_a_key_may_have_a_comment() -> None:
    assert minisign.read_public_key(f"untrusted comment: minisign public key\n{SIGNER.public_key}\n") == KEY


# ------------------------------------------------------------------------------------------------ upgrades
class _Service:
    """A service that starts only the given version."""

    def __init__(self, installation: Installation, working: str) -> None:
        self._installation, self._working = installation, working
        self.calls: list[str] = []

    def start(self, within: float) -> None:
        version = str(self._installation.version())
        self.calls.append(f"start {version}")
        if version != self._working:
            raise CommandFailed("it does not start")

    def stop(self, within: float) -> None:
        self.calls.append("stop")


COMMAND = """#!/bin/sh
echo "{version} $*" >> "{log}"
case $1 in
  backup) {backup} ;;
  install) ln -sfn {version} "{programs}/current" ;;
esac
"""
"""Script in place of `arcor2-hw` of a version."""


@pytest.fixture
def installation(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Installation:
    """Return an installation of version 0.1.0, whose commands write a log."""
    created = Installation(tmp_path)
    (tmp_path / "opt" / "arcor2-hw").mkdir(parents=True)

    def add_version(self: Installation, bundle: Path, version: Version, python: Path) -> None:
        command = self.path_of(version) / "bin" / "arcor2-hw"
        command.parent.mkdir(parents=True)
        backup = "exit 1" if (tmp_path / "disk full").exists() else ":"
        command.write_text(COMMAND.format(version=version, log=tmp_path / "log", programs=self.programs, backup=backup))
        command.chmod(0o755)

    monkeypatch.setattr(Installation, "add_version", add_version)
    created.add_version(tmp_path, Version("0.1.0"), tmp_path)
    created.select(Version("0.1.0"))
    return created


def _log(installation: Installation) -> list[str]:
    lines = (installation.root / "log").read_text().splitlines()
    return [" ".join(line.split()[:2]) for line in lines]


def test_the_data_is_copied_before_the_new_version_starts(installation: Installation, bundle: Path) -> None:
    service = _Service(installation, "0.2.0")
    upgrade(installation, bundle, Version("0.2.0"), service, user=None)
    assert service.calls == ["stop", "start 0.2.0"]
    assert _log(installation) == ["0.2.0 --version", "0.1.0 backup", "0.2.0 install"]
    assert installation.versions() == [Version("0.1.0"), Version("0.2.0")]
    upgrade(installation, bundle, Version("0.3.0"), _Service(installation, "0.3.0"), user=None)
    assert installation.versions() == [Version("0.2.0"), Version("0.3.0")], "the previous version was removed"


def test_a_version_that_does_not_start_is_removed(installation: Installation, bundle: Path) -> None:
    service = _Service(installation, "0.1.0")
    with pytest.raises(UpgradeFailed, match=r"it does not start.*Version 0.1.0 runs again"):
        upgrade(installation, bundle, Version("0.2.0"), service, user=None)
    assert service.calls == ["stop", "start 0.2.0", "stop", "start 0.1.0"]
    assert _log(installation)[-1] == "0.1.0 restore"
    assert installation.versions() == [installation.version()] == [Version("0.1.0")]


def test_a_failed_backup_prevents_the_upgrade(installation: Installation, bundle: Path) -> None:
    (installation.root / "disk full").touch()
    installation.remove(Version("0.1.0"))
    installation.add_version(bundle, Version("0.1.0"), bundle)
    service = _Service(installation, "0.1.0")
    with pytest.raises(UpgradeFailed, match="backup failed"):
        upgrade(installation, bundle, Version("0.2.0"), service, user=None)
    assert service.calls == ["stop", "stop", "start 0.1.0"]
    assert "0.1.0 restore" not in _log(installation), "the data was not changed"


@pytest.mark.parametrize("version", ["0.1.0", "0.0.9"])
def test_only_a_newer_version_is_installed(version: str, installation: Installation, bundle: Path) -> None:
    service = _Service(installation, "0.1.0")
    with pytest.raises(Conflict):
        upgrade(installation, bundle, Version(version), service, user=None)
    assert service.calls == []


def test_an_upgrade_needs_an_installation(tmp_path: Path, bundle: Path) -> None:
    with pytest.raises(NotFound):
        upgrade(Installation(tmp_path), bundle, Version("0.2.0"), _Service(Installation(tmp_path), ""), user=None)


@pytest.mark.parametrize(
    ("command", "reason"),
    [
        (["false"], "failed: status 1"),
        (["sh", "-c", "echo first >&2; echo last >&2; exit 2"], "failed: last"),
        (["no-such-command"], "cannot be run: .*No such file"),
        (["sleep", "60"], "did not end within 0.05 s"),
    ],
)
def test_the_error_names_the_failed_command(command: list[str], reason: str) -> None:
    with pytest.raises(CommandFailed, match=f"^{command[0]}.* {reason}"):
        run(command, timeout=0.05 if command[0] == "sleep" else 30)
