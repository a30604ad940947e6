"""The bus: passes instruction packets to the servos and sends their status packets."""

import time
from collections import deque
from collections.abc import Callable
from typing import Final

from arcor2_fakes.two_axis_robot.packet import BROADCAST, BadCrc, Instruction, Receiver, status
from arcor2_fakes.two_axis_robot.servo import BAD_CRC, BAD_INSTRUCTION, BAD_LENGTH, FIELDS, OK, Servo

PING: Final = 0x01
READ: Final = 0x02
WRITE: Final = 0x03
REBOOT: Final = 0x08
SYNC_READ: Final = 0x82
SYNC_WRITE: Final = 0x83


class Bus:
    """The servos on one bus. `send` is called with each status packet."""

    def __init__(self, servos: list[Servo], send: Callable[[bytes], None]) -> None:
        self.servos = {servo.number: servo for servo in servos}
        self._send = send
        self._receiver = Receiver()
        self.packets = 0
        self.sync_writes: deque[float] = deque(maxlen=200)
        """Times of sync writes of goals, on the monotonic clock, s."""
        self.wrong_crcs = 0
        self._refusals: dict[int, int] = {}

    def refuse_next(self, servo: int, error: int) -> None:
        """Answer the next instruction to a servo with an error, without executing it."""
        self._refusals[servo] = error

    def clear(self) -> None:
        """Drop an incomplete packet."""
        self._receiver.clear()

    def feed(self, data: bytes) -> None:
        """Process received bytes."""
        for found in self._receiver.feed(data):
            if isinstance(found, BadCrc):
                if (servo := self._answering(found.servo)) is not None:
                    self._answer(servo, BAD_CRC)
            else:
                self.packets += 1
                self._execute(found)

    def _answering(self, number: int) -> Servo | None:
        servo = self.servos.get(number)
        return servo if servo is not None and servo.answers else None

    def _answer(self, servo: Servo, error: int, data: bytes = b"") -> None:
        frame = status(servo.number, error | servo.alert, data)
        if self.wrong_crcs:
            self.wrong_crcs -= 1
            frame = frame[:-1] + bytes([frame[-1] ^ 0x01])
        self._send(frame)

    def _execute(self, instruction: Instruction) -> None:
        parameters = instruction.parameters
        if instruction.code == SYNC_READ and instruction.servo == BROADCAST and len(parameters) > 4:
            for servo in self._addressed(parameters[4:]):
                self._read(servo, parameters[:4])
        elif instruction.code == SYNC_WRITE and instruction.servo == BROADCAST and len(parameters) > 4:
            self._sync_write(parameters)
        elif instruction.code == PING and instruction.servo == BROADCAST:
            for servo in self._addressed(bytes(sorted(self.servos))):
                self._ping(servo)
        elif (one := self._answering(instruction.servo)) is not None:
            one.restart_watchdog()
            if (error := self._refusals.pop(one.number, OK)) != OK:
                self._answer(one, error)
            else:
                self._execute_single(one, instruction.code, parameters)

    def _addressed(self, numbers: bytes) -> list[Servo]:
        found = [servo for number in numbers if (servo := self._answering(number)) is not None]
        for servo in found:
            servo.restart_watchdog()
        return found

    def _execute_single(self, servo: Servo, code: int, parameters: bytes) -> None:
        if code == PING:
            self._ping(servo)
        elif code == READ:
            self._read(servo, parameters)
        elif code == WRITE:
            short = len(parameters) < 3
            address = int.from_bytes(parameters[:2], "little")
            self._answer(servo, BAD_LENGTH if short else servo.write(address, parameters[2:]))
        elif code == REBOOT:
            self._answer(servo, OK)
            servo.reboot()
        else:
            self._answer(servo, BAD_INSTRUCTION)

    def _ping(self, servo: Servo) -> None:
        self._answer(servo, OK, servo["model"].to_bytes(2, "little") + bytes([servo["firmware"]]))

    def _read(self, servo: Servo, parameters: bytes) -> None:
        if len(parameters) != 4:
            self._answer(servo, BAD_LENGTH)
            return
        found = servo.read(int.from_bytes(parameters[:2], "little"), int.from_bytes(parameters[2:], "little"))
        if isinstance(found, int):
            self._answer(servo, found)
        else:
            self._answer(servo, OK, found)

    def _sync_write(self, parameters: bytes) -> None:
        address, size = int.from_bytes(parameters[:2], "little"), int.from_bytes(parameters[2:4], "little")
        rest = parameters[4:]
        goal = FIELDS["goal"]
        if address <= goal.address < address + size:
            self.sync_writes.append(time.monotonic())
        if len(rest) % (size + 1):
            return  # a broadcast is never answered, not even with an error
        for start in range(0, len(rest), size + 1):
            for servo in self._addressed(rest[start : start + 1]):
                servo.write(address, rest[start + 1 : start + 1 + size])
