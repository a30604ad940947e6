"""Clients of the fakes' control channels: the values that the world reads and the commands that it sends."""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from typing import Any

import msgspec

from arcor2_fakes.cell import seen_objects
from arcor2_fakes.cell.boards import Board
from arcor2_fakes.cell.layout import Layout
from arcor2_fakes.cell.world_data import Inputs, Printed, Robot
from arcor2_fakes.control import ControlClient, ControlError

_RETRY_PERIOD = 0.1
_CONNECT_TIMEOUT = 1.0
_MOTION_RATE = 100.0  # Hz; error of the position of a belt: 5 mm at 0.5 m/s
_OUTPUT_RATE = 10.0  # Hz; lamps are only displayed


class DeviceUnreachable(Exception):
    """A fake cannot be reached, has ended, or sends unexpected data; the message names it and its address."""


class Fake:
    """The control channel of a fake, and its name for messages."""

    def __init__(self, name: str, address: str, client: ControlClient) -> None:
        self.name = name
        self.address = address
        self.client = client

    @classmethod
    async def connect(cls, name: str, address: str, patience: float) -> Fake:
        """Connect; wait for a fake that is still starting.

        Raises:
            DeviceUnreachable: It cannot be reached within `patience` s.
        """
        deadline = asyncio.get_running_loop().time() + patience
        while True:
            try:
                return cls(name, address, await ControlClient.connect(address, within=_CONNECT_TIMEOUT))
            except ControlError as e:
                if asyncio.get_running_loop().time() >= deadline:
                    raise DeviceUnreachable(f"the {name} can't be reached: {e}") from e
                await asyncio.sleep(_RETRY_PERIOD)

    async def gone(self) -> str:
        """Wait until the fake ends, and return a message about that."""
        await self.client.wait_closed()
        return f"the {self.name} at {self.address} has gone"


class FakeDevices:
    """Sends the effects of the world to the fakes."""

    def __init__(self, fakes: Mapping[str, Fake], sensor: int | None) -> None:
        self._robot, self._tester, self._reader = fakes["robot"], fakes["tester"], fakes["reader"]
        self._io, self._camera = fakes.get("io"), fakes.get("camera")
        self._seen: dict[str, dict[str, Any]] = {}
        self._sensor = sensor

    async def put_into_tester(self, board: Board) -> str | None:
        """Put a board into the fixture; return the reason if that is impossible."""
        return await self._try(self._tester, "put_board", code=board.code, defect=board.defect)

    async def take_from_tester(self) -> str | None:
        """Take the board out of the fixture; return the reason if that is impossible."""
        return await self._try(self._tester, "take_board")

    async def present(self, code: str | None) -> None:
        """Show the reader a code, or nothing."""
        await self._do(self._reader, "present", code=code)

    async def set_sensor(self, held: bool) -> None:
        """Set the gripper's sensor, if there is one."""
        if self._sensor is not None:
            await self._do(self._robot, "set_input", bit=self._sensor, on=held)

    async def set_barrier(self, number: int, interrupted: bool) -> None:
        """Set the input to which a light barrier is connected."""
        if self._io is not None:
            await self._do(self._io, "set_input", number=number, on=interrupted)

    async def aim(self, layout: Layout) -> None:
        """Set the pose of the camera."""
        if self._camera is not None and layout.camera is not None:
            pose = {"position": layout.camera.pose.position, "orientation": layout.camera.pose.orientation}
            await self._do(self._camera, "camera", pose=pose)

    async def show(self, seen: dict[str, dict[str, Any]]) -> None:
        """Set the objects in front of the camera; only changes are sent."""
        if self._camera is None:
            return
        others, moved = seen_objects.changes(self._seen, seen)
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
            raise DeviceUnreachable(f"the {fake.name} at {fake.address}: {e}") from e


class RobotFeed:
    """The newest sample of the robot, and every sample before it at which the outputs changed."""

    def __init__(self) -> None:
        self._samples: list[Robot] = []
        self._arrived = asyncio.Event()
        self._problem: DeviceUnreachable | None = None

    def take(self, truth: Any) -> None:
        """Store a sample from the fake controller."""
        try:
            sample = msgspec.convert(truth, Robot)
        except msgspec.ValidationError as e:
            self._problem = DeviceUnreachable(f"the robot's truth is not that of a controller: {e}")
        else:
            # While the world is busy with a device, positions may be skipped, but no change of an output.
            if self._samples and self._samples[-1].digital_outputs == sample.digital_outputs:
                self._samples.pop()
            self._samples.append(sample)
        self._arrived.set()

    async def next(self) -> Robot:
        """Return the next sample. Raises `DeviceUnreachable` if the robot sends something else."""
        while not self._samples:
            if self._problem is not None:
                raise self._problem
            self._arrived.clear()
            await self._arrived.wait()
        return self._samples.pop(0)


class _FakeState(msgspec.Struct):
    """The fields of the state of a fake that the world uses; each fake sends some of them."""

    belt: float = 0.0
    angles: dict[str, float] = {}
    labels: list[Printed] = []
    outputs: list[bool] = []


class DeviceFeed:
    """The last states of all devices except the robot."""

    def __init__(self, layout: Layout) -> None:
        self.inputs = Inputs()
        self._arm = None if layout.labelling is None else layout.labelling.arm
        self._problem: DeviceUnreachable | None = None

    async def follow(self, fakes: Mapping[str, Fake]) -> None:
        """Subscribe to the states of the devices of the cell."""
        followed = {
            "conveyor": ("motion", _MOTION_RATE, self._belt),
            "arm": ("motion", _MOTION_RATE, self._angles),
            "printer": ("truth", 0.0, self._labels),
            "io": ("truth", _OUTPUT_RATE, self._outputs),
        }
        for role, (source, rate, take) in followed.items():
            if (fake := fakes.get(role)) is None:
                continue

            def update(truth: Any, take: Any = take, fake: Fake = fake) -> None:
                try:
                    take(msgspec.convert(truth, _FakeState))
                except (msgspec.ValidationError, KeyError) as e:
                    self._problem = DeviceUnreachable(f"the {fake.name} at {fake.address} sent an invalid answer: {e}")

            try:
                update(await fake.client.do(source))
                await fake.client.subscribe(update, source, rate)
            except ControlError as e:
                raise DeviceUnreachable(f"the {fake.name} at {fake.address}: {e}") from e

    def check(self) -> None:
        """Raise `DeviceUnreachable` if a device has sent unexpected data."""
        if self._problem is not None:
            raise self._problem

    def _belt(self, truth: _FakeState) -> None:
        self.inputs.belt = truth.belt

    def _angles(self, truth: _FakeState) -> None:
        if self._arm is not None:
            first, second = (truth.angles[str(number)] for number in self._arm.servos)
            self.inputs.arm = first, second

    def _labels(self, truth: _FakeState) -> None:
        self.inputs.printed = truth.labels

    def _outputs(self, truth: _FakeState) -> None:
        self.inputs.outputs = truth.outputs
