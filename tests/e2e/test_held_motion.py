"""Hold-to-run motion of the fake UR: the arm stops when any process freezes or dies."""

import asyncio
import contextlib
import itertools
import math
import os
import signal
import sys
import time
from collections.abc import AsyncIterator, Callable, Iterator
from pathlib import Path
from typing import Any

import psutil
import pytest

from arcor2_hw.client import Client, RequestFailed
from arcor2_hw.data import rpc
from arcor2_hw.data.geometry import Pose, Position
from arcor2_hw.data.parameter import Parameter
from arcor2_hw.data.robot import Joint
from arcor2_hw.testing.own_time import Instant, own_time
from tests.drivers.universal_robots.conftest import FakeUr
from tests.e2e.harness import until
from tests.server.core.serving import ServerProcess, running

pytestmark = [pytest.mark.timeout(120), pytest.mark.alone]

RESTS_WITHIN = 0.5
"""Seconds from the moment at which somebody freezes."""
ATTEMPTS = 5
SLOWLY_UP = Position(0.0, 0.0, 0.05)
SETTLED = 0.4
"""Seconds to look whether an arm stays at rest."""


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
    """A server with the arm online, and who looks at the arm itself."""

    def __init__(self, fake: FakeUr, server: ServerProcess, client: Client) -> None:
        self.fake = fake
        self.server = server
        self.client = client
        self.robot = ""
        self.hold = 0

    async def start(self) -> None:
        await self.client.call("NewScene", rpc.NewSceneArgs("scene"))
        settings = [Parameter("host", "string", f'"{self.fake.host}"'), Parameter("payload_mass", "double", "0.5")]
        await self.client.call("AddObjectToScene", rpc.AddObjectToSceneArgs("arm", "UR5e", Pose(), settings))
        self.robot = (await self.client.next_event("SceneObjectChanged")).data.id
        await self.client.call("SubscribeEvents", rpc.SubscribeEventsArgs({"RobotHold"}))
        await self.client.call("StartScene")
        while (await self.client.next_event("SceneState")).data.state != "started":
            pass

    def moving(self) -> bool:
        return max(map(abs, self.fake.truth()["qd"])) > 1e-3

    async def rests(self, since: Instant) -> None:
        """The arm comes to rest in time, and stays there."""
        while self.moving():
            late = own_time() - since
            assert late < RESTS_WITHIN, f"it moves {late:.2f} s after somebody froze"
            await asyncio.sleep(0.005)
        await self.stays()

    async def stays(self) -> None:
        at = self.fake.truth()["q"]
        end = time.monotonic() + SETTLED
        while time.monotonic() < end:
            assert not self.moving()
            await asyncio.sleep(0.02)
        assert self.fake.truth()["q"] == pytest.approx(at, abs=1e-4)

    async def is_refused(self, jogger: "Jogger") -> None:
        """The client goes on, but for the answers that were under way it is refused, and nothing moves."""
        await until(lambda: any("refused" in line for line in jogger.said), "a refusal")
        jogger.said.clear()
        await until(lambda: len(jogger.said) > 5, "the client goes on")
        assert all("refused" in line for line in jogger.said)
        await self.stays()

    def host(self) -> int:
        """The cell host that holds the arm."""
        children = psutil.Process(self.server.process.pid).children()
        hosts = [one for one in children if "arcor2_hw.runtime.host" in " ".join(one.cmdline())]
        return min(hosts, key=lambda one: one.create_time()).pid

    async def jog(self, *, new: bool = False, valid_ms: int = 300, **motion: Any) -> float:
        self.hold += new
        answer = await self.client.jog_robot(
            robot_id=self.robot, hold=self.hold, sent_ms=time.monotonic() * 1e3, valid_ms=valid_ms, **motion
        )
        return answer.scale

    async def begin(self) -> None:
        """Press and go on until the arm moves: control has to be taken first."""
        renewals = [asyncio.create_task(self.jog(new=True, linear=SLOWLY_UP))]
        while not any(renewal.done() for renewal in renewals):
            await asyncio.sleep(0.1)
            renewals.append(asyncio.create_task(self.jog(linear=SLOWLY_UP)))
        assert set(await asyncio.gather(*renewals)) == {1.0}


@contextlib.asynccontextmanager
async def site(fake: FakeUr, directory: Path) -> AsyncIterator[Site]:
    async with running(directory / "data") as server:
        client = Client(server.url, "watcher", reconnect=False)
        async with client:
            found = Site(fake, server, client)
            await found.start()
            yield found


class Jogger:
    """The client that holds the arm, a process of its own."""

    def __init__(self, process: asyncio.subprocess.Process) -> None:
        self.process = process
        self.said: list[str] = []
        self._listening = asyncio.create_task(self._listen())

    async def _listen(self) -> None:
        assert self.process.stdout is not None
        while line := (await self.process.stdout.readline()).decode().strip():
            self.said.append(line)

    async def answered(self, place: Site) -> None:
        """The arm moves, or will not."""
        await until(lambda: place.moving() or any("refused" in line for line in self.said), "an answer", 20.0)

    async def end(self) -> None:
        with contextlib.suppress(ProcessLookupError):
            self.process.kill()
        await self.process.wait()
        await self._listening


async def _jogger(place: Site) -> Jogger:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "tests.e2e.jogging_client", place.server.url, place.robot),
        stdout=asyncio.subprocess.PIPE,
    )
    return Jogger(process)


@contextlib.asynccontextmanager
async def jogging(place: Site) -> AsyncIterator[Jogger]:
    """A client that holds the arm, which moves; on a machine so busy that it renews too late, another one."""
    for _ in range(ATTEMPTS):
        jogger = await _jogger(place)
        try:
            await jogger.answered(place)
            await asyncio.sleep(0.3)
            if place.moving():
                yield jogger
                return
        finally:
            await jogger.end()
    pytest.fail(f"the arm does not move: {list(dict.fromkeys(jogger.said))}")


async def test_the_arm_stops_when_any_process_freezes_or_dies(fake: FakeUr, tmp_path: Path) -> None:
    async with site(fake, tmp_path) as place:
        await _a_client_that_freezes(place)
        await _a_server_that_freezes(place)
        await _a_host_that_freezes(place)
        async with jogging(place):
            began = own_time()
            place.server.process.kill()
            await place.rests(began)


async def _a_client_that_freezes(place: Site) -> None:
    async with jogging(place) as jogger:
        began = own_time()
        jogger.process.send_signal(signal.SIGSTOP)
        await place.rests(began)
        while (told := (await place.client.next_event("RobotHold")).data).held:
            pass
        assert "not renewed in time" in told.reason
        jogger.said.clear()
        jogger.process.send_signal(signal.SIGCONT)  # it goes on as if nothing had been
        await place.is_refused(jogger)


async def _a_server_that_freezes(place: Site) -> None:
    """All that waited for it is served when it comes back, and moves nothing."""
    async with jogging(place) as jogger:
        began = own_time()
        place.server.process.send_signal(signal.SIGSTOP)
        try:
            await place.rests(began)
            jogger.said.clear()
        finally:
            place.server.process.send_signal(signal.SIGCONT)
        await place.is_refused(jogger)


async def _a_host_that_freezes(place: Site) -> None:
    """Its controller's watchdog stops the arm meanwhile; what waited for the host moves nothing."""
    async with jogging(place) as jogger:
        host = place.host()
        began = own_time()
        os.kill(host, signal.SIGSTOP)
        try:
            await place.rests(began)
        finally:
            os.kill(host, signal.SIGCONT)
        await place.is_refused(jogger)


async def _fastest(place: Site, jog: Callable[[], Any], seconds: float) -> float:
    """Hold for a while; give the highest speed of the TCP, m/s, by the arm itself."""
    poses: list[tuple[float, list[float]]] = []
    end, renewed = time.monotonic() + seconds, 0.0
    while (now := time.monotonic()) < end:
        if now - renewed > 0.1:
            renewed = now
            await jog()
        truth = place.fake.truth()
        if not poses or truth["timestamp"] > poses[-1][0] + 0.02:
            poses.append((truth["timestamp"], truth["tcp_pose"][:3]))
        await asyncio.sleep(0.005)
    steps = itertools.pairwise(poses)
    return max(math.dist(a, b) / (later - sooner) for (sooner, a), (later, b) in steps)


async def _teach(place: Site) -> None:
    """The arm can be moved by hand as long as that is held, and is stiff again by itself."""
    place.hold += 1
    for _ in range(5):
        sent_ms = time.monotonic() * 1e3
        await place.client.hold_hand_teaching(robot_id=place.robot, hold=place.hold, sent_ms=sent_ms, valid_ms=300)
        await asyncio.sleep(0.05)
    assert place.fake.truth()["freedrive"]
    await until(lambda: not place.fake.truth()["freedrive"], "the arm is stiff again", 1.0)
    with pytest.raises(RequestFailed, match=r"motion has ended|not renewed"):
        await place.client.hold_hand_teaching(
            robot_id=place.robot, hold=place.hold, sent_ms=time.monotonic() * 1e3, valid_ms=300
        )


async def _hold_on(jog: Callable[[], Any]) -> None:
    for _ in range(20):
        await jog()
        await asyncio.sleep(0.05)


async def test_the_tcp_keeps_its_speed_and_protective_stops_are_acknowledged(fake: FakeUr, tmp_path: Path) -> None:
    async with site(fake, tmp_path) as place:
        client = place.client
        await client.call("WriteLock", rpc.WriteLockArgs(place.robot))
        await place.begin()
        fast = lambda: place.jog(linear=Position(0.0, 0.0, -0.6))  # noqa: E731
        assert 0.2 < await _fastest(place, fast, 0.8) < 0.255
        await place.jog(valid_ms=0)
        assert not place.moving()
        place.hold += 1
        turn = lambda: place.jog(joints=[Joint("shoulder_pan_joint", 1.0)])  # noqa: E731
        assert 0.2 < await _fastest(place, turn, 0.8) < 0.255
        assert await turn() < 0.9

        await place.jog(valid_ms=0)
        await _teach(place)
        place.hold += 1

        await turn()
        fake.do("protective_stop")
        with pytest.raises(RequestFailed, match="protective stop"):
            await _hold_on(turn)
        with pytest.raises(RequestFailed, match="protective stop"):
            await place.jog(new=True, linear=SLOWLY_UP)
        await place.rests(own_time())

        async def acknowledged() -> bool:
            with contextlib.suppress(RequestFailed):  # for its first seconds the controller does not let it be unlocked
                await client.call("AcknowledgeStop", rpc.AcknowledgeStopArgs(place.robot))
                return True
            return False

        await until(acknowledged, "the stop is acknowledged", 15.0)
        assert fake.truth()["safety"] == "NORMAL"
        await place.stays()
        with pytest.raises(RequestFailed, match="no stop that could be acknowledged"):
            await client.call("AcknowledgeStop", rpc.AcknowledgeStopArgs(place.robot))
        await place.begin()
        await until(place.moving, "the arm moves again")
        await place.jog(valid_ms=0)
