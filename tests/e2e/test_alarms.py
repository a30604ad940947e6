"""Alarms of the whole product: a failed run, acknowledging as an operator, and a killed server."""

from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.alarms import AlarmFilter, AlarmRecord
from tests.e2e.harness import Cell, running_cell, until


@pytest.fixture
async def cell(tmp_path: Path) -> AsyncIterator[Cell]:
    async with running_cell(tmp_path) as running:
        yield running


async def alarms(client: Client, show: AlarmFilter = AlarmFilter.ALL) -> list[AlarmRecord]:
    return (await client.call("ListAlarms", rpc.ListAlarmsArgs(show))).alarms


async def test_failed_run_is_one_alarm_that_survives_the_server_and_is_acknowledged(cell: Cell) -> None:
    client = await cell.client("Olga")
    _, project = await cell.open(client)
    package = await cell.build(client, project)
    # Without a board, the reader finds no code.
    await client.call("RunPackage", rpc.RunPackageArgs(package))
    await until(lambda: alarms(client), "the alarm of the reader", 60.0)
    [alarm] = await alarms(client, AlarmFilter.RETAINED)
    assert (alarm.object_name, alarm.action, alarm.run) == ("reader", "scan", 1)
    assert alarm.text == "No code was read."
    assert alarm.remedy
    assert not alarm.active

    await cell.kill("server")
    await cell.restart_server()
    client = await cell.client("Olga")
    assert await alarms(client, AlarmFilter.RETAINED) == [alarm]
    await client.call("AcknowledgeAlarm", rpc.AcknowledgeAlarmArgs(alarm.number, "board put in"))
    assert await alarms(client, AlarmFilter.RETAINED) == []
    [known] = await alarms(client)
    assert (known.acknowledged_by, known.note) == ("Olga", "board put in")

    await cell.kill("server")
    await cell.restart_server()
    client = await cell.client("Olga")
    assert await alarms(client) == [known]
    [worst] = (await client.call("AlarmStatistics")).by_count
    assert (worst.object_name, worst.count) == ("reader", 1)
