"""Child processes of the server."""

import os
import select
import signal
import socket
import subprocess
import sys
from pathlib import Path

from arcor2_server.child_process import ChildProcess

WRITES_A_FILE = "import tempfile, time; print(tempfile.mkstemp()[1], flush=True); time.sleep(60)"


async def test_temporary_files_of_a_killed_process_are_removed() -> None:
    ours, theirs = socket.socketpair()
    process = await ChildProcess.start(["-c", WRITES_A_FILE], theirs, os.environ)
    async for line in process.output():
        assert Path(line).exists()
        process.kill()
    assert await process.wait() < 0
    assert not Path(line).parent.exists()
    ours.close()


SERVER = f"""
import asyncio, os, socket
from arcor2_server.child_process import ChildProcess

async def main():
    ours, theirs = socket.socketpair()
    process = await ChildProcess.start(["-c", {WRITES_A_FILE!r}], theirs, os.environ)
    print(process.pid, flush=True)
    async for line in process.output():
        print(line, flush=True)

asyncio.run(main())
"""


def test_temporary_files_that_a_killed_server_left_are_removed_by_the_next(tmp_path: Path) -> None:
    def start() -> tuple[subprocess.Popen[str], int, Path]:
        command, environment = [sys.executable, "-c", SERVER], os.environ | {"TMPDIR": str(tmp_path)}
        server = subprocess.Popen(command, env=environment, text=True, stdout=subprocess.PIPE)
        assert server.stdout is not None
        return server, int(server.stdout.readline()), Path(server.stdout.readline().strip())

    def kill(server: subprocess.Popen[str]) -> None:
        assert server.stdout is not None
        server.kill()
        server.wait()
        server.stdout.close()

    first, orphan, file = start()
    kill(first)
    second, orphan_of_second, _ = start()
    assert file.exists(), "the process of the killed server still runs"
    kill(second)
    for pid in (orphan, orphan_of_second):
        end = os.pidfd_open(pid)
        os.kill(pid, signal.SIGKILL)
        select.select([end], [], [])
        os.close(end)
    third, last, _ = start()
    assert not file.parent.exists()
    assert len(list(tmp_path.iterdir())) == 1, "only that of the running process is left"
    kill(third)
    os.kill(last, signal.SIGKILL)
