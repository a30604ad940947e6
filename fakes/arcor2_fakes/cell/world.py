"""What happens to the boards: gripped, carried, let go, tested, counted. Knows no socket and no clock."""

from __future__ import annotations

from collections import Counter
from typing import Any, Protocol

import msgspec
import numpy as np
from transforms3d.affines import compose
from transforms3d.euler import euler2mat

from arcor2_fakes.cell.boards import Board
from arcor2_fakes.cell.layout import Layout, Matrix, from_rotation_vector

ControllerPose = tuple[float, float, float, float, float, float]
"""Position and rotation vector."""

PLACES = ("feeder", "gripper", "tester", "good", "bad", "lost", "removed")

# The controller's base is base_link turned by half a turn about z.
_BASE_LINK_FROM_BASE = compose((0.0, 0.0, 0.0), euler2mat(0.0, 0.0, np.pi), np.ones(3))
# The tip's z points down at a board whose z points up.
_TIP_FROM_GRIPPED = compose((0.0, 0.0, 0.0), euler2mat(np.pi, 0.0, 0.0), np.ones(3))


class Devices(Protocol):
    """What the world does to the devices."""

    async def put_into_tester(self, board: Board) -> str | None:
        """Lay a board into the fixture; gives the reason if that is impossible."""
        ...

    async def take_from_tester(self) -> str | None:
        """Take the board out of the fixture; gives the reason if that is impossible."""
        ...

    async def present(self, code: str | None) -> None:
        """Show the reader a code, or nothing."""
        ...

    async def set_sensor(self, held: bool) -> None:
        """Set the gripper's sensor."""
        ...


class Robot(msgspec.Struct, frozen=True):
    """One sample of the robot: the TCP in the controller's base, the TCP on the flange, the digital outputs as bits."""

    tcp_pose: ControllerPose
    tcp_offset: ControllerPose
    digital_outputs: int

    def base_from_flange(self) -> Matrix:
        """Give the flange, which stands where it stands whatever TCP somebody has set."""
        flange: Matrix = from_rotation_vector(self.tcp_pose) @ np.linalg.inv(from_rotation_vector(self.tcp_offset))
        return flange


class Event(msgspec.Struct, frozen=True):
    """Something that happened to a board, seconds after the world began."""

    time: float
    place: str
    why: str


class Thing:
    """A board in the world, where it is, and what happened to it."""

    def __init__(self, board: Board) -> None:
        self.board = board
        self.place = "feeder"
        self.position: tuple[float, float, float] | None = None
        self.history: list[Event] = []


class World:
    """The boards of one run.

    `step` is called with each sample of the robot, in order; what takes time (jaws, the feeder) advances with it.
    """

    def __init__(self, layout: Layout, boards: list[Board], devices: Devices) -> None:
        self._layout = layout
        self._devices = devices
        self._things = [Thing(board) for board in boards]
        self._feeder = list(self._things)  # the first is on top
        self._refilled_at = 0.0  # when the top board has reached, or will reach, the pick place
        self._in_tester: Thing | None = None
        self._held: Thing | None = None
        self._tip_from_board: Matrix = np.eye(4)
        self._world_from_base = layout.robot.base.matrix() @ _BASE_LINK_FROM_BASE
        self._feeder_in_view = layout.reader.holds(layout.feeder.pose.matrix())
        self._flange_from_tip = layout.gripper.tip.matrix()
        self._robot: Robot | None = None
        self._world_from_tip: Matrix | None = None
        self._now = 0.0
        self._closing = False  # what the output last told the jaws
        self._jaws_due: float | None = None
        self.jaws_closed = False
        self.gripper_works = True
        self._sensor_stuck: bool | None = None
        self._sensor_told: bool | None = None
        self._shown: str | None = None

    async def begin(self) -> None:
        """Bring the devices in step with the world; call it once, before the first `step`."""
        await self._tell_sensor()
        await self._devices.present(None)

    # ------------------------------------------------------------------------------------------------ time

    async def step(self, now: float, robot: Robot) -> None:
        """Let the world follow the robot; `now` in seconds since the world began."""
        self._now = now
        if robot != self._robot:  # an arm at rest costs nothing
            self._robot = robot
            self._world_from_tip = self._world_from_base @ robot.base_from_flange() @ self._flange_from_tip
        await self._drive_jaws(bool(robot.digital_outputs >> self._layout.gripper.output & 1))
        await self._show()

    async def _drive_jaws(self, closing: bool) -> None:
        if not self.gripper_works:
            self._closing, self._jaws_due = self.jaws_closed, None  # once repaired they follow the output again
            return
        gripper = self._layout.gripper
        if closing != self._closing:
            self._closing = closing
            self._jaws_due = self._now + (gripper.close_time if closing else gripper.open_time)
        if self._jaws_due is not None and self._now >= self._jaws_due:
            self._jaws_due = None
            if self._closing and not self.jaws_closed:
                await self._grip()
            elif not self._closing and self.jaws_closed:
                await self._let_go("let go")
            self.jaws_closed = self._closing  # last, so that who sees it sees what came of it

    # ------------------------------------------------------------------------------------------------ gripping

    def _tip(self) -> Matrix:
        assert self._world_from_tip is not None, "the jaws move only once the robot is known"
        return self._world_from_tip

    async def _grip(self) -> None:
        layout, world_from_gripped = self._layout, self._tip() @ _TIP_FROM_GRIPPED
        top = self._top()
        if top is not None and layout.feeder.holds(world_from_gripped):
            self._feeder.remove(top)
            self._refilled_at = self._now + layout.feeder.refill_time
            await self._hold(top, layout.feeder.pose.matrix(), "taken from the feeder")
        elif self._in_tester is not None and layout.tester.holds(world_from_gripped):
            refused = await self._devices.take_from_tester()
            if refused is None:
                thing, self._in_tester = self._in_tester, None
                await self._hold(thing, layout.tester.pose.matrix(), "taken out of the tester")

    async def _hold(self, thing: Thing, world_from_board: Matrix, why: str) -> None:
        self._tip_from_board = np.linalg.inv(self._tip()) @ world_from_board
        self._move(thing, "gripper", why)
        await self._tell_sensor()

    async def _let_go(self, why: str) -> None:
        thing = self._held
        if thing is not None:
            await self._fall(thing, self._tip() @ self._tip_from_board, why)
            await self._tell_sensor()

    async def _fall(self, thing: Thing, world_from_board: Matrix, why: str) -> None:
        layout = self._layout
        if layout.tester.holds(world_from_board):
            refused = await self._devices.put_into_tester(thing.board)
            if refused is None:
                self._in_tester = thing
                self._move(thing, "tester", why)
                return
            why = f"{why} over the tester, which did not take it: {refused}"
        elif layout.good_box.holds(world_from_board):
            self._move(thing, "good", why)
            return
        elif layout.bad_box.holds(world_from_board):
            self._move(thing, "bad", why)
            return
        elif layout.feeder.holds(world_from_board):
            if self._top() is None:
                self._feeder.insert(0, thing)
                self._refilled_at = self._now
                self._move(thing, "feeder", why)
                return
            why = f"{why} over the feeder, where the next board lies already"
        x, y, _ = world_from_board[:3, 3]
        self._move(thing, "lost", why, (float(x), float(y), layout.table_height))

    def _top(self) -> Thing | None:
        """Give the board at the pick place."""
        return self._feeder[0] if self._feeder and self._now >= self._refilled_at else None

    def _move(self, thing: Thing, place: str, why: str, position: tuple[float, float, float] | None = None) -> None:
        if place == "gripper":
            self._held = thing
        elif thing is self._held:
            self._held = None
        thing.place, thing.position = place, position
        thing.history.append(Event(self._now, place, why))

    # ------------------------------------------------------------------------------------------------ sensors

    async def _tell_sensor(self) -> None:
        held = (self._held is not None) if self._sensor_stuck is None else self._sensor_stuck
        if held != self._sensor_told:
            self._sensor_told = held
            await self._devices.set_sensor(held)

    async def _show(self) -> None:
        """Let the reader see the board in its view, if there is one."""
        window, code, top = self._layout.reader, None, self._top()
        if self._held is not None and window.holds(self._tip() @ self._tip_from_board):
            code = self._held.board.code
        elif top is not None and self._feeder_in_view:
            code = top.board.code
        if code != self._shown:
            self._shown = code
            await self._devices.present(code)

    # ------------------------------------------------------------------------------------------------ told by a test

    async def drop(self) -> None:
        """Let the held board slip out of the jaws.

        Raises:
            ValueError: nothing is held.
        """
        if self._held is None:
            raise ValueError("nothing is held")
        await self._let_go("slipped out of the gripper")

    async def stick_sensor(self, value: bool | None) -> None:
        """Let the gripper's sensor always show this; None lets it show the truth again."""
        self._sensor_stuck = value
        await self._tell_sensor()

    async def remove(self, code: str) -> None:
        """Take a board away by hand, for good.

        Raises:
            ValueError: there is no such board, or it can't be reached.
        """
        thing = next((thing for thing in self._things if thing.board.code == code), None)
        if thing is None:
            raise ValueError(f"no board {code}")
        if thing is self._in_tester:
            refused = await self._devices.take_from_tester()
            if refused is not None:
                raise ValueError(refused)
            self._in_tester = None
        if thing is self._top():
            self._refilled_at = self._now + self._layout.feeder.refill_time
        if thing in self._feeder:
            self._feeder.remove(thing)
        self._move(thing, "removed", "taken away by hand")
        await self._tell_sensor()

    # ------------------------------------------------------------------------------------------------ truth

    def truth(self) -> dict[str, Any]:
        """Give what is so."""
        counts = Counter(thing.place for thing in self._things)
        tip = self._world_from_tip
        return {
            "boards": [
                {
                    "code": thing.board.code,
                    "good": thing.board.defect is None,
                    "defect": thing.board.defect,
                    "place": thing.place,
                    "position": self._position(thing),
                    "history": [msgspec.to_builtins(event) for event in thing.history],
                }
                for thing in self._things
            ],
            "counts": {place: counts[place] for place in PLACES},
            "gripper": {
                "closed": self.jaws_closed,
                "works": self.gripper_works,
                "holds": None if self._held is None else self._held.board.code,
                "sensor": self._sensor_told,
                "tip": None if tip is None else [float(value) for value in tip[:3, 3]],
            },
            "at_pick_place": top.board.code if (top := self._top()) is not None else None,
            "in_view": self._shown,
        }

    def _position(self, thing: Thing) -> tuple[float, float, float] | None:
        if thing is self._held:
            x, y, z = (self._tip() @ self._tip_from_board)[:3, 3]
            return float(x), float(y), float(z)
        layout = self._layout
        places = {
            "feeder": layout.feeder,
            "tester": layout.tester,
            "good": layout.good_box,
            "bad": layout.bad_box,
        }
        return places[thing.place].pose.position if thing.place in places else thing.position
