"""The books of parts after an interruption, as clients see them."""

import os
import signal
from pathlib import Path

import pytest
from msgspec import UNSET

from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.errors import RequestRefused
from tests.runtime.test_host_parts import ONE, write_package

from .conftest import Recorder, running_server
from .test_execution_history import subscribe

CONFIRMED = {"scene_id": "scn_1", "parts": [{"number": 1, "place": "obj_arm"}]}


async def test_after_an_interruption_a_person_confirms_where_parts_are(tmp_path: Path) -> None:
    (tmp_path / "hang").touch()
    async with running_server(tmp_path / "data") as server:
        subscribe(server, "PartsChanged")
        old = Recorder("old")
        server.services.hub.add(old)  # type: ignore[arg-type]
        write_package(server.services.settings.packages_dir / "pkg_1", tmp_path, ONE)
        await server.ask("RunPackage", {"id": "pkg_1", "on_error": "hold"})
        await server.client.event("PartsChanged", lambda data: data["parts"] and "moving_to" in data["parts"][0])
        (books,) = await server.ask("GetParts")
        assert (books.parts[0].serial, books.run) == ("A-1", UNSET)
        with pytest.raises(Arcor2Error, match="while an action runs: pick"):
            await server.ask("ConfirmParts", CONFIRMED)
        host = server.services.execution._host.host
        os.kill(host.pid, signal.SIGKILL)
        await server.client.state("stopped", "PackageState")
        published = await server.client.event("PartsChanged")
        assert published["parts"] == [
            {"number": 1, "place": "obj_feeder", "serial": "A-1", "moving_to": "obj_arm", "confirmed": False}
        ]
        assert [action["action_name"] for action in published["run"]["actions"]] == ["pick"]
        assert "PartsChanged" not in str(old.got)

    async with running_server(tmp_path / "data") as server:  # as after a power cut
        subscribe(server, "PartsChanged")
        (books,) = await server.ask("GetParts")
        assert books.run.package_id == "pkg_1"
        assert [part.confirmed for part in books.parts] == [False]
        with pytest.raises(RequestRefused, match=r"Confirm where these parts are .*: A-1 \(feeder\)"):
            await server.ask("RunPackage", {"id": "pkg_1"})
        await server.ask("ConfirmParts", CONFIRMED)
        published = await server.client.event("PartsChanged")
        assert published["parts"] == [{"number": 1, "place": "obj_arm", "serial": "A-1", "confirmed": True}]
        assert "run" not in published
        assert (tmp_path / "notes").read_text().split() == ["pick"]  # nothing has moved

        (tmp_path / "hang").unlink()
        await server.ask("RunPackage", {"id": "pkg_1"})  # the gripper is not empty: the program ends
        error = await server.client.event("ProjectException")
        assert "A-1 was read at feeder, but it is expected at arm" in error["message"]
        await server.client.state("stopped", "PackageState")
        assert (tmp_path / "notes").read_text().split() == ["pick"]
