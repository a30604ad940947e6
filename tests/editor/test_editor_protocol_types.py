"""The generated types of the editor are up to date."""

import asyncio
import sys
from pathlib import Path

EDITOR = Path(__file__).resolve().parents[2] / "editor"


async def test_editor_types_match_the_structs() -> None:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, str(EDITOR / "protocol_types.py"), "--check"), stderr=asyncio.subprocess.PIPE
    )
    _, output = await asyncio.wait_for(process.communicate(), 30)
    assert process.returncode == 0, output.decode()
