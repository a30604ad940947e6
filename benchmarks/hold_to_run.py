"""Hold-to-run motion: from the last renewal of a jog to standstill, and the duration of a renewal."""

import asyncio
import time
from pathlib import Path
from typing import Any, Final

import msgspec

from arcor2_hw.client import Client
from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.parameter import Parameter
from benchmarks import server_process
from benchmarks.metrics import Metric, Report, median, percentile
from benchmarks.operation import scene_state

JOGS: Final = 100
VALID_MS: Final = 300
"""Deadman timeout; the longest permitted, ms."""
PERIOD: Final = 0.1
RENEWALS: Final = 5
"""Number of renewals of each jog, after control was taken."""
SPEED: Final = 0.25
STANDSTILL: Final = 1e-3
"""Joint speed below which the arm is at standstill, rad/s."""
STOPS_WITHIN: Final = 3.0
"""Time limit of the standstill after the last renewal, s."""


class Fake:
    """Open control channel of the fake, for requests every few milliseconds."""

    def __init__(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        self._reader, self._writer = reader, writer

    @classmethod
    async def open(cls, control: str) -> "Fake":
        """Connect to the channel."""
        host, _, port = control.rpartition(":")
        return cls(*await asyncio.open_connection(host, int(port), limit=1 << 24))

    def close(self) -> None:
        """Disconnect."""
        self._writer.close()

    async def moving(self) -> bool:
        """Return whether any joint moves."""
        self._writer.write(msgspec.json.encode({"id": 1, "do": "truth"}) + b"\n")
        answer: dict[str, Any] = msgspec.json.decode(await self._reader.readline())
        return bool(max(map(abs, answer["data"]["qd"])) > STANDSTILL)


class Jogger:
    """Jogs with a number of renewals, then stops renewing."""

    def __init__(self, client: Client, robot: str) -> None:
        self._client, self._robot = client, robot
        self._hold = 0
        self.renewals: list[float] = []
        self._pending: list[asyncio.Task[None]] = []

    async def _renew(self, up: float, valid_ms: int) -> None:
        began = time.monotonic()
        await self._client.jog_robot(
            robot_id=self._robot,
            hold=self._hold,
            sent_ms=began * 1e3,
            valid_ms=valid_ms,
            linear=Position(0.0, 0.0, up),
        )
        self.renewals.append(time.monotonic() - began)

    async def hold(self, up: float, renewals: int) -> float:
        """Jog up (or down) with a number of renewals; return the time of the last renewal."""
        self._hold += 1
        for number in range(renewals):
            if number:
                await asyncio.sleep(PERIOD)
            sent = time.monotonic()
            self._pending.append(asyncio.create_task(self._renew(up, VALID_MS)))
        return sent

    async def settle(self) -> int:
        """Wait for all responses; return the number of refused renewals, which were late on a busy machine."""
        outcomes = await asyncio.gather(*self._pending, return_exceptions=True)
        self._pending.clear()
        return sum(isinstance(outcome, BaseException) for outcome in outcomes)


async def run(report: Report, directory: Path, host: str, control: str) -> None:
    """Measure jogs that are no longer renewed, half of them upwards."""
    fake = await Fake.open(control)
    async with server_process.server(directory / "hold_to_run") as (url, _), Client(url, "bench") as client:
        await client.call("NewScene", rpc.NewSceneArgs("robot"))
        settings = [Parameter("host", "string", f'"{host}"'), Parameter("payload_mass", "double", "0.5")]
        await client.call("AddObjectToScene", rpc.AddObjectToSceneArgs("robot", "UR5e", Pose(), settings))
        robot = (await client.next_event("SceneObjectChanged")).data.id
        await client.call("StartScene")
        await scene_state(client, "started")
        await client.call("WriteLock", rpc.WriteLockArgs(robot))
        jogger = Jogger(client, robot)
        await jogger.hold(SPEED / 10.0, 20)  # takes control
        await jogger.settle()
        samples: list[float] = []
        refused = skipped = 0
        jogger.renewals.clear()
        while len(samples) < JOGS:
            await asyncio.sleep(VALID_MS / 1e3 + 0.2)
            sent = await jogger.hold(SPEED if (len(samples) + skipped) % 2 == 0 else -SPEED, RENEWALS)
            await asyncio.sleep(0.05)
            if not await fake.moving():
                skipped += 1
                refused += await jogger.settle()
                if skipped > JOGS:
                    raise RuntimeError("The arm does not move.")
                continue
            while await fake.moving():
                if time.monotonic() - sent > STOPS_WITHIN:
                    raise RuntimeError("The arm does not stop.")
                await asyncio.sleep(0.001)
            samples.append(time.monotonic() - sent)
            refused += await jogger.settle()
        await client.call("StopScene")
        await scene_state(client, "stopped")
    fake.close()
    ms = [sample * 1e3 for sample in samples]
    note = f"median {median(ms):.0f} ms, worst {max(ms):.0f} ms, of which {VALID_MS} ms are the deadman timeout"
    if skipped:
        note += f"; {skipped} jogs ended earlier, {refused} renewals were late: the machine was busy"
    report.add(Metric("jog_missed_to_rest_p99_ms", percentile(ms, 99), len(ms), note))
    renewals = [renewal * 1e3 for renewal in jogger.renewals]
    note = f"99th percentile {percentile(renewals, 99):.1f} ms"
    report.add(Metric("jog_renewal_ms", median(renewals), len(renewals), note))
