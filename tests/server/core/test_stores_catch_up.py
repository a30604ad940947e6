"""Alarms and runs that could not be stored are stored with the next change, or when the server ends."""

from pathlib import Path
from unittest.mock import Mock

import pytest

from arcor2_hw.data.rpc import ListAlarmsArgs
from arcor2_hw.exceptions import DatabaseUnreachable
from arcor2_hw.messages import Message
from arcor2_server.alarms.kinds import AlarmKinds
from arcor2_server.alarms.service import Alarms
from arcor2_server.execution.runs import Runs, RunStart
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from arcor2_server.storage.alarms import AlarmStore
from arcor2_server.storage.shared_data import SharedData


@pytest.mark.parametrize("ended", [False, True])
async def test_alarms_and_runs_of_an_outage_are_stored(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, ended: bool
) -> None:
    storage = await Storage.open(ServerSettings(data_dir=tmp_path))
    store = AlarmStore(tmp_path / "alarms.sqlite", storage)
    await store.open()
    alarms = Alarms(Mock(), store, AlarmKinds(lambda _: None), lambda: 0)
    runs = Runs(Mock())
    await alarms.open()
    await runs.open(SharedData(storage))
    with monkeypatch.context() as outage:
        outage.setattr(storage, "writing", Mock(side_effect=DatabaseUnreachable))
        outage.setattr(store, "_put", Mock(side_effect=OSError("full")))
        alarms.system("disk_nearly_full", True, Message.of("The disk is full."))
        await alarms.flush()
        run = runs.begin("pkg", RunStart(), temporary=True)
        await runs.close()
    assert (await store.all(), await SharedData(storage).runs(10)) == ([], [])
    if not ended:
        alarms.system("server_overloaded", True)
        runs.begin("pkg", RunStart(), temporary=True)
    await alarms.close()
    await runs.close()
    assert [each.code for each in await store.all()] == [
        "disk_nearly_full", *(() if ended else ("server_overloaded",))
    ]  # fmt: skip
    assert [each.number for each in await SharedData(storage).runs(10)] == [run, *(() if ended else (run + 1,))]
    assert len(await alarms.find(ListAlarmsArgs())) == (1 if ended else 2)
    await store.close()
    await storage.close()
