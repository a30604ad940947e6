"""Hold-to-run motion of the fake UR: the arm stops when any process freezes or dies."""

import asyncio
import contextlib
import math
import os
import re
import signal
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.operation import RobotHoldData
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.robot import Joint
from arcor2_hw.testing.own_time import Instant, own_time
from tests import forked_children
from tests.drivers.universal_robots.conftest import FakeUr
from tests.e2e.harness import until
from tests.server.core.serving import ServerProcess, running

STOP_TIMEOUT = 5.0
"""Time limit for standstill, s. Without a stop the arm would move for about 20 s. Benchmarks measure the time."""
ATTEMPTS = 5
UP_SLOWLY = Position(0.0, 0.0, 0.05)
LATE = re.compile("not renewed in time|ms late|had expired|has ended|is ending|still stopping")
"""Answers to a client that renews too late."""
FAST = 0.2
"""Speed of the TCP that a motion at the speed limit exceeds, m/s."""
STANDSTILL_TIME = 0.4
"""Time for which an arm must stay stopped, s."""


@pytest.fixture(scope="module")
def module_fake() -> Iterator[FakeUr]:
    fake = FakeUr("--time-scale", "0.1")
    yield fake
    fake.end()


@pytest.fixture
def fake(module_fake: FakeUr) -> FakeUr:
    module_fake.reset()
    return module_fake


class Site:
    """A server with the arm online, and a connection to the arm's control channel."""

    def __init__(self, fake: FakeUr, server: ServerProcess, client: Client) -> None:
        self.fake = fake
        self.server = server
        self.client = client
        self.robot = ""
        self.hold = 0
        self.held: RobotHoldData | None = None
        """Latest state of a hold."""

    async def start(self) -> None:
        await self.client.call("NewScene", rpc.NewSceneArgs("scene"))
        settings = [Parameter("host", "string", f'"{self.fake.host}"'), Parameter("payload_mass", "double", "0.5")]
        await self.client.call("AddObjectToScene", rpc.AddObjectToSceneArgs("arm", "UR5e", Pose(), settings))
        self.robot = (await self.client.next_event("SceneObjectChanged")).data.id
        await self.client.call("SubscribeEvents", rpc.SubscribeEventsArgs({"RobotHold"}))
        await self.client.call("StartScene")
        while (await self.client.next_event("SceneState")).data.state != "started":
            pass

    async def listen(self) -> None:
        async for event in self.client.events():
            if event.event == "RobotHold":
                self.held = event.data

    def is_moving(self) -> bool:
        return max(map(abs, self.fake.truth()["qd"])) > 1e-3

    async def assert_stops(self, since: Instant) -> None:
        """Assert that the arm stops in time, and stays stopped."""
        while self.is_moving():
            assert not since.is_past(STOP_TIMEOUT), f"the arm still moves after {STOP_TIMEOUT:g} s"
            await asyncio.sleep(0.005)
        await self.assert_standstill()

    async def assert_standstill(self) -> None:
        at = self.fake.truth()["q"]
        end = time.monotonic() + STANDSTILL_TIME
        while time.monotonic() < end:
            assert not self.is_moving()
            await asyncio.sleep(0.02)
        assert self.fake.truth()["q"] == pytest.approx(at, abs=1e-4)

    async def assert_refused(self, jogger: "Jogger", since: float) -> None:
        """Assert that the server refuses all requests of the client after `since`, and that the arm does not move."""
        await until(lambda: len(jogger.answers(since)) > 5, "the client continues")
        assert all("refused" in answer for answer in jogger.answers(since)), jogger.answers(since)
        await self.assert_standstill()

    def host(self) -> int:
        """Return the cell host that holds the arm."""
        return forked_children.children(self.server.process.pid, "arcor2_hw.runtime.host")[0].pid

    async def jog(self, *, new: bool = False, valid_ms: int = 300, **motion: Any) -> float:
        self.hold += new
        answer = await self.client.jog_robot(
            robot_id=self.robot, hold=self.hold, sent_ms=time.monotonic() * 1e3, valid_ms=valid_ms, **motion
        )
        return answer.scale

    async def teach(self) -> None:
        """Hold hand teaching."""
        sent_ms = time.monotonic() * 1e3
        await self.client.hold_hand_teaching(robot_id=self.robot, hold=self.hold, sent_ms=sent_ms, valid_ms=300)

    @contextlib.asynccontextmanager
    async def holding(self, renew: Callable[[], Awaitable[Any]]) -> AsyncIterator["Hold"]:
        """Hold the button in this context, then release it. If a busy machine renews too late, press again."""
        held = Hold()

        async def renewed() -> None:
            press = self.hold
            try:
                held.answers.append(await renew())
            except RequestFailed as error:
                if not LATE.search(str(error)):
                    held.refusal = held.refusal or str(error)
                elif press == self.hold:
                    self.hold += 1

        async def renewing() -> None:
            async with asyncio.TaskGroup() as renewals:
                while not held.released and not held.refusal:
                    renewals.create_task(renewed())
                    await asyncio.sleep(0.05)

        self.hold += 1
        task = asyncio.create_task(renewing())
        try:
            yield held
        finally:
            held.released = True
            await task


class Hold:
    """Answers of the server while the button is held, and the reason if the hold is refused."""

    def __init__(self) -> None:
        self.released = False
        self.answers: list[Any] = []
        self.refusal = ""


@contextlib.asynccontextmanager
async def running_site(fake: FakeUr, directory: Path) -> AsyncIterator[Site]:
    async with running(directory / "data") as server:
        client = Client(server.url, "watcher", reconnect=False)
        async with client:
            found = Site(fake, server, client)
            await found.start()
            listening = asyncio.create_task(found.listen())
            try:
                yield found
            finally:
                listening.cancel()


class Jogger:
    """A client in a separate process that holds the arm."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process
        self.lines: list[str] = []
        self._listening = asyncio.create_task(self._listen())

    async def _listen(self) -> None:
        assert self.process.stdout is not None
        while line := (await self.process.stdout.readline()).decode().strip():
            self.lines.append(line)

    def answers(self, since: float = 0.0) -> list[str]:
        """Return the answers to the requests sent after `since`."""
        answers = [line.split(maxsplit=1) for line in self.lines]
        return [answer for sent, answer in answers if float(sent) > since]

    async def wait_for_answer(self, site: Site) -> None:
        """Wait until the arm moves or a request is refused."""
        await until(lambda: site.is_moving() or any("refused" in one for one in self.answers()), "an answer")

    async def end(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()
        await self.process.wait()
        await self._listening


async def _jogger(site: Site) -> Jogger:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "tests.e2e.jogging_client", site.server.url, site.robot),
        stdout=asyncio.subprocess.PIPE,
    )
    return Jogger(process)


@contextlib.asynccontextmanager
async def jogging(site: Site) -> AsyncIterator[Jogger]:
    """Start a client that moves the arm; on a machine so busy that it renews too late, start another one."""
    for _ in range(ATTEMPTS):
        jogger = await _jogger(site)
        try:
            await jogger.wait_for_answer(site)
            await asyncio.sleep(0.3)
            if site.is_moving() and site.held is not None and site.held.held:
                yield jogger
                return
        finally:
            await jogger.end()
    pytest.fail(f"the arm does not move: {list(dict.fromkeys(jogger.answers()))}")


async def _freeze(pid: int) -> float:
    """Suspend a process. Return the monotonic time at which it was suspended, s."""
    os.kill(pid, signal.SIGSTOP)
    await until(lambda: psutil.Process(pid).status() == psutil.STATUS_STOPPED, "the process is suspended")
    return time.monotonic()


async def test_the_arm_stops_when_any_process_freezes_or_dies(fake: FakeUr, tmp_path: Path) -> None:
    async with running_site(fake, tmp_path) as site:
        await _check_frozen_client(site)
        await _check_frozen_server(site)
        await _check_frozen_host(site)
        async with jogging(site):
            start = own_time()
            site.server.process.kill()
            await site.assert_stops(start)


async def _check_frozen_client(site: Site) -> None:
    async with jogging(site) as jogger:
        start = own_time()
        frozen = await _freeze(jogger.process.pid)
        await site.assert_stops(start)
        await until(lambda: site.held is not None and not site.held.held, "the end of the hold")
        assert site.held is not None
        assert "not renewed in time" in site.held.reason
        jogger.process.send_signal(signal.SIGCONT)  # the client continues to send requests
        await site.assert_refused(jogger, frozen)


async def _check_frozen_server(site: Site) -> None:
    """Check that the arm stops, and that requests handled after the suspension do not move it."""
    async with jogging(site) as jogger:
        start = own_time()
        frozen = await _freeze(site.server.process.pid)
        try:
            await site.assert_stops(start)
        finally:
            site.server.process.send_signal(signal.SIGCONT)
        await site.assert_refused(jogger, frozen)


async def _check_frozen_host(site: Site) -> None:
    """Check that the controller's watchdog stops the arm, and that requests that waited for the host do not move it."""
    async with jogging(site) as jogger:
        host = site.host()
        start = own_time()
        frozen = await _freeze(host)
        try:
            await site.assert_stops(start)
        finally:
            os.kill(host, signal.SIGCONT)
        await site.assert_refused(jogger, frozen)


async def _highest_speed(site: Site, seconds: float, **motion: Any) -> tuple[float, float]:
    """Hold until the arm has moved for `seconds` and exceeded `FAST`. Return the highest speed, m/s, and lowest scale.

    The arm measures its speed with its own clock. On a busy machine, the arm slows down between renewals.
    """
    poses: list[tuple[float, list[float]]] = []
    speeds: list[float] = []
    moved = 0.0

    def moved_long_enough() -> bool:
        nonlocal moved
        truth = site.fake.truth()
        at, pose = truth["timestamp"], truth["tcp_pose"][:3]
        if poses and at > poses[-1][0] + 0.02:
            speeds.append(math.dist(pose, poses[-1][1]) / (at - poses[-1][0]))
            moved += (at - poses[-1][0]) * (speeds[-1] > 0.01)
        if not poses or at > poses[-1][0] + 0.02:
            poses.append((at, pose))
        return moved > seconds and max(speeds) > FAST

    async with site.holding(lambda: site.jog(**motion)) as held:
        await until(moved_long_enough, "the arm has moved long enough")
    await site.jog(valid_ms=0)
    assert not site.is_moving()
    assert not held.refusal
    return max(speeds), min(held.answers)


async def _check_hand_teaching(site: Site) -> None:
    """Check that the arm can be moved by hand while the button is held, and is stiff after the release."""
    async with site.holding(site.teach):
        await until(lambda: site.fake.truth()["freedrive"], "the arm can be moved by hand")
    await until(lambda: not site.fake.truth()["freedrive"], "the arm is stiff again")
    with pytest.raises(RequestFailed, match=r"(motion|hold) has ended|not renewed"):
        await site.teach()


async def _check_jogging(site: Site) -> None:
    """Hold until the arm moves, then release."""
    async with site.holding(lambda: site.jog(linear=UP_SLOWLY)) as held:
        await until(site.is_moving, "the arm moves")
    assert set(held.answers) == {1.0}
    await site.jog(valid_ms=0)


async def test_the_tcp_stays_below_the_speed_limit_and_protective_stops_are_acknowledged(
    fake: FakeUr, tmp_path: Path
) -> None:
    async with running_site(fake, tmp_path) as site:
        client = site.client
        await client.call("WriteLock", rpc.WriteLockArgs(site.robot))
        await _check_jogging(site)
        fastest, _ = await _highest_speed(site, 0.5, linear=Position(0.0, 0.0, -0.6))
        assert FAST < fastest < 0.255
        turn = [Joint("shoulder_pan_joint", 1.0)]
        fastest, scale = await _highest_speed(site, 0.5, joints=turn)
        assert FAST < fastest < 0.255
        assert scale < 0.9

        await _check_hand_teaching(site)

        async with site.holding(lambda: site.jog(joints=turn)) as held:
            await until(site.is_moving, "the arm turns")
            fake.do("protective_stop")
            await until(lambda: held.refusal, "the hold is refused")
        assert "protective stop" in held.refusal
        with pytest.raises(RequestFailed, match="protective stop"):
            await site.jog(new=True, linear=UP_SLOWLY)
        await site.assert_stops(own_time())

        async def acknowledged() -> bool:
            with contextlib.suppress(RequestFailed):  # at first the controller refuses to unlock it
                await client.call("AcknowledgeStop", rpc.AcknowledgeStopArgs(site.robot))
                return True
            return False

        await until(acknowledged, "the stop is acknowledged")
        assert fake.truth()["safety"] == "NORMAL"
        await site.assert_standstill()
        with pytest.raises(RequestFailed, match="no stop that could be acknowledged"):
            await client.call("AcknowledgeStop", rpc.AcknowledgeStopArgs(site.robot))
        await _check_jogging(site)
