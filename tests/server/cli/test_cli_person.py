"""`arcor2-hw person` changes persons with and without a running server, and reads PINs from standard input."""

import subprocess
from pathlib import Path

from arcor2_hw.data.role import Role
from arcor2_server.access.tokens import TokenFile
from arcor2_server.audit.chain import AuditFile
from arcor2_server.cli.exit_status import ExitStatus
from tests import commands
from tests.server.core.serving import running, talking

PIN = "973164825091"


def person(data: Path, *arguments: str, given: str = "") -> subprocess.CompletedProcess[str]:
    return commands.run(commands.CLI, "person", *arguments, "--data-dir", data, given=given)


async def test_persons_are_added_listed_and_removed(tmp_path: Path) -> None:
    data = tmp_path / "data"
    added = person(data, "add", "Eva", "--role", "technician", "--card", given=f"{PIN}\n0012345678\n")
    assert (added.returncode, added.stderr) == (ExitStatus.OK, "")
    assert person(data, "add", "eva", "--role", "operator", given=PIN).returncode == ExitStatus.CONFLICT
    refused = person(data, "add", "Ivo", "--role", "operator", given="1234\n")
    assert (refused.returncode, "easy to guess" in refused.stderr) == (ExitStatus.USAGE, True)
    assert "no PIN" in person(data, "add", "Ivo", "--role", "operator").stderr
    secret = TokenFile(data).add("tablet", Role.PROGRAMMER, shared=True)[1]
    headers = {"Authorization": f"Bearer {secret}"}
    async with running(data) as server, talking(server.url, additional_headers=headers) as device:
        (eva,) = (await device.granted("ListPersons"))["persons"]
        assert (eva["name"], eva["pin"], eva["card"]) == ("Eva", True, True)
        await device.granted("SubscribeEvents", {"events": ["LogOnChanged"]})
        await device.granted("LogOn", {"person": eva["id"], "pin": PIN})
        listed = person(data, "list").stdout
        assert all(word in listed for word in ("Eva", "technician", "PIN, card"))
        assert person(data, "remove", "EVA").returncode == ExitStatus.OK
        assert "removed Eva" in (await device.event("LogOnChanged"))["data"]["reason"]
        assert "Log on" in await device.refused("NewScene", {"name": "hall"})
    assert person(data, "remove", "Eva").returncode == ExitStatus.NOT_FOUND
    entries = [(entry.request, entry.target) for entry in AuditFile(data / "audit.sqlite").all()]
    assert [each for each in entries if each[0].startswith("arcor2-hw")] == [
        ("arcor2-hw person add", "Eva"),
        ("arcor2-hw person remove", "Eva"),
    ]
    assert PIN.encode() not in b"".join(path.read_bytes() for path in data.rglob("*") if path.is_file())
