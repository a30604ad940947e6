"""World: boards are gripped, moved, released, tested and counted. Independent of sockets and clocks."""

from __future__ import annotations

from collections import Counter
from typing import Any, Protocol

import msgspec
import numpy as np
from transforms3d.affines import compose
from transforms3d.euler import euler2mat

from arcor2_fakes.cell import arm, seen_objects
from arcor2_fakes.cell.boards import Board
from arcor2_fakes.cell.labelling import LabelNest
from arcor2_fakes.cell.layout import Layout, Matrix
from arcor2_fakes.cell.supply import BoardBelt, Magazine, Supply
from arcor2_fakes.cell.world_data import Event, Inputs, Robot, Thing

PLACES = ("feeder", "belt", "gripper", "tester", "label", "good", "bad", "lost", "removed")

# The base frame of the controller is base_link rotated by 180° about z.
_BASE_LINK_FROM_BASE = compose((0.0, 0.0, 0.0), euler2mat(0.0, 0.0, np.pi), np.ones(3))
# The z axis of the tip points down, that of a board up.
_TIP_FROM_GRIPPED = compose((0.0, 0.0, 0.0), euler2mat(np.pi, 0.0, 0.0), np.ones(3))


class Devices(Protocol):
    """The effects of the world on the devices."""

    async def put_into_tester(self, board: Board) -> str | None:
        """Put a board into the fixture; return the reason if that is impossible."""
        ...

    async def take_from_tester(self) -> str | None:
        """Take the board out of the fixture; return the reason if that is impossible."""
        ...

    async def present(self, code: str | None) -> None:
        """Show the reader a code, or nothing."""
        ...

    async def set_sensor(self, held: bool) -> None:
        """Set the gripper's sensor."""
        ...

    async def set_barrier(self, number: int, interrupted: bool) -> None:
        """Set the input of the I/O block to which a light barrier is connected."""
        ...


class World:
    """The boards of one run.

    Call `step` with each sample of the robot, in order, and with the last states of the other devices. It also
    advances the jaws and the feeder.
    """

    def __init__(self, layout: Layout, boards: list[Board], devices: Devices) -> None:
        self._layout = layout
        self._devices = devices
        self._things = [Thing(board) for board in boards]
        self._belt = None if layout.belt is None else BoardBelt(layout.belt, self._things)
        self._supply: Supply
        if self._belt is not None:
            self._supply = self._belt
        else:
            assert layout.feeder is not None, "a layout has one or the other"
            self._supply = Magazine(layout.feeder, self._things)
        self._nest = None if layout.labelling is None else LabelNest(layout.labelling)
        self._missing = {name for name, part in (("belt", self._belt), ("label", self._nest)) if part is None}
        self._inputs = Inputs()
        self._in_tester: Thing | None = None
        self._held: Thing | None = None
        self._tip_from_board: Matrix = np.eye(4)
        self._world_from_base = layout.robot.base.matrix() @ _BASE_LINK_FROM_BASE
        self._flange_from_tip = layout.gripper.tip.matrix()
        self._robot: Robot | None = None
        self._world_from_tip: Matrix | None = None
        self._now = 0.0
        self._closing = False  # last value of the output of the gripper
        self._jaws_due: float | None = None
        self.jaws_closed = False
        self.gripper_works = True
        self._sensor_stuck: bool | None = None
        self._sensor_told: bool | None = None
        self._shown: str | None = None
        self._barriers_stuck: dict[int, bool] = {}
        self._barriers_told: dict[int, bool] = {}

    async def begin(self) -> None:
        """Synchronize the devices with the world; call it once, before the first `step`."""
        await self._tell_sensor()
        await self._tell_barriers()
        await self._devices.present(None)

    # ------------------------------------------------------------------------------------------------ time

    async def step(self, now: float, robot: Robot, inputs: Inputs | None = None) -> None:
        """Update the world from the robot and the other devices; `now` is in s since the start of the world."""
        self._now = now
        self._inputs = inputs = inputs or Inputs()
        for thing, place, why in self._supply.advance(now, inputs.belt):
            self._move(thing, place, why)
        if self._nest is not None:
            for thing, why in self._nest.printed(inputs.printed):
                self._note(thing, why)
            pressed = None if inputs.arm is None else self._nest.wiped(inputs.arm)
            if pressed is not None:
                self._note(pressed, "the label was pressed on")
        if robot != self._robot:  # nothing to do while the arm is stopped
            self._robot = robot
            self._world_from_tip = self._world_from_base @ robot.base_from_flange() @ self._flange_from_tip
        await self._drive_jaws(bool(robot.digital_outputs >> self._layout.gripper.output & 1))
        await self._tell_barriers()
        await self._show()

    async def _drive_jaws(self, closing: bool) -> None:
        if not self.gripper_works:
            self._closing, self._jaws_due = self.jaws_closed, None  # after a repair the jaws follow the output again
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
            self.jaws_closed = self._closing  # last: a client that sees the event also sees its effects

    # ------------------------------------------------------------------------------------------------ gripping

    def _tip(self) -> Matrix:
        assert self._world_from_tip is not None, "the jaws move only once the robot is known"
        return self._world_from_tip

    async def _grip(self) -> None:
        layout, world_from_gripped = self._layout, self._tip() @ _TIP_FROM_GRIPPED
        found = self._supply.under(world_from_gripped)
        if found is not None:
            self._supply.take(found[0])
            await self._hold(*found, f"taken from the {self._supply.place}")
        elif self._nest is not None and self._nest.thing is not None and self._nest.holds(world_from_gripped):
            thing = self._nest.thing
            await self._hold(thing, self._nest.layout.place.pose.matrix(), self._nest.taken())
        elif self._in_tester is not None and layout.tester.holds(world_from_gripped):
            refused = await self._devices.take_from_tester()
            if refused is None:
                thing, self._in_tester = self._in_tester, None
                await self._hold(thing, layout.tester.pose.matrix(), "taken out of the tester")

    async def _hold(self, board: Thing, world_from_board: Matrix, reason: str) -> None:
        self._tip_from_board = np.linalg.inv(self._tip()) @ world_from_board
        self._move(board, "gripper", reason)
        await self._tell_sensor()

    async def _let_go(self, reason: str) -> None:
        thing = self._held
        if thing is not None:
            await self._fall(thing, self._tip() @ self._tip_from_board, reason)
            await self._tell_sensor()

    async def _fall(self, board: Thing, world_from_board: Matrix, reason: str) -> None:
        layout = self._layout
        if layout.tester.holds(world_from_board):
            refused = await self._devices.put_into_tester(board.board)
            if refused is None:
                self._in_tester = board
                self._move(board, "tester", reason)
                return
            reason = f"{reason} over the tester, which did not take it: {refused}"
        elif layout.good_box.holds(world_from_board):
            self._move(board, "good", reason)
            return
        elif layout.bad_box.holds(world_from_board):
            self._move(board, "bad", reason)
            return
        elif self._nest is not None and self._nest.holds(world_from_board):
            if self._nest.thing is None:
                self._nest.thing = board
                self._move(board, "label", reason)
                return
            reason = f"{reason} under the label printer, where there is already a board"
        elif self._supply.accepts(world_from_board):
            refused = self._supply.put(board, world_from_board)
            if refused is None:
                self._move(board, self._supply.place, reason)
                return
            reason = f"{reason} {refused}"
        x, y, _ = world_from_board[:3, 3]
        self._move(board, "lost", reason, (float(x), float(y), layout.table_height))

    def _move(self, board: Thing, place: str, reason: str, position: tuple[float, float, float] | None = None) -> None:
        if place == "gripper":
            self._held = board
        elif board is self._held:
            self._held = None
        board.place, board.position = place, position
        self._note(board, reason)

    def _note(self, board: Thing, reason: str) -> None:
        board.history.append(Event(self._now, board.place, reason))

    # ------------------------------------------------------------------------------------------------ sensors

    async def _tell_sensor(self) -> None:
        held = (self._held is not None) if self._sensor_stuck is None else self._sensor_stuck
        if held != self._sensor_told:
            self._sensor_told = held
            await self._devices.set_sensor(held)

    async def _tell_barriers(self) -> None:
        if self._layout.belt is None or self._belt is None:
            return
        for barrier in self._layout.belt.barriers:
            number = barrier.input
            interrupted = self._barriers_stuck.get(number, self._belt.interrupts(barrier.at))
            if self._barriers_told.get(number) is not interrupted:
                self._barriers_told[number] = interrupted
                await self._devices.set_barrier(number, interrupted)

    async def _show(self) -> None:
        """Show the reader the board in its view, if there is one."""
        window, code = self._layout.reader, None
        if self._held is not None and window.holds(self._tip() @ self._tip_from_board):
            code = self._held.board.code
        elif (thing := self._supply.seen_by(window)) is not None:
            code = thing.board.code
        if code != self._shown:
            self._shown = code
            await self._devices.present(code)

    # ------------------------------------------------------------------------------------------------ commands of tests

    async def drop(self) -> None:
        """Let the gripped board slip out of the jaws.

        Raises:
            ValueError: No board is gripped.
        """
        if self._held is None:
            raise ValueError("no board is gripped")
        await self._let_go("slipped out of the gripper")

    async def stick_sensor(self, value: bool | None) -> None:
        """Freeze the value of the gripper's sensor; None: it works again."""
        self._sensor_stuck = value
        await self._tell_sensor()

    async def stick_barrier(self, number: int, value: bool | None) -> None:
        """Freeze the value of a light barrier; None: it works again.

        Raises:
            ValueError: No light barrier is connected to that input.
        """
        belt = self._layout.belt
        wired = [barrier.input for barrier in belt.barriers] if belt is not None else []
        if number not in wired:
            raise ValueError(f"input {number} has no light barrier; connected: {', '.join(map(str, wired)) or 'none'}")
        if value is None:
            self._barriers_stuck.pop(number, None)
        else:
            self._barriers_stuck[number] = value
        await self._tell_barriers()

    async def remove(self, code: str) -> None:
        """Remove a board by hand, permanently.

        Raises:
            ValueError: The board does not exist or cannot be reached.
        """
        thing = next((thing for thing in self._things if thing.board.code == code), None)
        if thing is None:
            raise ValueError(f"board {code} does not exist")
        if thing is self._in_tester and (refused := await self.clear_tester()) is not None:
            raise ValueError(refused)
        if thing.place in ("feeder", "belt"):
            self._supply.take(thing)
        if self._nest is not None and thing is self._nest.thing:
            self._nest.taken()
        self._move(thing, "removed", "taken away by hand")
        await self._tell_sensor()

    async def clear_tester(self) -> str | None:
        """Take the board out of the tester, if there is one; return the reason if that is impossible."""
        if self._in_tester is None:
            return None
        refused = await self._devices.take_from_tester()
        if refused is None:
            self._in_tester = None
        return refused

    # ------------------------------------------------------------------------------------------------ truth

    def truth(self) -> dict[str, Any]:
        """Return the real state, for tests."""
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
                    "label": None if thing.label is None else msgspec.to_builtins(thing.label),
                    "history": [msgspec.to_builtins(event) for event in thing.history],
                }
                for thing in self._things
            ],
            "counts": {place: counts[place] for place in PLACES if place not in self._missing},
            "gripper": {
                "closed": self.jaws_closed,
                "works": self.gripper_works,
                "holds": None if self._held is None else self._held.board.code,
                "sensor": self._sensor_told,
                "tip": None if tip is None else [float(value) for value in tip[:3, 3]],
            },
            "at_pick_place": top.board.code if (top := self._supply.top()) is not None else None,
            "in_view": self._shown,
            **self._stations(),
        }

    def pose(self, board: Thing) -> Matrix | None:
        """Return the pose of a board; None if it has not arrived yet or was removed."""
        if board is self._held:
            held: Matrix = self._tip() @ self._tip_from_board
            return held
        if board.place in ("feeder", "belt"):
            return self._supply.pose(board)
        layout = self._layout
        places = {"tester": layout.tester, "good": layout.good_box, "bad": layout.bad_box}
        if layout.labelling is not None:
            places["label"] = layout.labelling.place
        if board.place in places:
            return places[board.place].pose.matrix()
        return None if board.position is None else compose(board.position, np.eye(3), np.ones(3))

    def _position(self, board: Thing) -> tuple[float, float, float] | None:
        pose = self.pose(board)
        return None if pose is None else (float(pose[0, 3]), float(pose[1, 3]), float(pose[2, 3]))

    def seen(self) -> dict[str, dict[str, Any]]:
        """Return the objects in front of the camera by name, for the fake camera; empty without a camera."""
        camera = self._layout.camera
        if camera is None:
            return {}
        found = {thing["name"]: thing for thing in seen_objects.fixed(camera)}
        robot = self._layout.robot
        if robot.model is not None and self._robot is not None and len(self._robot.q) == 6:
            found |= arm.things(robot.model, robot.base.matrix(), self._robot.q, self._flange_from_tip)
        piles: Counter[str] = Counter()
        for thing in self._things:
            if (pose := self.pose(thing)) is None:
                continue
            if thing.place in ("good", "bad"):
                pose = pose.copy()
                pose[2, 3] += piles[thing.place] * camera.board[2]
                piles[thing.place] += 1
            found[thing.board.code] = seen_objects.board(camera, thing.board.code, pose, thing.label is not None)
        return found

    def _stations(self) -> dict[str, Any]:
        """Return the state of the stations that only some cells have."""
        found: dict[str, Any] = {"robot_base": msgspec.to_builtins(self._layout.robot.base)}
        if self._layout.camera is not None:
            found["camera"] = msgspec.to_builtins(self._layout.camera.pose)
            found["markers"] = msgspec.to_builtins(self._layout.camera.markers)
        if self._belt is not None:
            found["barriers"] = {str(number): on for number, on in self._barriers_told.items()}
            found["belt"] = [{"code": thing.board.code, "before_stop": -s} for thing, s in self._belt.places()]
        if self._nest is not None:
            found["spilled_labels"] = list(self._nest.spilled)
            found["roller"] = self._nest.roller
        outputs = self._inputs.outputs
        if self._layout.tower and outputs:
            found["tower"] = {color: outputs[number] for color, number in self._layout.tower.items()}
        return found
