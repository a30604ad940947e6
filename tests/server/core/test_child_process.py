"""Child processes of the server."""

import os
import socket
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
