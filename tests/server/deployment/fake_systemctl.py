"""A service manager with one service, for namespaces without systemd: `systemctl start|stop|status ... SERVICE`."""

import contextlib
import os
import pwd
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

UNIT = Path("/etc/systemd/system/arcor2-hw.service")
STATE = Path(__file__).parent
PROCESS = STATE / "process"
LOG = STATE / "log"
START_TIMEOUT = 100.0


def settings() -> dict[str, str]:
    """Return the settings of the unit file."""
    return dict(line.split("=", 1) for line in UNIT.read_text().splitlines() if "=" in line and line[0].isupper())


def start() -> int:
    unit = settings()
    user = pwd.getpwnam(unit["User"])
    environment = {"PATH": os.environ["PATH"], "NOTIFY_SOCKET": str(STATE / "notify"), "HOME": user.pw_dir}
    with contextlib.suppress(FileNotFoundError):
        (STATE / "notify").unlink()
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as notified, LOG.open("ab") as log:
        notified.bind(environment["NOTIFY_SOCKET"])
        (STATE / "notify").chmod(0o777)
        process = subprocess.Popen(
            unit["ExecStart"].split(),
            env=environment,
            cwd=unit["WorkingDirectory"],
            user=user.pw_uid,
            group=user.pw_gid,
            extra_groups=[],
            umask=int(unit["UMask"], 8),
            stdout=log,
            stderr=log,
            start_new_session=True,
        )
        PROCESS.write_text(str(process.pid))
        notified.settimeout(0.1)
        end = time.monotonic() + START_TIMEOUT
        while process.poll() is None and time.monotonic() < end:
            with contextlib.suppress(TimeoutError):
                if notified.recv(4096) == b"READY=1":
                    return 0
    sys.stderr.write("Job for arcor2-hw.service failed because the control process exited with error code.\n")
    return 1


def stop() -> int:
    with contextlib.suppress(FileNotFoundError, ProcessLookupError):
        process = int(PROCESS.read_text())
        os.kill(process, signal.SIGTERM)
        while (Path("/proc") / str(process) / "exe").exists():
            time.sleep(0.02)
    PROCESS.unlink(missing_ok=True)
    return 0


def main() -> int:
    match sys.argv[1]:
        case "start":
            return start()
        case "stop":
            return stop()
        case "status":
            return 0 if PROCESS.exists() else 3
        case _:
            return 0


if __name__ == "__main__":
    sys.exit(main())
