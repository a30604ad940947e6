"""Devices of the cell: components of a machine (OPC 40001-1) with their points, and robots (OPC 40010-1)."""

import time
from collections.abc import Mapping
from typing import Any, Final

from asyncua import ua

from arcor2_hw.data.base import Unset
from arcor2_hw.data.device import Connection, Health, Identity
from arcor2_hw.data.points import LivePoint, PointQuality
from arcor2_hw.data.robot import Joint, RobotType
from arcor2_hw.opcua.space import GOOD, NOT_CONNECTED, UNKNOWN, Space, Tag
from arcor2_hw.opcua.states import StateMachine
from arcor2_hw.plant.messages import DeviceInfo, DeviceState, UnitData
from arcor2_hw.plant.streams import time_of

STALE: Final = ua.StatusCodes.UncertainLastUsableValue
_STATUS: Final = {
    PointQuality.GOOD: GOOD,
    PointQuality.UNCERTAIN: ua.StatusCodes.UncertainSensorNotAccurate,
    PointQuality.STALE: STALE,
    PointQuality.BAD: ua.StatusCodes.BadDeviceFailure,
    PointQuality.NOT_CONNECTED: NOT_CONNECTED,
}
_CONNECTED: Final = (Connection.ONLINE, Connection.BACK)
_CATEGORIES: Final = {RobotType.ARTICULATED: 1, RobotType.SCARA: 2, RobotType.CARTESIAN: 3}
"""Numbers of MotionDeviceCategoryEnumeration; 0: other."""
_PROFILES: Final = {RobotType.ARTICULATED: (1, "rad"), RobotType.CARTESIAN: (3, "m")}
"""Numbers of AxisMotionProfileEnumeration, and units; 0: other."""
_PROTECTIVE: Final = frozenset({"protective_stop", "safeguard_stop"})
_ITEM_STATES: Final = {"OutOfService": 5004, "NotAvailable": 5005, "Executing": 5006, "NotExecuting": 5007}
_MODES: Final = {"None": 5024, "Maintenance": 5025, "Processing": 5026, "Setup": 5027}


async def add_identification(space: Space, item: ua.NodeId, blocks: ua.NodeId, kind: int, info: DeviceInfo) -> None:
    """Add the building block Identification to a machine or component.

    Args:
        space: the address space.
        item: the machine or component.
        blocks: its folder MachineryBuildingBlocks.
        kind: number of the type in OPC 40001-1.
        info: its identification.
    """
    node = await space.add_object(
        blocks, space.name("di", "Identification"), space.standard("machinery", kind), ua.ObjectIds.HasAddIn
    )
    await space.add_reference(item, ua.ObjectIds.HasAddIn, node)
    await add_nameplate(space, node, info.identity)
    if info.name:
        await _text(space, node, "ComponentName", info.name)
    if info.type:
        await space.add_property(node, space.name("di", "DeviceClass"), info.type)
    if info.identity.firmware:
        await space.add_property(node, space.name("di", "SoftwareRevision"), info.identity.firmware)


async def add_nameplate(space: Space, node: ua.NodeId, identity: Identity, *, product_code: bool = False) -> None:
    """Add manufacturer, model and serial number to a device."""
    await _text(space, node, "Manufacturer", identity.vendor)
    await _text(space, node, "Model", identity.model)
    await space.add_property(node, space.name("di", "SerialNumber"), identity.serial)
    if product_code:
        await space.add_property(node, space.name("di", "ProductCode"), identity.model)


async def _text(space: Space, node: ua.NodeId, name: str, text: str) -> None:
    await space.add_property(node, space.name("di", name), ua.LocalizedText(text), ua.ObjectIds.LocalizedText)


async def add_machinery_state(
    space: Space, blocks: ua.NodeId, name: str, kind: int, states: Mapping[str, int]
) -> StateMachine:
    """Add a state machine of OPC 40001-1 as a building block."""
    node = await space.add_object(
        blocks, space.name("machinery", name), space.standard("machinery", kind), ua.ObjectIds.HasAddIn
    )
    return await StateMachine.add(
        space, node, {state: space.standard("machinery", number) for state, number in states.items()}
    )


async def add_item_state(space: Space, blocks: ua.NodeId) -> StateMachine:
    """Add the state of a machine or component."""
    return await add_machinery_state(space, blocks, "MachineryItemState", 1002, _ITEM_STATES)


async def add_operation_mode(space: Space, blocks: ua.NodeId) -> StateMachine:
    """Add the operation mode of a machine."""
    return await add_machinery_state(space, blocks, "MachineryOperationMode", 1008, _MODES)


class Device:
    """A device as a component of the cell. `add` adds it to the address space."""

    def __init__(self, space: Space, info: DeviceInfo) -> None:
        self.info = info
        self._space = space
        self._connection = Connection.OFFLINE
        self._points: dict[str, Tag] = {}
        self._streamed = 0.0
        self.node = space.own("devices", info.id)
        """The component, which is also the source of its alarms."""
        self.robot = Robot(space, info) if info.robot_type else None

    async def add(self, components: ua.NodeId) -> None:
        """Add the device to the components of the cell."""
        space, info = self._space, self.info
        await space.add_object(components, space.name("own", info.name), node=self.node)
        blocks = await space.add_folder(self.node, space.name("machinery", "MachineryBuildingBlocks"))
        await add_identification(space, self.node, blocks, 1005, info)
        self._item = await add_item_state(space, blocks)
        self._connection_tag = await space.add_variable(self.node, space.name("own", "Connection"), "offline")
        self._health_tag = await space.add_variable(self.node, space.name("own", "Health"), Health.NORMAL.value)
        self._folder = await space.add_folder(self.node, space.name("own", "Points"))
        if self.robot is not None:
            await self.robot.add()
        await self.set_state(DeviceState())

    async def remove(self) -> None:
        """Remove the device from the address space."""
        await self._space.remove(self.node)
        if self.robot is not None:
            await self._space.remove(self.robot.node)

    @property
    def connected(self) -> bool:
        """Whether the device is connected."""
        return self._connection in _CONNECTED

    @property
    def nodes(self) -> list[ua.NodeId]:
        """The component, and the robot if it is one. Each has a stream of values."""
        return [self.node] if self.robot is None else [self.node, self.robot.node]

    @property
    def monitored(self) -> bool:
        """Whether a client monitors a value of the device."""
        axes = () if self.robot is None else self.robot.axes
        return any(tag.monitored for tag in (*self._points.values(), *axes))

    async def set_state(self, state: DeviceState) -> None:
        """Show connection, health and alarms."""
        self._connection = state.connection
        await self._connection_tag.write(state.connection.value)
        await self._health_tag.write(state.health.value)
        if not self.connected:
            await self._item.enter("NotAvailable")
            await self._invalidate(NOT_CONNECTED)
        elif state.health is Health.FAILURE:
            await self._item.enter("OutOfService")
        else:
            await self._item.enter("Executing" if state.executing else "NotExecuting")
        if self.connected and not state.answering:
            await self._invalidate(STALE)
        if self.robot is not None:
            await self.robot.set_state(state, connected=self.connected)

    async def set_points(self, points: list[LivePoint], time_ms: float) -> None:
        """Show the points of the device, as they were at a time of the monotonic clock, ms."""
        self._streamed = time.monotonic()
        for point in points:
            age = 0.0 if isinstance(point.age, Unset) else point.age
            at = time_of(time_ms / 1e3 - age)
            status = _STATUS[point.quality] if self.connected else NOT_CONNECTED
            tag = self._points.get(point.name)
            if tag is None:
                self._points[point.name] = await self._add_point(point, status)
            else:
                await tag.write(_number(point.value), status, at)

    async def _add_point(self, point: LivePoint, status: int) -> Tag:
        space, value = self._space, _number(point.value)
        kinds = {bool: ua.ObjectIds.Boolean, float: ua.ObjectIds.Double, str: ua.ObjectIds.String}
        data_type = kinds.get(type(value), ua.ObjectIds.BaseDataType)
        measured = bool(point.unit) and isinstance(value, float)
        kind = ua.ObjectIds.AnalogUnitType if measured else ua.ObjectIds.BaseDataVariableType
        name = space.name("own", point.name)
        tag = await space.add_variable(self._folder, name, value, data_type, kind, status=status)
        await space.add_property(tag.node, space.name("own", "Use"), point.use.value)
        if measured:
            await space.add_unit(tag.node, point.unit)
        return tag

    async def set_joints(self, joints: list[Joint], time_ms: float) -> None:
        """Show the joints of a robot, as they were at a time of the monotonic clock, ms."""
        self._streamed = time.monotonic()
        if self.robot is not None and self.connected:
            await self.robot.set_joints(joints, time_ms)

    async def expire(self, older_than: float) -> None:
        """Mark the values as stale if none arrived for that time, s."""
        if self.connected and time.monotonic() - self._streamed > older_than:
            await self._invalidate(STALE)

    async def _invalidate(self, status: int) -> None:
        for tag in self._points.values():
            await tag.invalidate(status)
        if self.robot is not None:
            await self.robot.invalidate(status)


class Robot:
    """A robot as a motion device system: one controller, one motion device, one safety state."""

    def __init__(self, space: Space, info: DeviceInfo) -> None:
        self._space, self._info = space, info
        self._type = RobotType(info.robot_type)
        self.node = space.own("robots", info.id)
        self._axes: dict[str, tuple[Tag, Tag]] = {}
        self._last: tuple[float, dict[str, float]] = (0.0, {})

    @property
    def axes(self) -> list[Tag]:
        """The variables of the axes."""
        return [tag for tags in self._axes.values() for tag in tags]

    async def add(self) -> None:
        """Add the system to the device set."""
        space, info = self._space, self._info

        def typed(number: int) -> ua.NodeId:
            return space.standard("robotics", number)

        async def folder(parent: ua.NodeId, name: str) -> ua.NodeId:
            return await space.add_folder(parent, space.name("robotics", name))

        async def parameters(parent: ua.NodeId) -> ua.NodeId:
            return await space.add_object(parent, space.name("di", "ParameterSet"))

        def own(name: str) -> ua.QualifiedName:
            return space.name("own", name)

        device_set = space.standard("di", 5001)
        await space.add_object(device_set, own(info.name), typed(1002), node=self.node)
        await _text(space, self.node, "ComponentName", info.name)
        await add_nameplate(space, self.node, info.identity)
        # Controller with the program of the cell
        controller = await space.add_object(await folder(self.node, "Controllers"), own("Controller"), typed(1003))
        await add_nameplate(space, controller, info.identity, product_code=True)
        software = await space.add_object(
            await folder(controller, "Software"), own("Firmware"), space.standard("di", 15106)
        )
        await _text(space, software, "Manufacturer", info.identity.vendor)
        await _text(space, software, "Model", info.identity.model)
        await space.add_property(software, space.name("di", "SoftwareRevision"), info.identity.firmware)
        user = await space.add_object(controller, space.name("robotics", "CurrentUser"), typed(18175))
        await space.add_property(user, space.name("robotics", "Level"), "")
        task = await space.add_object(await folder(controller, "TaskControls"), own("Program"), typed(1011))
        await _text(space, task, "ComponentName", "Program of the cell")
        task_parameters = await parameters(task)
        self._program = await space.add_variable(task_parameters, space.name("robotics", "TaskProgramName"), "")
        self._loaded = await space.add_variable(
            task_parameters, space.name("robotics", "TaskProgramLoaded"), False, ua.ObjectIds.Boolean
        )
        # Motion device
        device = await space.add_object(await folder(self.node, "MotionDevices"), own("Robot"), typed(1004))
        await add_nameplate(space, device, info.identity, product_code=True)
        await space.add_property(
            device, space.name("robotics", "MotionDeviceCategory"), _CATEGORIES.get(self._type, 0), typed(18193)
        )
        await space.add_variable(
            await parameters(device),
            space.name("robotics", "SpeedOverride"),
            None,
            ua.ObjectIds.Double,
            status=UNKNOWN,
        )
        self._axes_folder = await folder(device, "Axes")
        await folder(device, "PowerTrains")
        await space.add_reference(controller, typed(4002), device)
        # Safety
        safety = await space.add_object(await folder(self.node, "SafetyStates"), own("Safety"), typed(1013))
        await space.add_reference(controller, typed(18182), safety)
        values = await parameters(safety)
        self._stops = [
            await space.add_variable(values, space.name("robotics", name), None, ua.ObjectIds.Boolean, status=UNKNOWN)
            for name in ("EmergencyStop", "ProtectiveStop")
        ]
        await space.add_variable(values, space.name("robotics", "OperationalMode"), None, typed(3006), status=UNKNOWN)

    async def set_state(self, state: DeviceState, *, connected: bool) -> None:
        """Show the stops that the driver reports."""
        for tag, active in zip(
            self._stops, ("emergency_stop" in state.alarms, bool(_PROTECTIVE & set(state.alarms))), strict=True
        ):
            await tag.write(active if connected else None, GOOD if connected else NOT_CONNECTED)

    async def set_program(self, unit: UnitData) -> None:
        """Show the program of the cell."""
        await self._program.write(unit.program)
        await self._loaded.write(unit.loaded)

    async def set_joints(self, joints: list[Joint], time_ms: float) -> None:
        """Show the positions, and the mean speeds since the last positions."""
        at, before = self._last
        elapsed = (time_ms - at) / 1e3
        stamp = time_of(time_ms / 1e3)
        for joint in joints:
            if joint.name not in self._axes:
                self._axes[joint.name] = await self._add_axis(joint.name)
            position, speed = self._axes[joint.name]
            await position.write(joint.value, GOOD, stamp)
            if joint.name in before and 0.0 < elapsed < 1.0:
                await speed.write((joint.value - before[joint.name]) / elapsed, GOOD, stamp)
        self._last = time_ms, {joint.name: joint.value for joint in joints}

    async def _add_axis(self, name: str) -> tuple[Tag, Tag]:
        space = self._space
        profile, unit = (0, "") if "grip" in name.casefold() else _PROFILES.get(self._type, (0, ""))
        axis = await space.add_object(self._axes_folder, space.name("own", name), space.standard("robotics", 16601))
        await space.add_property(
            axis, space.name("robotics", "MotionProfile"), profile, space.standard("robotics", 3008)
        )
        values = await space.add_object(axis, space.name("di", "ParameterSet"))
        tags = []
        for variable, of in (("ActualPosition", unit), ("ActualSpeed", f"{unit}/s" if unit else "")):
            tag = await space.add_variable(
                values,
                space.name("robotics", variable),
                None,
                ua.ObjectIds.Double,
                ua.ObjectIds.AnalogUnitType,
                status=UNKNOWN,
            )
            await space.add_unit(tag.node, of)
            tags.append(tag)
        return tags[0], tags[1]

    async def invalidate(self, status: int) -> None:
        """Mark the axes as stale or not connected."""
        self._last = (0.0, {})
        for tag in self.axes:
            await tag.invalidate(status)


def _number(value: Any) -> Any:
    """Return a value with the type that it has in the address space: all numbers are of type Double."""
    return float(value) if isinstance(value, int | float) and not isinstance(value, bool) else value
