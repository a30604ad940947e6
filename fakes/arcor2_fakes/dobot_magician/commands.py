"""Effects and answers of the ids of the protocol.

A write to id 20 clears the alarms, as in the vendor's DobotDll; so does a write to id 21, which pydobot lists. Homing
(31) is executed with and without its reserved parameter: pydobot sends none.
"""

from __future__ import annotations

import struct
import time
from collections import deque
from collections.abc import Callable

from arcor2_fakes.dobot_magician.arm import Arm
from arcor2_fakes.dobot_magician.frames import FrameBuffer, build
from arcor2_fakes.dobot_magician.motion import Motion

WRITES, QUEUED = 0x01, 0x02
SERIAL, NAME, VERSION = "DT1022049091", "Dobot Magician", (3, 6, 5)
ALARM_BYTES = 16


class Commands:
    """Executes and answers frames. An invalid frame is not answered."""

    def __init__(self, arm: Arm, send: Callable[[bytes], None]) -> None:
        self._arm, self._send = arm, send
        self._frames = FrameBuffer()
        self.received: deque[tuple[int, int]] = deque(maxlen=2000)
        self.stops: deque[float] = deque(maxlen=200)
        """Times of forced stops, on the monotonic clock, s."""
        self.spoiled = 0
        self.mute: set[int] = set()

    def drop_input(self) -> None:
        """Drop an incomplete frame."""
        self._frames.clear()

    def renew(self) -> None:
        """Drop received bytes, and reset all faults."""
        self.drop_input()
        self.received.clear()
        self.stops.clear()
        self.mute.clear()
        self.spoiled = 0

    def feed(self, data: bytes) -> None:
        """Process received bytes."""
        for command, control, parameters in self._frames.feed(data):
            self.received.append((command, control))
            try:
                answer = self._execute(command, control, parameters)
            except (struct.error, BufferError, IndexError):
                continue
            if answer is not None and command not in self.mute:
                frame = build(command, control, answer)
                if self.spoiled > 0:
                    self.spoiled -= 1
                    frame = frame[:-1] + bytes((frame[-1] ^ 0x55,))
                self._send(frame)

    def _execute(self, command: int, control: int, data: bytes) -> bytes | None:
        if not control & WRITES:
            return self._read(command)
        if control & QUEUED:
            begin = self._motion(command, data)
            return None if begin is None else struct.pack("<Q", self._arm.enqueue(begin))
        return b"" if self._write(command, data) else None

    def _motion(self, command: int, data: bytes) -> Callable[[], Motion | None] | None:
        arm = self._arm
        if command == 31:
            if data:
                struct.unpack("<I", data)
            return arm.home
        if command == 84:
            mode, *target = struct.unpack("<B4f", data)
            x, y, z, r = target
            return (lambda: arm.point_to_point(mode, (x, y, z, r))) if mode <= 9 else None

        def later() -> None:
            self._write(command, data)

        return later if command in (30, 60, 62, 63, 80, 81, 82, 83, 135) else None

    def _read(self, command: int) -> bytes | None:
        arm, settings = self._arm, self._arm.settings
        match command:
            case 0:
                return SERIAL.encode("ascii")
            case 1:
                return NAME.encode("ascii")
            case 2:
                return bytes(VERSION)
            case 10:
                return struct.pack("<8f", *arm.tool, *arm.joints)
            case 20:
                bits = sum(1 << code for code in arm.alarms)
                return bits.to_bytes(ALARM_BYTES, "little")
            case 30:
                return struct.pack("<4f", *settings.home)
            case 60:
                return struct.pack("<3f", *settings.bias)
            case 62:
                return bytes(arm.suction)
            case 63:
                return bytes(arm.gripper)
            case 80:
                return struct.pack("<8f", *settings.joint_speed, *settings.joint_acceleration)
            case 81:
                return struct.pack(
                    "<4f", settings.speed, settings.turning, settings.acceleration, settings.turning_acceleration
                )
            case 82:
                return struct.pack("<2f", settings.jump_height, settings.highest)
            case 83:
                return struct.pack("<2f", settings.speed_ratio, settings.acceleration_ratio)
            case 246:
                return struct.pack("<Q", arm.done_index)
            case 247:
                return struct.pack("<I", arm.space)
        return None

    def _write(self, command: int, data: bytes) -> bool:
        arm, settings = self._arm, self._arm.settings
        match command:
            case 20 | 21:
                arm.alarms.clear()
            case 30:
                settings.home = struct.unpack("<4f", data)
            case 60:
                settings.bias = struct.unpack("<3f", data)
            case 62:
                arm.suction = struct.unpack("<2B", data)
            case 63:
                arm.gripper = struct.unpack("<2B", data)
            case 80:
                numbers = struct.unpack("<8f", data)
                settings.joint_speed, settings.joint_acceleration = numbers[:4], numbers[4:]
            case 81:
                settings.speed, settings.turning, settings.acceleration, settings.turning_acceleration = struct.unpack(
                    "<4f", data
                )
            case 82:
                settings.jump_height, settings.highest = struct.unpack("<2f", data)
            case 83:
                settings.speed_ratio, settings.acceleration_ratio = struct.unpack("<2f", data)
            case 135:
                number, enabled, speed = struct.unpack("<BBi", data)
                if number in arm.steppers:
                    arm.steppers[number] = (bool(enabled), speed)
            case 240:
                arm.running = True
            case 241:
                arm.running = False
            case 242:
                self.stops.append(time.monotonic())
                arm.force_stop()
            case 245:
                arm.clear()
            case _:
                return False
        return True
