"""The real-time port: receives programs, and sends the state at the rate of the controller.

A state is its length in bytes (i32) and numbers (f64), big-endian; bits and modes are numbers, too. Later versions
append fields. Source: Universal Robots, "RealTime 5.10" (client interfaces).
"""

import struct
from typing import Final

from arcor2_fakes.ur.controller import Controller
from arcor2_fakes.ur.outputs import readers
from arcor2_fakes.wire import TcpWire

_FIELDS: Final = (
    *(("timestamp", 1), ("target_q", 6), ("target_qd", 6), ("target_qdd", 6), ("target_current", 6)),
    *(("target_moment", 6), ("actual_q", 6), ("actual_qd", 6), ("actual_current", 6), ("joint_control_output", 6)),
    *(("actual_TCP_pose", 6), ("actual_TCP_speed", 6), ("actual_TCP_force", 6)),
    *(("target_TCP_pose", 6), ("target_TCP_speed", 6), ("actual_digital_input_bits", 1), ("joint_temperatures", 6)),
    *(("actual_execution_time", 1), ("", 1), ("robot_mode", 1), ("joint_mode", 6), ("safety_mode", 1), ("", 6)),
    *(("actual_tool_accelerometer", 3), ("", 6), ("speed_scaling", 1), ("actual_momentum", 1), ("", 2)),
    *(("actual_main_voltage", 1), ("actual_robot_voltage", 1), ("actual_robot_current", 1)),
    *(("actual_joint_voltage", 6), ("actual_digital_output_bits", 1), ("runtime_state", 1)),
    *(("elbow_position", 3), ("elbow_velocity", 3), ("safety_status", 1), ("", 3)),
    *(("payload", 1), ("payload_cog", 3), ("payload_inertia", 6)),
)
"""RTDE variables with the number of their values; "": used by the vendor only."""
_COUNTS: Final = {(5, 10): 152, (5, 9): 142, (5, 4): 139, (3, 5): 138, (3, 2): 132, (0, 0): 130}
"""Number of values from a version on."""
_CB3, _CB3_RATE = 3, 125.0


class RealTimeStream:
    """Sends the state to all clients of a wire. Call `tick` once per control cycle."""

    def __init__(self, controller: Controller, wire: TcpWire) -> None:
        self._controller, self._wire = controller, wire
        sources = readers(controller)
        self._sources = [sources.get(name, lambda count=count: (0.0,) * count) for name, count in _FIELDS]
        version = controller.version[:2]
        self._count = next(count for since, count in _COUNTS.items() if version >= since)
        self._format = struct.Struct(f">i{self._count}d")
        self._every = max(1, round(controller.frequency / _CB3_RATE)) if version[0] == _CB3 else 1

    def tick(self) -> None:
        """Send the state, if it is due."""
        if self._wire.connections and self._controller.cycles % self._every == 0:
            ready = [connection for connection in self._wire.connections if not connection.congested]
            if ready:
                frame = self._frame()
                for connection in ready:
                    connection.send(frame)

    def _frame(self) -> bytes:
        values = [value for read in self._sources for value in read()]
        return self._format.pack(self._format.size, *values[: self._count])
