"""The how-to pages about installation, upgrade and backup, executed in namespaces with a simulated service manager."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest

from tests.server.deployment.releases import SITE_PACKAGES, Signer, build_wheel, complete, pack

DOCS = Path(__file__).parents[3] / "docs" / "how-to"
NAMESPACES = ("unshare", "--mount", "--net", "--pid", "--fork", "--kill-child", "--mount-proc")
BROKEN = "import pathlib\npathlib.Path('documents.sqlite').unlink()\nraise SystemExit('it does not start')\n"
"""A version that destroys its data and does not start."""
PREPARE = """
set -eu
umask 022
trap 'test $? = 0 || tail -60 /opt/test/bin/log >&2' EXIT
ip link set lo up
mount -t tmpfs tmpfs /opt
mount -t tmpfs tmpfs /var/lib
mount -t tmpfs tmpfs /srv
mkdir -p /opt/upper/etc /opt/work/etc /opt/upper/bin /opt/work/bin /opt/test/packages /opt/test/python /opt/test/bin
mount -t overlay overlay -o lowerdir=/etc,upperdir=/opt/upper/etc,workdir=/opt/work/etc /etc
mount -t overlay overlay -o lowerdir=/usr/local/bin,upperdir=/opt/upper/bin,workdir=/opt/work/bin /usr/local/bin
mount --bind "$PACKAGES" /opt/test/packages
mount --bind "$BASE" /opt/test/python
export PYTHON=$BASE/bin/python3
if ! runuser -u nobody -- test -x "$PYTHON"; then  # an interpreter in a home directory
  mount -t tmpfs -o mode=755 tmpfs "/$(echo "$BASE" | cut -d/ -f2)"
  mkdir -p "$BASE"
  mount --bind /opt/test/python "$BASE"
fi
install -m 755 "$SYSTEMCTL" /opt/test/bin/systemctl.py
printf '#!/bin/sh\\nexec %s /opt/test/bin/systemctl.py "$@"\\n' "$PYTHON" > /opt/test/bin/systemctl
chmod 755 /opt/test/bin/systemctl
export PATH=/opt/test/bin:/usr/local/bin:$PATH
say() { echo "== $*"; }
ready() {
  "$PYTHON" -c 'from urllib.request import urlopen; print("ready", urlopen("http://127.0.0.1:6789/healthz/ready").status)'
}
current() { readlink /opt/arcor2-hw/current; }
"""


def _possible() -> bool:
    check = [*NAMESPACES, "sh", "-c", "mount -t tmpfs tmpfs /srv && ip link set lo up"]
    return (
        shutil.which("unshare") is not None and subprocess.run(check, capture_output=True, check=False).returncode == 0
    )


def _blocks(page: str) -> list[str]:
    return re.findall(r"^```sh\n(.*?)^```$", (DOCS / page).read_text(), re.MULTILINE | re.DOTALL)


@pytest.mark.matrix
@pytest.mark.skipif(not _possible(), reason="this machine does not allow namespaces")
def test_the_commands_of_the_how_to_pages_work(tmp_path: Path) -> None:
    signer = Signer()
    for version, replaced in (
        ("0.1.0", {}),
        ("0.1.1", {}),
        ("0.1.2", {"arcor2_server/cli/serve.py": BROKEN}),
    ):
        bundle = tmp_path / version
        build_wheel(bundle / "wheels", version, Path("/opt/test/packages"), replaced)
        complete(bundle, signer)
        pack(bundle, tmp_path / f"arcor2-hw-{version}-cp311-linux_x86_64.tar")
    unpack, status, upgrade, back = _blocks("install.md")
    store, restore = _blocks("back-up.md")
    script = (
        PREPARE
        + f"""
say install
{unpack}
{status}
current; ready
say back up
{store}
say upgrade
{upgrade}
current; ready
say upgrade to a version that does not start
arcor2-hw upgrade arcor2-hw-0.1.2-cp311-linux_x86_64.tar || echo "status $?"
current; ready
ls /opt/arcor2-hw
say older
arcor2-hw upgrade arcor2-hw-0.1.0-cp311-linux_x86_64.tar || echo "status $?"
say restore
{restore}
ready
say back
{back}
current; ready
stat -c '%U %a %n' /var/lib/arcor2-hw /var/lib/arcor2-hw/documents.sqlite /srv/backups/today.zip
systemctl stop
"""
    )
    environment = {
        "PATH": "/usr/sbin:/usr/bin:/sbin:/bin",
        "PACKAGES": str(SITE_PACKAGES),
        "BASE": sys.base_prefix,
        "SYSTEMCTL": str(Path(__file__).with_name("fake_systemctl.py")),
        "PUBLIC_KEY": signer.public_key,
    }
    done = subprocess.run(
        [*NAMESPACES, "sh", "-c", script],
        cwd=tmp_path,
        env=environment,
        capture_output=True,
        text=True,
        timeout=250,
        check=False,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    found = dict(part.split("\n", 1) for part in done.stdout.split("== ")[1:])
    assert found["install"].splitlines()[-3:] == ["arcor2-hw 0.1.0", "0.1.0", "ready 200"]
    assert "version 0.1.0" in found["back up"]
    assert found["upgrade"].splitlines()[-3:] == ["version 0.1.1 is running", "0.1.1", "ready 200"]
    failed = found["upgrade to a version that does not start"].splitlines()
    assert failed[-6:] == ["status 1", "0.1.1", "ready 200", "0.1.0", "0.1.1", "current"]
    assert "Version 0.1.1 runs again with its data." in done.stderr
    assert found["older"].splitlines() == ["status 17"]
    assert "Version 0.1.1 is installed; 0.1.0 is not newer." in done.stderr
    assert found["restore"].splitlines()[-1] == "ready 200"
    assert found["back"].splitlines()[-5:] == [
        "0.1.0",
        "ready 200",
        "arcor2-hw 700 /var/lib/arcor2-hw",
        "arcor2-hw 600 /var/lib/arcor2-hw/documents.sqlite",
        "arcor2-hw 600 /srv/backups/today.zip",
    ]
