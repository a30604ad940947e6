"""Metrics over HTTP: the token, the documented names, values after changes, and the dashboard."""

import asyncio
import json
import re
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import httpx
import pytest
from prometheus_client.parser import text_string_to_metric_families

from arcor2_hw.data.history import HistoryState
from arcor2_hw.data.nodes import NodesData, NodeSession, NodeState, NodeStatus
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.main import app
from arcor2_server.durations import BOUNDS, Durations
from arcor2_server.rest.plant_metrics import PlantMetrics
from tests.server.core.serving import running, talking

REFERENCE = Path(__file__).parents[3] / "docs" / "reference"
ROW = re.compile(r"^\| `(\w+)` \| (\w+) \|(.*?)\| (.+) \|$", re.MULTILINE)
DOCUMENTED = {
    name: (kind, frozenset(re.findall(r"`(\w+)`", labels)))
    for name, kind, labels, _ in ROW.findall((REFERENCE / "metrics.md").read_text())
}
CLASSES = ("_bucket", "_count", "_sum")


class Parts:
    """Nodes, fleet, history, OPC UA and MQTT, all in use, with the members that the metrics read."""

    configured = connected = running = True
    ends, clients, dropped = 2, 3, 4

    def __init__(self) -> None:
        self.process = self
        since = {"since": "2026-01-02T03:04:05+00:00", "load": 0.5, "free": 7}
        used = NodeStatus("arm", NodeState.CONNECTED, **since, sessions=[NodeSession("scene", "cell", since["since"])])
        self.nodes = NodesData(True, [used, NodeStatus("never_seen", NodeState.SILENT)])

    def data(self) -> NodesData:
        return self.nodes

    async def waiting(self) -> int:
        return 5

    async def state(self) -> HistoryState:
        return HistoryState(True, hot_bytes=10, cold_bytes=20, dropped=1, problem="The disk is full.")


async def plant_metrics() -> dict[str, tuple[str, frozenset[str], dict[str, float]]]:
    """Return kind, labels and values of the metrics of a server that is connected to a plant."""
    parts: Any = Parts()
    mqtt: Any = SimpleNamespace(process=parts, connected={"JSON": True, "Sparkplug": False}, dropped=4)
    found = {}
    for family in await PlantMetrics(parts, parts, parts, parts, mqtt).read():
        name = f"{family.name}_total" if family.type == "counter" else family.name
        labels = frozenset(label for sample in family.samples for label in sample.labels)
        found[name] = family.type, labels, {"".join(each.labels.values()): each.value for each in family.samples}
    return found


async def test_metrics_of_plant_connections() -> None:
    found = await plant_metrics()
    for name, (kind, labels, _) in found.items():
        assert DOCUMENTED[name] == (kind, labels)
    values = {name.removeprefix("arcor2_hw_"): each for name, (_, _, each) in found.items()}
    assert values["node_connected"] == {"arm": 1, "never_seen": 0}
    assert values["node_load"] == {"arm": 0.5}
    assert values["fleet_waiting"] == {"": 5}
    assert values["history_recording"] == {"": 0}  # the disk is full
    assert values["history_bytes"] == {"recent": 10, "files": 20}
    assert values["plant_process_ends_total"] == {"opcua": 2, "mqtt": 2}
    assert values["mqtt_connected"] == {"json": 1, "sparkplug": 0}


async def test_metrics_follow_requests_and_need_their_own_token(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    data = tmp_path / "data"
    async with running(data) as server, httpx.AsyncClient(base_url=server.url.replace("ws", "http")) as http:
        refused = await http.get("/metrics")
        assert (refused.status_code, "arcor2-hw metrics token" in refused.json()["message"]) == (404, True)
        tokens = []
        for _ in range(2):
            assert await asyncio.to_thread(app, ["metrics", "token", "--data-dir", str(data)]) == ExitStatus.OK
            tokens.append(capsys.readouterr().out.strip())
        assert (data / "metrics-token").stat().st_mode & 0o777 == 0o600
        assert tokens[1] not in (data / "metrics-token").read_text()
        for headers in ({}, {"Authorization": f"Bearer {tokens[0]}"}, {"Authorization": f"Basic {tokens[1]}"}):
            assert (await http.get("/metrics", headers=headers)).status_code == 401

        async with talking(server.url, "eva") as eva:
            await eva.granted("NewScene", {"name": "cell"})
            await eva.refused("NewScene", {"name": "cell"})
            await eva.granted("SaveScene")
            answer = await http.get("/metrics", headers={"Authorization": f"Bearer {tokens[1]}"})
        assert answer.headers["content-type"] == "text/plain; version=0.0.4; charset=utf-8"
        samples = {
            (
                sample.name,
                *(value for label, value in sorted(sample.labels.items()) if label != "service"),
            ): sample.value
            for family in text_string_to_metric_families(answer.text)
            for sample in family.samples
            if sample.labels.get("service") != "execution"
        }
        assert samples["arcor2_hw_request_duration_seconds_count", "NewScene"] == 2
        assert samples["arcor2_hw_requests_refused_total", "NewScene"] == 1
        assert samples["arcor2_hw_requests_refused_total", "SaveScene"] == 0
        assert samples["arcor2_hw_clients", "programmer"] == 1
        assert samples["arcor2_hw_database_write_duration_seconds_count",] >= 1
        assert samples["arcor2_hw_journal_bytes",] > 0
        assert samples["arcor2_hw_disk_free_bytes",] > 0
        assert samples["arcor2_hw_cell_mode", "produce"] == 1

        found: dict[str, tuple[str, frozenset[str]]] = {}
        for family in text_string_to_metric_families(answer.text):
            name = f"{family.name}_total" if family.type == "counter" else family.name
            labels = {label for sample in family.samples for label in sample.labels} - {"le"}
            found[name] = family.type, frozenset(labels)
        # No device is online, and nothing connects the cell to a plant.
        unused = {"arcor2_hw_device_online", "arcor2_hw_device_health_normal", *await plant_metrics()}
        assert {name: each for name, each in found.items() if name not in unused} == {
            name: each for name, each in DOCUMENTED.items() if name not in unused
        }
        assert unused <= DOCUMENTED.keys()

        assert await asyncio.to_thread(app, ["metrics", "off", "--data-dir", str(data)]) == ExitStatus.OK
        assert (await http.get("/metrics", headers={"Authorization": f"Bearer {tokens[1]}"})).status_code == 404


def test_the_dashboard_uses_only_documented_metrics_and_labels() -> None:
    dashboard = json.loads((REFERENCE / "grafana-dashboard.json").read_text())
    expressions = [target["expr"] for panel in dashboard["panels"] for target in panel["targets"]]
    assert len(expressions) > 10
    for expression in expressions:
        names = re.findall(r"\b(?:arcor2_hw|process)_\w+", expression)
        assert names
        for name in names:
            base = next((name.removesuffix(end) for end in CLASSES if name.removesuffix(end) in DOCUMENTED), name)
            kind, labels = DOCUMENTED[base]
            assert (base != name) == (kind == "histogram"), expression
            used = set(re.findall(r"(\w+)=", expression)) | set(
                re.findall(r"\w+", " ".join(re.findall(r"by \((.*?)\)", expression)))
            )
            assert used <= labels | {"instance", "le"}, expression
            if kind == "counter":
                assert re.search(rf"(rate|increase)\({name}", expression), expression


def test_durations_are_counted_by_class() -> None:
    durations = Durations()
    for seconds in (0.0, BOUNDS[0], 0.3, 100.0):
        durations.add("Save", seconds)
    with pytest.raises(ValueError), durations.measure("Save"):
        raise ValueError
    assert durations.counts["Save"] == [3, 0, 0, 0, 1, 0, 0, 1]
    assert (durations.sums["Save"] > 100.3, durations.failures["Save"]) == (True, 1)
