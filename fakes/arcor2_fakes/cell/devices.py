"""The world's side of the fakes' control channels: what it hears of them, and what it does to them."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any

import msgspec

from arcor2_fakes.cell import sight
from arcor2_fakes.cell.boards import Board
from arcor2_fakes.cell.layout import Layout
from arcor2_fakes.cell.things import Inputs, Printed, Robot
from arcor2_fakes.control import ControlClient, ControlError

_RETRY_PERIOD = 0.1
_CONNECT_WITHIN = 1.0
_MOTION_RATE = 100.0  # Hz; a belt at 0.5 m/s is known to 5 mm while it runs, a standing one exactly
_OUTPUT_RATE = 10.0  # Hz; lamps are looked at, nothing follows from them


class DeviceGone(Exception):
    """A fake can't be reached, has ended, or speaks of something else; the text names it and its address."""


class Fake:
    """The control channel of one fake, by the name the operator knows it by."""

    def __init__(self, name: str, address: str, client: ControlClient) -> None:
        self.name = name
        self.address = address
        self.client = client

    @classmethod
    async def connect(cls, name: str, address: str, patience: float) -> Fake:
        """Connect, waiting for a fake that is still starting.

        Raises:
            DeviceGone: nobody listens there within `patience` seconds.
        """
        deadline = asyncio.get_running_loop().time() + patience
        while True:
            try:
                return cls(name, address, await ControlClient.connect(address, within=_CONNECT_WITHIN))
            except ControlError as e:
                if asyncio.get_running_loop().time() >= deadline:
                    raise DeviceGone(f"the {name} can't be reached: {e}") from e
                await asyncio.sleep(_RETRY_PERIOD)

    async def gone(self) -> str:
        """Return, with a sentence that says so, when the fake has gone."""
        await self.client.wait_closed()
        return f"the {self.name} at {self.address} has gone"


class FakeDevices:
    """Does to the fakes what the world does to the devices."""

    def __init__(self, fakes: Mapping[str, Fake], sensor: int | None) -> None:
        self._robot, self._tester, self._reader = fakes["robot"], fakes["tester"], fakes["reader"]
        self._io, self._camera = fakes.get("io"), fakes.get("camera")
        self._seen: dict[str, dict[str, Any]] = {}
        self._sensor = sensor

    async def put_into_tester(self, board: Board) -> str | None:
        """Lay a board into the fixture; gives the reason if that is impossible."""
        return await self._try(self._tester, "put_board", code=board.code, defect=board.defect)

    async def take_from_tester(self) -> str | None:
        """Take the board out of the fixture; gives the reason if that is impossible."""
        return await self._try(self._tester, "take_board")

    async def present(self, code: str | None) -> None:
        """Show the reader a code, or nothing."""
        await self._do(self._reader, "present", code=code)

    async def set_sensor(self, held: bool) -> None:
        """Set the gripper's sensor, if there is one."""
        if self._sensor is not None:
            await self._do(self._robot, "set_input", bit=self._sensor, on=held)

    async def set_barrier(self, number: int, interrupted: bool) -> None:
        """Set the input that a light barrier is wired to."""
        if self._io is not None:
            await self._do(self._io, "set_input", number=number, on=interrupted)

    async def aim(self, layout: Layout) -> None:
        """Let the camera look from where it hangs."""
        if self._camera is not None and layout.camera is not None:
            pose = {"position": layout.camera.pose.position, "orientation": layout.camera.pose.orientation}
            await self._do(self._camera, "camera", pose=pose)

    async def show(self, seen: dict[str, dict[str, Any]]) -> None:
        """Let the camera see these things, told only of what is different."""
        if self._camera is None:
            return
        others, moved = sight.changes(self._seen, seen)
        if others:
            await self._do(self._camera, "scene", things=list(seen.values()))
        elif moved:
            await self._do(self._camera, "move", poses=moved)
        if others:
            self._seen = seen
        else:
            self._seen = self._seen | {name: seen[name] for name in moved}

    @staticmethod
    async def _try(fake: Fake, command: str, **arguments: Any) -> str | None:
        try:
            await fake.client.do(command, **arguments)
        except ControlError as e:
            return str(e)
        return None

    @staticmethod
    async def _do(fake: Fake, command: str, **arguments: Any) -> None:
        try:
            await fake.client.do(command, **arguments)
        except ControlError as e:
            raise DeviceGone(f"the {fake.name} at {fake.address}: {e}") from e


class RobotFeed:
    """The newest sample of the robot, and every one in between at which the outputs changed."""

    def __init__(self) -> None:
        self._samples: list[Robot] = []
        self._arrived = asyncio.Event()
        self._problem: DeviceGone | None = None

    def take(self, truth: Any) -> None:
        """Take what the fake controller has pushed."""
        try:
            sample = msgspec.convert(truth, Robot)
        except msgspec.ValidationError as e:
            self._problem = DeviceGone(f"the robot's truth is not that of a controller: {e}")
        else:
            # The world may be busy with a device: positions in between don't matter, switching does.
            if self._samples and self._samples[-1].digital_outputs == sample.digital_outputs:
                self._samples.pop()
            self._samples.append(sample)
        self._arrived.set()

    async def next(self) -> Robot:
        """Return the next sample. Raises `DeviceGone` if the robot sends something else."""
        while not self._samples:
            if self._problem is not None:
                raise self._problem
            self._arrived.clear()
            await self._arrived.wait()
        return self._samples.pop(0)


class _Truth(msgspec.Struct):
    """What the world reads of what a fake tells; each fake tells some of it."""

    belt: float = 0.0
    angles: dict[str, float] = {}
    labels: list[Printed] = []
    outputs: list[bool] = []


class DeviceFeed:
    """What was last heard of the devices beside the robot."""

    def __init__(self, layout: Layout) -> None:
        self.inputs = Inputs()
        self._arm = None if layout.labelling is None else layout.labelling.arm
        self._problem: DeviceGone | None = None

    async def follow(self, fakes: Mapping[str, Fake]) -> None:
        """Subscribe to what those of the devices tell that are there."""
        followed = {
            "conveyor": ("motion", _MOTION_RATE, self._belt),
            "arm": ("motion", _MOTION_RATE, self._angles),
            "printer": ("truth", 0.0, self._labels),
            "io": ("truth", _OUTPUT_RATE, self._outputs),
        }
        for role, (source, rate, take) in followed.items():
            if (fake := fakes.get(role)) is None:
                continue

            def heard(truth: Any, take: Any = take, fake: Fake = fake) -> None:
                try:
                    take(msgspec.convert(truth, _Truth))
                except (msgspec.ValidationError, KeyError) as e:
                    self._problem = DeviceGone(f"the {fake.name} at {fake.address} tells something else: {e}")

            try:
                heard(await fake.client.do(source))
                await fake.client.subscribe(heard, source, rate)
            except ControlError as e:
                raise DeviceGone(f"the {fake.name} at {fake.address}: {e}") from e

    def check(self) -> None:
        """Raise `DeviceGone` if a device tells something else than one of its kind."""
        if self._problem is not None:
            raise self._problem

    def _belt(self, truth: _Truth) -> None:
        self.inputs.belt = truth.belt

    def _angles(self, truth: _Truth) -> None:
        if self._arm is not None:
            first, second = (truth.angles[str(number)] for number in self._arm.servos)
            self.inputs.arm = first, second

    def _labels(self, truth: _Truth) -> None:
        self.inputs.printed = truth.labels

    def _outputs(self, truth: _Truth) -> None:
        self.inputs.outputs = truth.outputs
