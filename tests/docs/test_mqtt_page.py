"""The page about MQTT matches the options, limits, metrics and topics of the MQTT clients."""

import re
from pathlib import Path
from typing import Any

from arcor2_hw.data.device import Connection
from arcor2_hw.mqtt import edge_node, link, messages as m, plain
from arcor2_hw.mqtt.cell import _NOT_ALLOWED, CellState
from arcor2_hw.plant.messages import STALE_AFTER, DeviceInfo, DeviceState, Update
from arcor2_server.cli.main import app
from arcor2_server.mqtt import service
from arcor2_server.plant import process

PAGE = (Path(__file__).parents[2] / "docs" / "how-to" / "mqtt.md").read_text()
SETUP = m.Setup(m.Broker("localhost", 1883), m.Sparkplug("group", "node"), "prefix", "/nowhere", "0.1")


def test_the_page_states_the_limits() -> None:
    numbers = {
        r"up to (\d+) values are stored": edge_node.MAX_WAITING,
        r"up to (\d+) results and changes": plain.MAX_EVENTS,
        r"no new value for (\d+) s": STALE_AFTER,
        r"does not answer for (\d+) s": STALE_AFTER,
        r"tried again after (\d+) s": link.FIRST_PAUSE,
        r"`offline` after (\d+) s": 1.5 * link.KEEP_ALIVE,
        r"After (\d+) s the alarm `mqtt_broker_lost`": service.ALARM_AFTER,
        r"after (\d+) ends in a row": process.ALARM_AFTER,
    }
    for pattern, number in numbers.items():
        (found,) = re.findall(pattern.replace(" ", r"\s+"), PAGE)
        assert float(found) == number, pattern
    assert re.findall(r"later after up to (\d+) s", PAGE) == [f"{link.MAX_PAUSE:.0f}"] * 2
    named = re.findall(r"characters `([^`]*)`", PAGE)[0].split()
    assert set(named) == _NOT_ALLOWED - {"\0"}


def test_the_options_exist() -> None:
    named = set(re.findall(r"--mqtt[\w-]*", PAGE))
    help_text = " ".join(str(each.name) for each in app["serve"].assemble_argument_collection())
    assert len(named) == 5
    assert [option for option in named if option not in help_text] == []


def test_the_page_names_all_metrics_and_topics() -> None:
    cell, nothing = CellState(), lambda _: None
    node, json = edge_node.EdgeNode(SETUP, cell, nothing), plain.PlainJson(SETUP, cell, nothing)
    update = Update(devices=[DeviceInfo("obj_1", "arm", "UR5e")], states={"obj_1": DeviceState(Connection.ONLINE)})
    changes: Any = cell.apply(update)
    node.changed(changes)
    json.changed(changes)
    metrics = {name for owner in node._owners.values() for name in owner.metrics} | {"Node Control/Rebirth"}
    full = PAGE.replace("`/", "`Properties/")
    assert {name for name in metrics if f"`{name}`" not in full} == set()
    for topic in ("status", "state", "counts", "alarms", "alarms/changed", "results"):
        assert f"| `{topic}` |" in PAGE
