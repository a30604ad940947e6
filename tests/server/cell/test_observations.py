"""Observations of devices: streams at a rate, errors, and values of the base classes."""

import asyncio
import itertools
from typing import Any

import pytest

from arcor2_hw.data.device import Observation, Quality, Reading
from arcor2_hw.data.scene import Scene
from arcor2_hw.exceptions import NotFound, Refused, Stale
from arcor2_hw.objects import IOBlock, Suction
from arcor2_hw.objects.small import MAX_POINTS, IOPoint, PointDirection, PointKind
from arcor2_server.errors import RequestRefused
from tests.runtime.conftest import scene_object
from tests.server.cell.conftest import Server, serving
from tests.server.core.serving import until

METER = """
from arcor2_hw.data.device import Observation, Quality
from arcor2_hw.exceptions import ConnectionLost

class Meter(Generic):
    _ABSTRACT = False
    lost = False
    @action
    def lose(self, *, an: str | None = None) -> None:
        Meter.lost = True
    @action
    def hold(self, *, an: str | None = None) -> None:
        time.sleep(300)
    def observations(self):
        if self.lost:
            raise ConnectionLost("{device}: the connection is lost", device=self.name)
        return [Observation("Voltage", 24.5, "V"), Observation("Current", None, "A", Quality.BAD)]
"""
STREAM = {"object_id": "obj_meter"}


async def with_meter(server: Server) -> None:
    server.types.add("Meter", METER)
    await server.open(Scene("scene", id="scn_1", objects=[scene_object(name, "Meter") for name in ("meter", "other")]))
    await server.start()


def observed(server: Server) -> list[dict[str, Any]]:
    return [event["data"] for event in server.client.got if event["event"] == "ObjectObservations"]


@serving(with_meter)
async def test_observations_are_streamed_while_an_action_runs(server: Server) -> None:
    host = server.services.online.host
    holding = asyncio.create_task(host.call("obj_meter", "hold"))
    await server.ask("StreamObservations", STREAM | {"rate": 10})
    await until(lambda: len(observed(server)) >= 5)
    first, *_ = seen = observed(server)
    assert first["object_id"] == "obj_meter"
    assert first["observations"] == [
        {"name": "Voltage", "value": 24.5, "unit": "V", "quality": "good"},
        {"name": "Current", "value": None, "unit": "A", "quality": "bad"},
    ]
    steps = [after["time_ms"] - before["time_ms"] for before, after in itertools.pairwise(seen)]
    assert sum(steps) >= (len(steps) - 1) * 100.0, "faster than requested"

    # A device that cannot be read reports the reason.
    holding.cancel()
    await host.call("obj_other", "lose")
    await until(lambda: "reason" in observed(server)[-1])
    assert observed(server)[-1]["observations"] == []
    assert observed(server)[-1]["reason"] == "meter: the connection is lost"
    assert observed(server)[-1]["values"] == {"device": "meter"}
    await server.ask("StreamObservations", STREAM | {"send": False})
    with pytest.raises(RequestRefused, match="not subscribed"):
        await server.ask("StreamObservations", STREAM | {"send": False})


@serving(with_meter)
async def test_invalid_streams_are_refused(server: Server) -> None:
    for rate in (0.1, 11.0):
        with pytest.raises(RequestRefused, match=r"0\.2 to 10 Hz"):
            await server.ask("StreamObservations", STREAM | {"rate": rate})
    with pytest.raises(NotFound):
        await server.ask("StreamObservations", {"object_id": "obj_nobody"})
    await server.ask("StopScene")
    await server.client.state("stopped")
    with pytest.raises(RequestRefused, match="offline"):
        await server.ask("StreamObservations", STREAM)


class Block(IOBlock):
    """An I/O block, of which one point is broken and one is stale."""

    def points(self) -> list[IOPoint]:
        names = ["level", "broken", "stale", *(f"p{n}" for n in range(MAX_POINTS))]
        return [IOPoint(name, PointDirection.INPUT, PointKind.ANALOG, "bar") for name in names]

    def read(self, name: str) -> Reading[bool | float]:
        if name == "stale":
            raise Stale("too old")
        return Reading.of(1.5, Quality.BAD if name == "broken" else Quality.GOOD)

    def write(self, name: str, value: bool | float) -> None:
        raise NotImplementedError


class Cup(Suction):
    """A suction cup with a vacuum sensor, unless `pressure` is None."""

    pressure: float | None = 4e4

    def on(self) -> None:
        raise NotImplementedError

    def off(self) -> None:
        raise NotImplementedError

    def part_held(self) -> bool:
        raise NotImplementedError

    def vacuum(self) -> Reading[float]:
        if self.pressure is None:
            raise Refused("no sensor")
        return Reading.of(self.pressure, Quality.UNCERTAIN)


def test_points_and_vacuum_are_observed() -> None:
    level, broken, stale, *others = Block("obj", "block").observations()
    assert level == Observation("level", 1.5, "bar")
    assert broken == Observation("broken", None, "bar", Quality.BAD)
    assert stale == Observation("stale", None, "bar", Quality.BAD)
    assert len(others) == MAX_POINTS - 3
    cup = Cup("obj", "cup")
    assert cup.observations() == [Observation("Vacuum", 4e4, "Pa", Quality.UNCERTAIN)]
    cup.pressure = None
    assert cup.observations() == []
