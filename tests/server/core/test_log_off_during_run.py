"""A running program continues after its operator was logged off, and Stop works without a person."""

from pathlib import Path

from arcor2_hw.data.role import Role
from arcor2_server.access.tokens import TokenFile
from tests.runtime.test_host_parts import BODY, write_package

from .serving import running, talking, until

PIN = "2580"
LOG_OFF_AFTER = 1.0
SCRIPT = BODY + 'import time\nwhile True:\n    arm.move("round")\n    arm.test(True, an="test")\n    time.sleep(0.02)\n'
"""Writes a line of notes in each round."""


def rounds(directory: Path) -> int:
    notes = directory / "notes"
    return notes.read_text().count("round") if notes.exists() else 0


async def test_a_program_continues_after_an_automatic_log_off(tmp_path: Path) -> None:
    data = tmp_path / "data"
    tokens = TokenFile(data)
    tablet = tokens.add("tablet", Role.OPERATOR, shared=True)[1]
    program = tokens.add("line control", Role.PROGRAMMER)[1]
    write_package(data / "packages" / "pkg_1", tmp_path, SCRIPT)

    def headers(token: str) -> dict[str, str]:
        return {"Authorization": f"Bearer {token}"}

    async with (
        running(data, ARCOR2_HW_LOG_OFF_AFTER=str(LOG_OFF_AFTER)) as server,
        talking(server.url, "line", additional_headers=headers(program)) as line,
        talking(server.url, additional_headers=headers(tablet)) as device,
    ):
        ivo = await line.granted("AddPerson", {"name": "Ivo", "role": "operator", "pin": PIN})
        await device.granted("SubscribeEvents", {"events": ["LogOnChanged"]})
        await device.granted("LogOn", {"person": ivo["id"], "pin": PIN})
        await device.granted("RunPackage", {"id": "pkg_1"})
        logged_off = False
        while not logged_off:
            message = device.events.pop(0) if device.events else await device.receive()
            logged_off = message.get("event") == "LogOnChanged" and "without use" in message["data"].get("reason", "")
        assert "Log on" in await device.refused("PausePackage")
        before = rounds(tmp_path)
        await until(lambda: rounds(tmp_path) > before + 20)
        await device.granted("StopPackage")
        states = []
        while "stopped" not in states:
            message = device.events.pop(0) if device.events else await device.receive()
            if message.get("event") == "PackageState":
                states.append(message["data"]["state"])
        (run,) = (await line.granted("ListRuns"))["runs"]
        assert (run["end"], run["started_by"], run["stopped_by"]) == ("stopped", "Ivo", "tablet")
