"""Sources of the RTDE output variables, and effects of the RTDE input variables."""

from collections.abc import Callable, Sequence
from typing import Any

from arcor2_fakes.ur.controller import Controller
from arcor2_fakes.ur.kinematics import to_pose
from arcor2_fakes.ur.states import RobotMode

Reader = Callable[[], Sequence[Any]]

_TORQUE_PER_AMPERE = (9.5, 9.5, 9.5, 7.0, 7.0, 7.0)
_LINK_LOAD = (0.0, 30.0, 14.0, 1.5, 1.0, 0.0)  # N m at full reach, roughly those of a UR5e


def readers(c: Controller) -> dict[str, Reader]:
    """Return a function per RTDE output variable; it returns the values to pack."""
    arm = c.arm
    six = (0.0,) * 6

    def constant(*values: Any) -> Reader:
        return lambda: values

    def torques() -> tuple[float, ...]:
        """Return the gravity torques of links and payload on joints 2 and 3, by reach; not a dynamic model."""
        if c.robot_mode is not RobotMode.RUNNING:
            return six
        x, y = arm.pose[0], arm.pose[1]
        reach = (x * x + y * y) ** 0.5
        load = 9.81 * c.payload * reach
        return tuple(f * reach + (load if 0 < i < 3 else 0.0) for i, f in enumerate(_LINK_LOAD))

    def currents() -> tuple[float, ...]:
        return tuple(t / k + 0.4 * v for t, k, v in zip(torques(), _TORQUE_PER_AMPERE, arm.qd, strict=True))

    table: dict[str, Reader] = {
        "timestamp": lambda: (c.cycles * c.period,),
        "target_q": lambda: arm.q,
        "target_qd": lambda: arm.qd,
        "actual_q": lambda: arm.q,
        "actual_qd": lambda: arm.qd,
        "target_current": currents,
        "actual_current": currents,
        "target_moment": torques,
        "actual_TCP_pose": lambda: arm.pose,
        "target_TCP_pose": lambda: arm.pose,
        "actual_TCP_speed": arm.twist,
        "target_TCP_speed": arm.twist,
        "actual_TCP_force": lambda: c.tcp_force,
        "tcp_force_scalar": lambda: (sum(f * f for f in c.tcp_force[:3]) ** 0.5,),
        "actual_digital_input_bits": lambda: (c.digital_inputs,),
        "actual_digital_output_bits": lambda: (c.digital_outputs,),
        "actual_execution_time": constant(0.00021),
        "robot_mode": lambda: (c.robot_mode,),
        "joint_mode": lambda: (c.joint_mode,) * 6,
        "safety_mode": lambda: (c.safety,),
        "safety_status": lambda: (c.safety,),
        "robot_status_bits": lambda: (c.robot_bits,),
        "safety_status_bits": lambda: (c.safety_bits,),
        "runtime_state": lambda: (c.runtime,),
        "speed_scaling": lambda: (arm.rate if c.program is not None else 0.0,),
        "target_speed_fraction": lambda: (arm.slider,),
        "joint_temperatures": constant(28.5, 29.0, 28.8, 31.2, 31.9, 32.4),
        "actual_joint_voltage": lambda: (48.0 if c.robot_mode >= RobotMode.POWER_ON else 0.0,) * 6,
        "actual_main_voltage": constant(48.0),
        "actual_robot_voltage": lambda: (48.0 if c.robot_mode >= RobotMode.POWER_ON else 0.0,),
        "actual_robot_current": lambda: (0.3 + sum(map(abs, currents())) / 6.0,),
        "actual_tool_accelerometer": constant(0.0, 0.0, -9.81),
        "payload": lambda: (c.payload,),
        "payload_cog": lambda: c.payload_cog,
        "payload_inertia": lambda: c.payload_inertia,
        "tcp_offset": lambda: c.tcp_offset,
        "standard_analog_output0": lambda: (c.analog_outputs[0],),
        "standard_analog_output1": lambda: (c.analog_outputs[1],),
        "tool_output_voltage": constant(24),
        "tool_temperature": constant(30.0),
        "output_bit_registers0_to_31": lambda: (c.output_bits & 0xFFFFFFFF,),
        "output_bit_registers32_to_63": lambda: (c.output_bits >> 32 & 0xFFFFFFFF,),
        "input_bit_registers0_to_31": lambda: (c.input_bits & 0xFFFFFFFF,),
        "input_bit_registers32_to_63": lambda: (c.input_bits >> 32 & 0xFFFFFFFF,),
    }

    def item(values: list[Any], i: int) -> Reader:
        return lambda: (values[i],)

    for i in range(48):
        table[f"output_int_register_{i}"] = item(c.output_ints, i)
        table[f"output_double_register_{i}"] = item(c.output_doubles, i)
        table[f"input_int_register_{i}"] = item(c.input_ints, i)
        table[f"input_double_register_{i}"] = item(c.input_doubles, i)
    return table


def flange_pose(c: Controller) -> tuple[float, ...]:
    """Return the flange as x, y, z and rotation vector."""
    return to_pose(c.chain.flange(c.arm.q))


def apply_inputs(c: Controller, values: dict[str, Any]) -> None:
    """Apply the I/O variables of one RTDE package; a mask selects the bits."""
    for group, shift in (("standard", 0), ("configurable", 8), ("tool", 16)):
        mask = values.get(f"{group}_digital_output_mask", 0)
        if mask:
            bits = values.get(f"{group}_digital_output", 0)
            c.digital_outputs = c.digital_outputs & ~(mask << shift) | (bits & mask) << shift
            c.changed()
    if values.get("speed_slider_mask", 0):
        c.arm.slider = min(1.0, max(0.0, values.get("speed_slider_fraction", c.arm.slider)))
    mask = values.get("standard_analog_output_mask", 0)
    for i in range(2):
        if mask >> i & 1:
            c.analog_outputs[i] = values.get(f"standard_analog_output_{i}", c.analog_outputs[i])
    for i, name in enumerate(("input_bit_registers0_to_31", "input_bit_registers32_to_63")):
        if name in values:
            c.input_bits = c.input_bits & ~(0xFFFFFFFF << 32 * i) | values[name] << 32 * i
