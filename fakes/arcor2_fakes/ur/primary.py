"""The primary and the secondary port: they receive programs, and send the state of the robot ten times per second.

A message is its length (u32), its type and its content. A robot state (type 16) consists of packages of the same form;
package 5 has the DH parameters of the arm. Only the primary port sends run-time errors of programs. Numbers are
big-endian. Source: Universal Robots, "Primary and Secondary Interfaces"; the layout is from general knowledge of it.

Not modelled: packages 6 and 8 to 14 (configuration, additional information, and those of the vendor), and messages
other than versions and run-time errors.
"""

import math
import struct
from collections.abc import Iterator
from typing import Final

from arcor2_fakes.ur.controller import Controller
from arcor2_fakes.ur.kinematics import Geometry
from arcor2_fakes.ur.outputs import readers
from arcor2_fakes.ur.states import RobotMode, Runtime, SafetyMode
from arcor2_fakes.wire import Connection, TcpWire

_RATE: Final = 10.0  # Hz
_HEADER = struct.Struct(">IB")
_ROBOT_STATE, _ROBOT_MESSAGE = 16, 20
_VERSION_MESSAGE, _RUNTIME_ERROR = 3, 10
_SOURCE: Final = -2  # of messages: the controller
_CHECKSUMS = (0x1D2C3B4A, 0x2D2C3B4A, 0x3D2C3B4A, 0x4D2C3B4A, 0x5D2C3B4A, 0x6D2C3B4A)


def _framed(kind: int, content: bytes) -> bytes:
    return _HEADER.pack(_HEADER.size + len(content), kind) + content


class StatePorts:
    """All clients of the primary and the secondary port. Call `tick` once per control cycle."""

    def __init__(self, controller: Controller, geometry: Geometry) -> None:
        self._c = controller
        self._sources = readers(controller)
        self._every = max(1, round(controller.frequency / _RATE))
        self.wires: list[TcpWire] = []
        """The primary port, then the secondary port."""
        g, quarter = geometry, math.pi / 2.0
        self._nominal = (
            (0.0,) * 6,
            (0.0, g.a2, g.a3, 0.0, 0.0, 0.0),
            (g.d1, 0.0, 0.0, g.d4, g.d5, g.d6),
            (quarter, 0.0, 0.0, quarter, -quarter, 0.0),
        )
        self._deltas = [[0.0] * 6 for _ in range(4)]
        self._reported = True
        controller.failed = self._report_error

    def calibrate(self, deltas: list[list[float]], reported: bool = True) -> None:
        """Set the offsets of the calibration for theta, a, d and alpha; `reported`: whether the ports report it."""
        if [len(row) for row in deltas] != [6] * 4:
            raise ValueError("four rows of six numbers")
        self._deltas, self._reported = deltas, reported

    def greet(self, connection: Connection) -> None:
        """Send a new client the version of the controller and the present state."""
        project = b"URControl"
        version = struct.pack(">BBii", *self._c.version[:4])
        connection.send(self._message(_VERSION_MESSAGE, bytes((len(project),)) + project + version + b"\0"))
        connection.send(self._state())

    def tick(self) -> None:
        """Send the state, if it is due."""
        if self._c.cycles % self._every == 0 and any(wire.connections for wire in self.wires):
            state = self._state()
            for wire in self.wires:
                for connection in tuple(wire.connections):
                    connection.send(state)

    def _report_error(self, text: str) -> None:
        """Send a run-time error of a program; line and column are not known."""
        for connection in tuple(self.wires[0].connections):
            connection.send(self._message(_RUNTIME_ERROR, struct.pack(">ii", -1, -1) + text.encode()))

    def _message(self, kind: int, content: bytes) -> bytes:
        return _framed(_ROBOT_MESSAGE, struct.pack(">Qbb", self._microseconds, _SOURCE, kind) + content)

    @property
    def _microseconds(self) -> int:
        return round(self._c.cycles * self._c.period * 1e6)

    def _state(self) -> bytes:
        packages = (_framed(kind, content) for kind, content in self._packages())
        return _framed(_ROBOT_STATE, b"".join(packages))

    def _packages(self) -> Iterator[tuple[int, bytes]]:
        """Return the types and contents of the packages of a robot state."""
        c, arm = self._c, self._c.arm
        powered, running = c.robot_mode >= RobotMode.POWER_ON, c.runtime is not Runtime.STOPPED
        stops = c.safety >= SafetyMode.SYSTEM_EMERGENCY_STOP, c.safety is SafetyMode.PROTECTIVE_STOP
        paused = c.runtime in (Runtime.PAUSED, Runtime.PAUSING)
        flags = True, True, powered, *stops, running, paused
        scaling = arm.rate if c.program is not None else 0.0
        mode = struct.pack(">Q7?BB3d", self._microseconds, *flags, c.robot_mode & 0xFF, 0, arm.slider, scaling, 1.0)
        yield 0, mode + b"\0"
        names = ("actual_q", "target_q", "actual_qd", "actual_current", "actual_joint_voltage", "joint_temperatures")
        joints = zip(*(self._sources[name]() for name in names), strict=True)
        yield 1, b"".join(struct.pack(">3d4fB", *values, 0.0, c.joint_mode) for values in joints)
        volts = self._sources["actual_robot_voltage"]()[0]
        yield 2, struct.pack(">bb2dfBffB", 0, 0, 0.0, 0.0, volts, 24 if powered else 0, 0.0, 30.0, c.joint_mode)
        analog = struct.pack(">bb2dbb2d", 0, 0, 0.0, 0.0, 1, 1, *c.analog_outputs)
        board = struct.pack(
            ">4f3BIBB", 35.0, volts, self._sources["actual_robot_current"]()[0], 0.1, c.safety, 0, 0, 0, 0, 0
        )
        yield 3, struct.pack(">ii", c.digital_inputs, c.digital_outputs) + analog + board
        yield 4, struct.pack(">12d", *arm.pose, *c.tcp_offset)
        if self._reported:
            yield 5, self._kinematics()
        yield 7, struct.pack(">7d", *c.tcp_force, 0.0)

    def _kinematics(self) -> bytes:
        rows = [
            n + d
            for row, delta in zip(self._nominal, self._deltas, strict=True)
            for n, d in zip(row, delta, strict=True)
        ]
        return struct.pack(">6I24dI", *_CHECKSUMS, *rows, 0)
