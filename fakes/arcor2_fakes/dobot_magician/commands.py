"""Effects and answers of the ids of the protocol."""

from __future__ import annotations

import struct
import time
from collections import deque
from collections.abc import Callable

from arcor2_fakes.dobot_magician.arm import Arm
from arcor2_fakes.dobot_magician.frames import Cutter, build
from arcor2_fakes.dobot_magician.motion import Motion

WRITES, QUEUED = 0x01, 0x02
SERIAL, NAME, VERSION = "DT1022049091", "Dobot Magician", (3, 6, 5)
ALARM_BYTES = 16


class Commands:
    """Executes and answers frames. An invalid frame is not answered."""

    def __init__(self, arm: Arm, send: Callable[[bytes], None]) -> None:
        self._arm, self._send = arm, send
        self._cutter = Cutter()
        self.received: deque[tuple[int, int]] = deque(maxlen=2000)
        self.stops: deque[float] = deque(maxlen=200)
        """Times of forced stops, on the monotonic clock, s."""
        self.spoiled = 0
        self.mute: set[int] = set()

    def drop_input(self) -> None:
        """Drop an incomplete frame."""
        self._cutter.drop()

    def renew(self) -> None:
        """Drop received bytes, and reset all faults."""
        self.drop_input()
        self.received.clear()
        self.stops.clear()
        self.mute.clear()
        self.spoiled = 0

    def feed(self, data: bytes) -> None:
        """Process received bytes."""
        for command, control, parameters in self._cutter.cut(data):
            self.received.append((command, control))
            try:
                answer = self._obey(command, control, parameters)
            except (struct.error, BufferError, IndexError):
                continue
            if answer is not None and command not in self.mute:
                frame = build(command, control, answer)
                if self.spoiled > 0:
                    self.spoiled -= 1
                    frame = frame[:-1] + bytes((frame[-1] ^ 0x55,))
                self._send(frame)

    def _obey(self, command: int, control: int, given: bytes) -> bytes | None:
        if not control & WRITES:
            return self._tell(command)
        if control & QUEUED:
            begin = self._motion(command, given)
            return None if begin is None else struct.pack("<Q", self._arm.enqueue(begin))
        return b"" if self._do(command, given) else None

    def _motion(self, command: int, given: bytes) -> Callable[[], Motion | None] | None:
        arm = self._arm
        if command == 31:
            struct.unpack("<I", given)
            return arm.home
        if command == 84:
            mode, *target = struct.unpack("<B4f", given)
            x, y, z, r = target
            return (lambda: arm.point_to_point(mode, (x, y, z, r))) if mode <= 9 else None

        def later() -> None:
            self._do(command, given)

        return later if command in (30, 60, 62, 63, 80, 81, 82, 83, 135) else None

    def _tell(self, command: int) -> bytes | None:
        arm, has = self._arm, self._arm.set
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
                return struct.pack("<4f", *has.home)
            case 60:
                return struct.pack("<3f", *has.bias)
            case 62:
                return bytes(arm.suction)
            case 63:
                return bytes(arm.gripper)
            case 80:
                return struct.pack("<8f", *has.joint_speed, *has.joint_acceleration)
            case 81:
                return struct.pack("<4f", has.speed, has.turning, has.acceleration, has.turning_acceleration)
            case 82:
                return struct.pack("<2f", has.jump_height, has.highest)
            case 83:
                return struct.pack("<2f", has.speed_ratio, has.acceleration_ratio)
            case 246:
                return struct.pack("<Q", arm.done_index)
            case 247:
                return struct.pack("<I", arm.space)
        return None

    def _do(self, command: int, given: bytes) -> bool:
        arm, has = self._arm, self._arm.set
        match command:
            case 21:
                arm.alarms.clear()
            case 30:
                has.home = struct.unpack("<4f", given)
            case 60:
                has.bias = struct.unpack("<3f", given)
            case 62:
                arm.suction = struct.unpack("<2B", given)
            case 63:
                arm.gripper = struct.unpack("<2B", given)
            case 80:
                numbers = struct.unpack("<8f", given)
                has.joint_speed, has.joint_acceleration = numbers[:4], numbers[4:]
            case 81:
                has.speed, has.turning, has.acceleration, has.turning_acceleration = struct.unpack("<4f", given)
            case 82:
                has.jump_height, has.highest = struct.unpack("<2f", given)
            case 83:
                has.speed_ratio, has.acceleration_ratio = struct.unpack("<2f", given)
            case 135:
                number, enabled, speed = struct.unpack("<BBi", given)
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
