"""Metrics for Prometheus at `/metrics` (docs/reference/metrics.md)."""

import asyncio
import importlib
import shutil
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from enum import Enum
from importlib.metadata import version
from itertools import accumulate
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from litestar import Request, Response, get
from litestar.exceptions import NotAuthorizedException, NotFoundException
from litestar.handlers import HTTPRouteHandler

from arcor2_hw.data.alarms import Priority
from arcor2_hw.data.device import Connection
from arcor2_hw.data.package import PackageStateEnum
from arcor2_hw.data.packml import MachineState, UnitMode
from arcor2_hw.data.role import Role
from arcor2_hw.data.units import UnitState
from arcor2_hw.messages import translatable
from arcor2_server.access.metrics_token import MetricsToken
from arcor2_server.access.route_options import OPEN, OWN_TOKEN, ROLE
from arcor2_server.alarms.service import Alarms
from arcor2_server.alarms.system import SystemAlarms
from arcor2_server.durations import BOUNDS, Durations
from arcor2_server.execution.service import Execution
from arcor2_server.hosts.session import HostSession
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.packml.cell import PackmlCell
from arcor2_server.production.units import Units
from arcor2_server.settings import ServerSettings
from arcor2_server.storage import Storage
from arcor2_server.websocket.hub import Hub

if TYPE_CHECKING:
    from prometheus_client.core import Metric

    from arcor2_server.rest.plant_metrics import PlantMetrics

CONTENT_TYPE: Final = "text/plain; version=0.0.4"
"""Media type of the text format; Litestar adds the character set."""
MAX_DEVICES: Final = 200
"""Maximum number of devices in the metrics, so that their number of time series is bounded."""
NO_TOKEN: Final = translatable("There is no metrics token. Create one on the server with `arcor2-hw metrics token`.")
WRONG_TOKEN: Final = translatable("The metrics token is missing or wrong: Authorization: Bearer ...")


@dataclass(frozen=True, slots=True)
class Metrics:
    """Reads the metrics of the running parts."""

    settings: ServerSettings
    hub: Hub
    storage: Storage
    execution: Execution
    online: OnlineScene
    cell: PackmlCell
    units: Units
    alarms: Alarms
    system: SystemAlarms
    hosts: Mapping[str, HostSession]
    requests: Mapping[str, Durations]
    """Durations of requests by name, by websocket service."""
    plant: "Callable[[], PlantMetrics]"

    async def text(self) -> bytes:
        """Return all metrics in the text format of Prometheus."""
        exposition = await asyncio.to_thread(importlib.import_module, "prometheus_client.exposition")  # slow to import
        found = [*self._program(), *self._devices(), *self._server(), *await self.plant().read()]
        encoded: bytes = await asyncio.to_thread(lambda: exposition.generate_latest(_Registry([*found, *self._disk()])))
        return encoded

    def _program(self) -> Iterator["Metric"]:
        from prometheus_client.core import CounterMetricFamily

        yield _states(
            "program_state", "1 for the present state of the program.", PackageStateEnum, self.execution.state
        )
        yield _states("cell_state", "1 for the present PackML state of the cell.", MachineState, self.cell.state)
        yield _states("cell_mode", "1 for the present mode of the cell.", UnitMode, self.cell.mode, "mode")
        held = self.execution.hold.present is not None
        yield _gauge("program_held", "1 while the program waits for a decision after a failed action.", held)
        left = CounterMetricFamily(
            "arcor2_hw_units", "Units that have left the cell since the start of the server.", labels=["state"]
        )
        for state in UnitState:
            if state is not UnitState.IN_CELL:
                left.add_metric([state.value], self.units.left[state])
        yield left
        yield _gauge("units_in_cell", "Units in the cell.", self.units.in_cell)

    def _devices(self) -> Iterator["Metric"]:
        from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily

        active = self.alarms.active_by_priority()
        alarms = GaugeMetricFamily(
            "arcor2_hw_alarms_active", "Active alarms that are not shelved.", labels=["priority"]
        )
        for priority in Priority:
            alarms.add_metric([priority.value], active[priority])
        yield alarms
        labels = ["device", "type"]
        online = GaugeMetricFamily("arcor2_hw_device_online", "1 if the device is connected.", labels=labels)
        normal = GaugeMetricFamily("arcor2_hw_device_health_normal", "1 if the health is normal.", labels=labels)
        statuses = self.execution.board.statuses() or self.online.board.statuses()
        for status in statuses[:MAX_DEVICES]:
            connected = status.connection in (Connection.ONLINE, Connection.BACK) and status.answering
            online.add_metric([status.name, status.type], connected)
            normal.add_metric([status.name, status.type], status.health.value == "normal")
        yield online
        yield normal
        deaths = CounterMetricFamily(
            "arcor2_hw_host_failures", "Processes of devices that have ended by themselves.", labels=["session"]
        )
        for name, session in self.hosts.items():
            deaths.add_metric([name], session.deaths)
        yield deaths

    def _server(self) -> Iterator["Metric"]:
        from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, HistogramMetricFamily

        info = GaugeMetricFamily("arcor2_hw_info", "Always 1.", labels=["version"])
        info.add_metric([version("arcor2-hw")], 1)
        yield info
        clients = GaugeMetricFamily("arcor2_hw_clients", "Connected websocket clients.", labels=["role"])
        roles = [client.role for client in self.hub.clients]
        for role in Role:
            clients.add_metric([role.identifier], roles.count(role))
        yield clients
        yield _gauge("event_loop_lag_seconds", "Largest delay of the event loop in the last minute.", self.system.lag)
        refused = CounterMetricFamily(
            "arcor2_hw_requests_refused", "Requests that were refused or failed.", labels=["service", "request"]
        )
        for service, durations in self.requests.items():
            for name, count in durations.failures.items():
                refused.add_metric([service, name], count)
        yield refused
        times = HistogramMetricFamily(
            "arcor2_hw_request_duration_seconds", "Duration of websocket requests.", labels=["service", "request"]
        )
        for service, durations in self.requests.items():
            for name in durations.counts:
                times.add_metric([service, name], *_classes(durations, name))
        yield times
        writes = self.storage.durations
        saves = HistogramMetricFamily("arcor2_hw_database_write_duration_seconds", "Duration of saves.", labels=[])
        for name in writes.counts:
            saves.add_metric([], *_classes(writes, name))
        yield saves
        yield CounterMetricFamily(
            "arcor2_hw_database_write_failures", "Saves that failed.", sum(writes.failures.values())
        )

    def _disk(self) -> Iterator["Metric"]:
        """Read the disk and the process. It may block, so it runs in a thread."""
        from prometheus_client import PROCESS_COLLECTOR

        yield from PROCESS_COLLECTOR.collect()
        journal = self.settings.journal_database
        size = sum(_size(path) for path in (journal, journal.with_name(f"{journal.name}-wal")))
        yield _gauge("journal_bytes", "Size of the journal of the open document.", size)
        yield _gauge("disk_free_bytes", "Free space for the data directory.", _free(self.settings.data_dir))


class _Registry:
    def __init__(self, metrics: list["Metric"]) -> None:
        self._metrics = metrics

    def collect(self) -> list["Metric"]:
        return self._metrics


def _gauge(name: str, text: str, value: float) -> "Metric":
    from prometheus_client.core import GaugeMetricFamily

    return GaugeMetricFamily(f"arcor2_hw_{name}", text, value)


def _states(name: str, text: str, states: type[Enum], present: Enum, label: str = "state") -> "Metric":
    from prometheus_client.core import GaugeMetricFamily

    family = GaugeMetricFamily(f"arcor2_hw_{name}", text, labels=[label])
    for state in states:
        family.add_metric([state.name.lower()], state is present)
    return family


def _classes(durations: Durations, name: str) -> tuple[list[tuple[str, float]], float]:
    """Return the cumulated number of durations by upper bound, and their sum."""
    bounds = [*map(str, BOUNDS), "+Inf"]
    return list(zip(bounds, accumulate(durations.counts[name]), strict=True)), durations.sums[name]


def _size(path: Path) -> int:
    try:
        return path.stat().st_size
    except OSError:
        return 0


def _free(path: Path) -> float:
    try:
        return shutil.disk_usage(path).free
    except OSError:
        return float("nan")


def metrics_route(metrics: Metrics) -> HTTPRouteHandler:
    """Return the route. It has a token of its own; a token of a client is not accepted."""
    token = MetricsToken(metrics.settings.data_dir)

    @get("/metrics", opt={ROLE: Role.OPERATOR, OPEN: OWN_TOKEN}, include_in_schema=False)
    async def read(request: Request[Any, Any, Any]) -> Response[bytes]:
        """Return the metrics. Answer 404 without a metrics token, and 401 if the request has another one."""
        kind, _, secret = request.headers.get("authorization", "").partition(" ")
        valid = token.check(secret.strip() if kind.lower() == "bearer" else "")
        if valid is None:
            raise NotFoundException(NO_TOKEN)
        if not valid:
            raise NotAuthorizedException(WRONG_TOKEN, headers={"WWW-Authenticate": "Bearer"})
        return Response(await metrics.text(), media_type=CONTENT_TYPE)

    return read
