"""Metrics of nodes, fleet, history, OPC UA and MQTT. Only those in use exist."""

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Final, Protocol

from arcor2_hw.data.base import Unset
from arcor2_hw.data.nodes import NodeState, NodeStatus
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.history.service import History
from arcor2_server.nodes.board import NodeBoard
from arcor2_server.opcua.service import OpcUa
from arcor2_server.plant.process import PlantProcess

if TYPE_CHECKING:
    from prometheus_client.core import Metric

    from arcor2_server.mqtt.service import Mqtt  # few servers need it

MAX_NODES: Final = 100
"""Maximum number of nodes in the metrics, so that their number of time series is bounded."""


class Fleet(Protocol):
    """The connection to the fleet."""

    connected: bool

    @property
    def configured(self) -> bool:
        """Whether the cell belongs to a fleet."""

    async def waiting(self) -> int:
        """Return the number of results that wait to be sent. Raise StorageError if it cannot be read."""


@dataclass(frozen=True, slots=True)
class PlantMetrics:
    """Reads the metrics of the running parts. mqtt: None without a broker."""

    nodes: NodeBoard
    fleet: Fleet
    history: History
    opcua: OpcUa
    mqtt: "Mqtt | None"

    async def read(self) -> "list[Metric]":
        """Return the metrics."""
        return [*self._nodes(), *await self._fleet(), *await self._history(), *self._processes()]

    def _nodes(self) -> "Iterator[Metric]":
        nodes = self.nodes.data().nodes[:MAX_NODES]
        if not nodes:
            return

        def family(name: str, text: str, values: Mapping[str, float]) -> "Metric":
            return _gauge(f"node_{name}", text, values, "node")

        def known(field: str) -> dict[str, float]:
            found = {node.name: getattr(node, field) for node in nodes}
            return {name: value for name, value in found.items() if not isinstance(value, Unset)}

        def usable(node: NodeStatus) -> bool:
            return node.state is NodeState.CONNECTED

        yield family(
            "connected", "1 if the node announces itself and can be used.", {each.name: usable(each) for each in nodes}
        )
        yield family("sessions", "Scenes and programs on the node.", {each.name: len(each.sessions) for each in nodes})
        yield family("load", "Load of the last minute, per processor core.", known("load"))
        yield family("disk_free_bytes", "Free space of the disk of the node.", known("free"))

    async def _fleet(self) -> "list[Metric]":
        if not self.fleet.configured:
            return []
        found = [_gauge("fleet_connected", "1 while the broker of the fleet is connected.", self.fleet.connected)]
        try:
            waiting = await self.fleet.waiting()
        except Arcor2Error:  # the database cannot be reached; the metric is then missing
            return found
        return [*found, _gauge("fleet_waiting", "Results that wait to be sent to the fleet.", waiting)]

    async def _history(self) -> "list[Metric]":
        if not self.history.configured:
            return []
        try:
            state = await self.history.state()
        except Arcor2Error:
            return [_gauge("history_recording", "1 while the history is recorded.", False)]
        sizes = {"recent": state.hot_bytes, "files": state.cold_bytes}
        return [
            _gauge("history_recording", "1 while the history is recorded.", state.recording and not state.problem),
            _gauge("history_bytes", "Size of the history.", sizes, "part"),
            _counter("history_dropped", "Values that were lost because they could not be stored.", state.dropped),
        ]

    def _processes(self) -> "Iterator[Metric]":
        processes: dict[str, PlantProcess] = {}
        if self.opcua.process is not None:
            processes["opcua"] = self.opcua.process
        if self.mqtt is not None and self.mqtt.process is not None:
            processes["mqtt"] = self.mqtt.process
        if not processes:
            return
        running = {name: process.running for name, process in processes.items()}
        yield _gauge("plant_process_running", "1 while the process for plant systems is running.", running, "interface")
        ends = {name: process.ends for name, process in processes.items()}
        yield _counter("plant_process_ends", "Ends of the process for plant systems.", ends, "interface")
        if "opcua" in processes:
            yield _gauge("opcua_clients", "Connections of OPC UA clients.", self.opcua.clients)
        if self.mqtt is not None and "mqtt" in processes:
            links = {link.lower(): connected for link, connected in self.mqtt.connected.items()}
            yield _gauge("mqtt_connected", "1 while connected to the MQTT broker.", links, "link")
            yield _counter("mqtt_dropped", "Values that were dropped because too many waited.", self.mqtt.dropped)


def _gauge(name: str, text: str, value: float | Mapping[str, float], label: str = "") -> "Metric":
    from prometheus_client.core import GaugeMetricFamily

    return _filled(GaugeMetricFamily, name, text, value, label)


def _counter(name: str, text: str, value: float | Mapping[str, float], label: str = "") -> "Metric":
    from prometheus_client.core import CounterMetricFamily

    return _filled(CounterMetricFamily, name, text, value, label)


def _filled(kind: Any, name: str, text: str, value: float | Mapping[str, float], label: str) -> "Metric":
    """Return a metric with one value, or with one for each value of its label."""
    family = kind(f"arcor2_hw_{name}", text, labels=[label] if label else [])
    for key, each in value.items() if isinstance(value, Mapping) else [("", value)]:
        family.add_metric([key] if label else [], each)
    found: Metric = family
    return found
