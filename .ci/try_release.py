"""Try the Debian package of `make dist` in a Debian with systemd: `make dist-try`, as root, with debootstrap.

A container without a network installs the package. Its services are killed, frozen and backed up while they run,
upgraded, upgraded to a version that does not start, and removed. Each result is printed; the first wrong one ends the
program.
"""

import contextlib
import shutil
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Callable, Iterator
from pathlib import Path

from release import BUNDLE, ROOT, build_debian, run, write_requirements, write_sums

INCLUDED = "systemd,systemd-sysv,dbus,python3,python3-venv,libegl1,libgl1,libgomp1,libusb-1.0-0,nats-server"
"""Packages of the Debian system: systemd, what ours depends on, and the broker."""
OTHERS = {"arcor2-hw-node@press": "/var/lib/arcor2-hw-node", "arcor2-hw-fleet": "/var/lib/arcor2-hw-fleet"}
"""The services that are not enabled by the installation, and their data directories."""
OPEN = """
import asyncio
from arcor2_server.hosts.process import CellHost

async def main():
    host = await CellHost.start(node="press")
    await asyncio.wait_for(asyncio.shield(host.ready), 30)
    await host.close()

asyncio.run(main())
"""
"""Starts a cell host on the node, with all that its unit does not permit."""
RESTART_TIMEOUT = 10.0
"""Time until a service that hangs or was killed runs again, s."""
DATA = "/var/lib/arcor2-hw"
SERVE = "arcor2_server/cli/serve.py"


class Machine:
    """A booted container. Commands run as root inside."""

    def __init__(self, children: Path) -> None:
        self._children = children  # of the process of the container; while it starts, they are others than its systemd

    def try_run(self, command: str) -> tuple[int, str]:
        """Run a command of the shell; return its status and its output."""
        leader, *_ = self._children.read_text().split() or ["self"]
        if Path(f"/proc/{leader}/root").samefile("/"):  # never run a command on this machine
            return 1, "the container is starting"
        enter = ("/usr/bin/nsenter", "--target", leader, "--all", "--root", "--wd", "/bin/sh", "-c")
        done = subprocess.run(  # noqa: S603 - the commands are ours
            (*enter, command),
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            check=False,
            timeout=900,
            env={"PATH": "/usr/local/bin:/usr/sbin:/usr/bin:/sbin:/bin", "DEBIAN_FRONTEND": "noninteractive"},
        )
        return done.returncode, done.stdout.strip()

    def run(self, command: str) -> str:
        """Run a command of the shell, and return its output. End this program if it fails."""
        status, output = self.try_run(command)
        if status:
            sys.exit(f"{command} failed with status {status}:\n{output}")
        return output

    def server(self, unit: str = "arcor2-hw") -> str:
        """Return the process id of the server, or of another service; empty if it is not active."""
        shown = self.run(f"systemctl show --property ActiveState,MainPID {unit}").splitlines()
        state = dict(line.split("=", 1) for line in shown)
        return state["MainPID"] if state["ActiveState"] == "active" else ""

    def restarted(self, former: str, unit: str = "arcor2-hw") -> float:
        """Wait until the service has another process, and return how long it took, s."""
        return wait(lambda: self.server(unit) not in ("", former), RESTART_TIMEOUT, f"restart of {unit}")


@contextlib.contextmanager
def booted(system: Path) -> Iterator[Machine]:
    """Boot a system without a network, and stop it at the end."""
    options = ("--quiet", "--register=no", "--keep-unit", "--private-network", "--boot", "--console=read-only")
    with (system.parent / "console.log").open("wb") as console:
        container = subprocess.Popen(  # noqa: S603 - the command is ours
            ("/usr/bin/systemd-nspawn", *options, "--directory", system), stdout=console, stderr=console
        )
    try:
        machine = Machine(Path(f"/proc/{container.pid}/task/{container.pid}/children"))
        ready = ("running", "degraded")
        wait(lambda: machine.try_run("systemctl is-system-running")[1] in ready, 180.0, "boot of the container")
        yield machine
    finally:
        container.terminate()  # an orderly shutdown
        with contextlib.suppress(subprocess.TimeoutExpired):
            container.wait(60.0)
        container.kill()
        container.wait()


def wait(condition: Callable[[], object], seconds: float, what: str) -> float:
    """Wait for a condition, and return how long it took, s. End this program if it takes longer than permitted."""
    start = time.monotonic()
    while not condition():
        if time.monotonic() - start > seconds:
            sys.exit(f"{what}: not within {seconds:g} s")
        time.sleep(0.1)
    return time.monotonic() - start


def expect(what: str, right: object, shown: object = "") -> None:
    """Print a result, and end this program if it is wrong."""
    sys.stdout.write(f"{what:70} {'ok' if right else 'WRONG'}  {shown}\n")
    sys.stdout.flush()
    if not right:
        sys.exit(1)


def change_version(bundle: Path, version: str, *, broken: bool) -> None:
    """Change the version of a bundle. If it is to be broken, its server ends at once."""
    (wheel,) = (bundle / "wheels").glob("arcor2_hw-*.whl")
    former = wheel.name.split("-")[1]
    names = []
    changed = wheel.with_name(wheel.name.replace(former, version))
    with zipfile.ZipFile(wheel) as source, zipfile.ZipFile(changed, "w") as target:
        for entry in source.infolist():
            name, content = entry.filename.replace(f"arcor2_hw-{former}.", f"arcor2_hw-{version}."), source.read(entry)
            if name.endswith(".dist-info/METADATA"):
                content = content.replace(f"\nVersion: {former}\n".encode(), f"\nVersion: {version}\n".encode(), 1)
            if name == SERVE and broken:
                content = b"raise SystemExit('this version does not start')\n"
            if not name.endswith(".dist-info/RECORD"):
                target.writestr(name, content)
                names.append(name)
        record = f"arcor2_hw-{version}.dist-info/RECORD"
        target.writestr(record, "".join(f"{name},,\n" for name in [*names, record]))
    for former_file in (wheel, bundle / "SHA256SUMS"):
        former_file.unlink()
    write_requirements(bundle)
    write_sums(bundle)


def try_service(machine: Machine) -> None:
    """Install the package, and let its service fail."""
    machine.run("apt-get install --yes /release/first.deb")
    expect("apt install starts the service", pid := machine.server(), machine.run("arcor2-hw --version"))
    who = machine.run(f"stat -c %U /proc/{pid}")
    expect("the server is not root", who == "arcor2-hw", who)
    modes = machine.run(f"stat -c %U:%a {DATA} {DATA}/*.sqlite").split()
    expect("data can be read by its user only", set(modes) == {"arcor2-hw:700", "arcor2-hw:600"}, " ".join(modes))
    expect_hardened(machine, "arcor2-hw")
    machine.run(f"kill -KILL {pid}")
    expect("a killed server is started again", True, f"{machine.restarted(pid):.1f} s")
    pid = machine.server()
    machine.run(f"kill -STOP {pid}")
    expect("a frozen server is started again", True, f"{machine.restarted(pid):.1f} s")
    machine.run(f"runuser -u arcor2-hw -- arcor2-hw backup /tmp/copy.zip --data-dir {DATA}")
    expect("backup while it runs", machine.server())


def expect_hardened(machine: Machine, unit: str) -> None:
    """Check the rating of a unit."""
    rating = machine.run(f"systemd-analyze security {unit}").splitlines()[-1]
    expect(f"the unit {unit} is hardened", float(rating.split(":")[1].split()[0]) <= 3.0, rating.strip("→ "))


def try_other_services(machine: Machine) -> None:
    """Start a node and the page of a fleet, and freeze them."""
    for unit, data in OTHERS.items():
        machine.run(f"systemctl enable --now {unit}")
        who = machine.run(f"stat -c %U:%a /proc/{machine.server(unit)} {data}").split()
        expect(f"{unit} starts, and is not root", who == ["arcor2-hw:555", "arcor2-hw:700"], " ".join(who))
        expect_hardened(machine, unit)
    ready = "journalctl --output cat --unit arcor2-hw-node@press | grep -x 'ready press'"
    took = wait(lambda: not machine.try_run(ready)[0], 10.0, "connection of the node to the broker")
    expect("the node reaches the broker", True, f"{took:.1f} s")
    machine.run(f"/opt/arcor2-hw/current/bin/python -c '{OPEN}'")
    expect("a cell host starts on the node", True)
    for unit in OTHERS:
        machine.run(f"kill -STOP {(pid := machine.server(unit))}")
        expect(f"a frozen {unit} is started again", True, f"{machine.restarted(pid, unit):.1f} s")


def try_upgrades(machine: Machine) -> None:
    """Upgrade the package, and try one that does not start."""
    before = machine.run("systemctl show --value --property ExecMainStartTimestamp arcor2-hw")
    status, output = machine.try_run("apt-get install --yes /release/broken.deb")
    last = next((line for line in output.splitlines() if "runs again" in line), output)
    expect("a version that does not start is refused", status and last != output, last)
    expect("the old version runs again", machine.server() and "0.1.0" in machine.run("arcor2-hw --version"), before)
    machine.run("apt-get install --yes /release/second.deb")
    running = all(machine.server(unit) for unit in ("arcor2-hw", *OTHERS))
    expect("upgrade of all services", running and "0.1.2" in machine.run("arcor2-hw --version"))
    machine.run("apt-get remove --yes arcor2-hw")
    left = machine.run(f"ls -d {DATA}/*.sqlite; test ! -e /opt/arcor2-hw")
    expect("after removal, the data is left", DATA in left, left.splitlines()[0])
    units = machine.run("ls /etc/systemd/system /etc/systemd/system/multi-user.target.wants")
    running = any(machine.server(unit) for unit in ("arcor2-hw", *OTHERS))
    expect("after removal, no service is left", "arcor2-hw" not in units and not running)


def main() -> None:
    """Try dist/arcor2-hw_*.deb."""
    (package,) = (ROOT / "dist").glob("arcor2-hw_*.deb")
    with tempfile.TemporaryDirectory(prefix="arcor2-hw-try-") as folder:
        system = Path(folder, "system")
        run("debootstrap", "--variant=minbase", f"--include={INCLUDED}", "bookworm", system)
        releases = system / "release"
        releases.mkdir()
        shutil.copy(package, releases / "first.deb")
        tree = Path(folder, "tree")
        run("dpkg-deb", "--extract", package, tree)
        for version, name in (("0.1.2", "second"), ("0.1.1", "broken")):
            change_version(tree / BUNDLE, version, broken=name == "broken")
            build_debian(tree / BUNDLE, version, releases / f"{name}.deb")
        shutil.rmtree(tree)
        with booted(system) as machine:
            try_service(machine)
            try_other_services(machine)
            try_upgrades(machine)


if __name__ == "__main__":
    main()
