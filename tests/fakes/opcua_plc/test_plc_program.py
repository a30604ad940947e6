"""The fake PLC's program scan by scan, and its variables as another client sees them."""

from collections.abc import Callable

import pytest
from asyncua import Client, ua

from arcor2_fakes.opcua_plc.program import ABORTED, HOST_GONE, UNKNOWN_JOB, Host, Program, Step
from tests.fakes.conftest import FakeProcess


class Bench:
    """A program, its host and a clock controlled by the test."""

    def __init__(self) -> None:
        self.program = Program({1: 1.0}, ramp=0.1, patience=0.5)
        self.host = Host(owner=7)
        self.time = 0.0

    def run(self, seconds: float, alive: bool = True) -> list[bool]:
        """Scan every 10 ms; return whether the host was found lost."""
        found = []
        for _ in range(round(seconds / 0.01)):
            self.time += 0.01
            self.host.life += alive
            found.append(self.program.scan(self.host, self.time))
            if found[-1]:
                self.host.owner = 0  # the PLC clears the owner in its variable
        return found


@pytest.fixture
def plc() -> Bench:
    bench = Bench()
    bench.run(0.05)
    return bench


def test_a_job_needs_time_and_waits_for_its_request_to_end(plc: Bench) -> None:
    plc.host.number, plc.host.request = 1, True
    plc.run(0.9)
    assert plc.program.step is Step.BUSY
    plc.run(0.2)
    assert (plc.program.step, plc.program.done) == (Step.DONE, [1])
    plc.run(1.0)
    assert plc.program.step is Step.DONE, "a request that stays set does not start the job again"
    plc.host.request = False
    plc.run(0.02)
    assert plc.program.step is Step.IDLE


def test_a_withdrawn_request_stops_the_job(plc: Bench) -> None:
    plc.host.number, plc.host.request = 1, True
    plc.run(0.3)
    plc.host.request = False
    plc.run(0.02)
    assert (plc.program.step, plc.program.code, plc.program.moving) == (Step.STOPPING, ABORTED, True)
    plc.run(0.15)
    assert (plc.program.moving, plc.program.done) == (False, [])


def test_a_stopped_life_counter_means_a_lost_host(plc: Bench) -> None:
    plc.host.number, plc.host.request = 1, True
    plc.run(0.3)
    assert not any(plc.run(0.45, alive=False))
    found = plc.run(0.3, alive=False)
    assert found.count(True) == 1, "reported once"
    assert (plc.program.code, plc.program.moving) == (HOST_GONE, False)
    assert plc.program.done == []


def test_invalid_commands_are_ignored(plc: Bench) -> None:
    plc.host.number, plc.host.request = 9, True
    plc.run(0.05)
    assert (plc.program.step, plc.program.code) == (Step.ERROR, UNKNOWN_JOB)
    plc.host.request = False
    plc.run(0.05)
    plc.host.owner = 0
    plc.run(0.05)
    plc.host.number, plc.host.request = 1, True
    plc.run(0.2)
    assert plc.program.step is Step.IDLE, "a job started without control"


def test_the_plc_life_counter_runs_at_10_hz(plc: Bench) -> None:
    before = plc.program.life
    plc.run(1.0)
    assert 9 <= plc.program.life - before <= 11
    plc.program.live = False
    before = plc.program.life
    plc.run(0.5)
    assert plc.program.life == before


async def test_variables_are_readable_by_another_client(start_fake: Callable[..., FakeProcess]) -> None:
    fake = start_fake("opcua_plc")
    async with Client(fake.ready["url"], timeout=2) as client:
        level = client.get_node("ns=2;s=Cell.Level")
        found = await level.read_data_value()
        assert found.Value is not None
        assert (found.Value.Value, found.Value.VariantType) == (500, ua.VariantType.Int16)
        with pytest.raises(ua.UaStatusCodeError, match="BadUserAccessDenied"):
            await level.write_value(ua.DataValue(ua.Variant(1, ua.VariantType.Int16)))
        lamp = client.get_node("ns=2;s=Cell.Lamp")
        with pytest.raises(ua.UaStatusCodeError, match="BadTypeMismatch"):
            await lamp.write_value(ua.DataValue(ua.Variant(1, ua.VariantType.Int16)))
        await lamp.write_value(ua.DataValue(ua.Variant(True, ua.VariantType.Boolean)))
        assert fake.truth()["points"]["Lamp"] is True
        assert fake.truth()["written"] == [["Cell.Lamp", True]]
        fake.control.do("quality", name="Level", status="BadSensorFailure")
        with pytest.raises(ua.UaStatusCodeError, match="BadSensorFailure"):
            await level.read_value()
