"""The cell: a machine (OPC 40001-1), and a unit of PackML (OPC 30050) with its commands."""

from collections.abc import Awaitable, Callable, Sequence
from datetime import UTC, datetime
from typing import Any, Final

from asyncua import ua

from arcor2_hw.data.alarms import PRIORITIES, AlarmCategory, AlarmRecord
from arcor2_hw.data.device import Identity
from arcor2_hw.data.packml import MachineCommand, MachineState, UnitMode
from arcor2_hw.opcua.devices import add_identification, add_item_state, add_operation_mode
from arcor2_hw.opcua.messages import CallAnswer, Setup
from arcor2_hw.opcua.space import UNKNOWN, Space, Tag, node_id, status_code
from arcor2_hw.opcua.states import StateMachine
from arcor2_hw.plant.messages import DeviceInfo, UnitData

VENDOR: Final = "ARCOR2-HW"
REFUSED: Final = {
    1: ua.StatusCodes.BadUserAccessDenied,
    2: ua.StatusCodes.BadInvalidState,
    3: ua.StatusCodes.BadInvalidState,
    4: ua.StatusCodes.BadNotSupported,
    5: ua.StatusCodes.BadInvalidArgument,
    7: ua.StatusCodes.BadInvalidState,
    9: ua.StatusCodes.BadOutOfService,
}
"""Status codes of refused commands, by the result of the Modbus block."""
_CATEGORIES: Final = list(AlarmCategory)
JOB: Final = "Job"
"""Name of the parameter of Start with the number of the job."""
_S = MachineState
_BASE: Final = {"Aborting": 61, "Aborted": 62, "Cleared": 71}
_MACHINE: Final = {"Stopped": 53, "Stopping": 54, "Clearing": 55, "Running": 75}
_EXECUTE: Final = {
    "Resetting": 27, "Idle": 28, "Starting": 29, "Suspending": 30, "Suspended": 31, "Unsuspending": 32, "Holding": 33,
    "Held": 34, "Unholding": 35, "Execute": 36, "Completing": 37, "Complete": 38,
}  # fmt: skip
"""Numbers of the states in OPC 30050, by state machine."""
_ITEM_STATES: Final = {
    _S.ABORTED: "OutOfService",
    _S.ABORTING: "OutOfService",
    _S.EXECUTE: "Executing",
    _S.STARTING: "Executing",
    _S.UNHOLDING: "Executing",
    _S.HOLDING: "Executing",
    _S.STOPPING: "Executing",
}
"""MachineryItemState by state of PackML; NotExecuting in all others."""
_OPERATION_MODES: Final = {UnitMode.PRODUCE: "Processing", UnitMode.MAINTENANCE: "Maintenance"}
Execute = Callable[[int, int, str], Awaitable[CallAnswer]]
"""Executes a command: number of the command, job, identifier of the request."""
SetMode = Callable[[int], Awaitable[CallAnswer]]
"""Changes the mode: its number."""


class Unit:
    """The cell in the address space."""

    def __init__(self, space: Space, setup: Setup, execute: Execute, set_mode: SetMode) -> None:
        self._space, self._setup, self._execute, self._set_mode = space, setup, execute, set_mode
        self.node = space.own("cell")
        """The machine."""
        self.components = space.own("cell", "Components")

    async def add(self) -> None:
        """Add the machine and the unit."""
        space, name = self._space, self._space.name("own", self._setup.cell)
        await space.add_object(
            space.standard("machinery", 1001), name, reference=ua.ObjectIds.Organizes, node=self.node
        )
        blocks = await space.add_folder(self.node, space.name("machinery", "MachineryBuildingBlocks"))
        serial = f"urn:{self._setup.machine}:arcor2-hw"
        identity = Identity(VENDOR, "ARCOR2-HW cell", self._setup.machine, self._setup.version)
        await add_identification(space, self.node, blocks, 1012, DeviceInfo("", "", "", identity=identity))
        identification = space.own("cell", "MachineryBuildingBlocks", "Identification")
        await space.add_property(identification, space.name("di", "ProductInstanceUri"), serial)
        self._item = await add_item_state(space, blocks)
        self._mode = await add_operation_mode(space, blocks)
        await space.add_object(
            self.node,
            space.name("machinery", "Components"),
            space.standard("machinery", 1006),
            ua.ObjectIds.HasAddIn,
            node=self.components,
        )
        await space.add_reference(blocks, ua.ObjectIds.HasAddIn, self.components)
        await self._add_production()
        await self._add_packml(name)

    async def _add_production(self) -> None:
        space = self._space
        self._production: dict[str, Tag] = {}
        folder = await space.add_folder(self.node, space.name("own", "Production"))
        for field in ("authority", "program", "recipe", "job", "last_job", "job_end", "good", "bad", "rejected"):
            first = getattr(UnitData(), field)
            kind = ua.ObjectIds.String if isinstance(first, str) else ua.ObjectIds.UInt32
            name = space.name("own", field.title().replace("_", ""))
            self._production[field] = await space.add_variable(folder, name, first, kind)

        async def request(_parent: ua.NodeId, *arguments: ua.Variant) -> Any:
            values = [argument.Value for argument in arguments]
            if len(values) != len(inputs) or not all(map(isinstance, values, (str, int, int))):
                return status_code(ua.StatusCodes.BadInvalidArgument)
            identifier, command, job = values
            if not identifier:
                return status_code(ua.StatusCodes.BadInvalidArgument)
            answer = await self._execute(command, job, identifier)
            return [ua.Variant(answer.result, ua.VariantType.UInt16), ua.Variant(answer.text)]

        inputs = [
            _argument("RequestId", ua.ObjectIds.String, "Identifies the request. It is executed once."),
            _argument("Command", ua.ObjectIds.Int32, "Number of a command of PackML."),
            _argument("Job", ua.ObjectIds.UInt16, "Number of the job for Start, else 0."),
        ]
        outputs = [
            _argument("Result", ua.ObjectIds.UInt16, "0: executed, else why it is refused."),
            _argument("Text", ua.ObjectIds.String, "Why it is refused."),
        ]
        await space.add_method(self.node, space.name("own", "Request"), request, inputs, outputs)

    async def _add_packml(self, name: ua.QualifiedName) -> None:
        space = self._space

        def pack(name: str) -> ua.QualifiedName:
            return space.name("packml", name)

        unit = await space.add_object(
            space.standard("packml", 72),
            name,
            space.standard("packml", 6),
            ua.ObjectIds.Organizes,
            node=space.own("unit"),
        )
        await space.add_property(unit, pack("TagID"), self._setup.cell)
        await space.add_property(unit, pack("PackMLVersion"), "TR88.00.02-2015")
        # Status
        status = await space.add_object(unit, pack("Status"), space.standard("packml", 4))
        modes = await self._add_modes()
        await space.add_property(status, pack("UnitSupportedModes"), modes, ua.ObjectIds.NodeId)
        self._unit_mode = await space.add_variable(status, pack("UnitModeCurrent"), 1, modes)
        for variable in ("MachSpeed", "CurMachSpeed"):
            tag = await space.add_variable(
                status, pack(variable), None, ua.ObjectIds.Float, ua.ObjectIds.AnalogItemType, status=UNKNOWN
            )
            await space.add_property(tag.node, space.name("ua", "EURange"), ua.Range(), ua.ObjectIds.Range)
        for variable in ("EquipmentBlocked", "EquipmentStarved"):
            await space.add_variable(status, pack(variable), None, ua.ObjectIds.Boolean, status=UNKNOWN)
        # Admin
        admin = await space.add_object(unit, pack("Admin"), space.standard("packml", 5))
        count, alarm = space.standard("packml", 14), space.standard("packml", 15)
        self._processed, self._defective = [
            await space.add_variable(admin, pack(f"Prod{kind}Count"), [], count, rank=1, variant=_EXTENSION)
            for kind in ("Processed", "Defective")
        ]
        self._stop_reason = await space.add_variable(admin, pack("StopReason"), [], alarm, rank=1, variant=_EXTENSION)
        # State machines, each within a state of the one before
        base = await space.add_object(unit, pack("BaseStateMachine"), space.standard("packml", 3))
        machine = await space.add_object(base, pack("MachineState"), space.standard("packml", 2))
        execute = await space.add_object(machine, pack("ExecuteState"), space.standard("packml", 1))
        self._machines = [
            (await self._add_machine(node, states), states)
            for node, states in ((base, _BASE), (machine, _MACHINE), (execute, _EXECUTE))
        ]
        for node, commands in ((base, ("Abort", "Clear")), (machine, ("Stop", "Reset")),
                               (execute, ("Reset", "Hold", "Unhold"))):  # fmt: skip
            for command in commands:
                await space.add_method(node, pack(command), self._command(MachineCommand[command.upper()]))
        parameter = _argument("Parameter", space.standard("packml", 16), "Job: number of the job", rank=1)
        await space.add_method(execute, pack("Start"), self._start, [parameter])
        mode = _argument("RequestedMode", ua.ObjectIds.Int32, "Number of the mode in UnitSupportedModes")
        await space.add_method(unit, pack("SetUnitMode"), self._change_mode, [mode])
        for method in ("SetMachSpeed", "SetProduct", "SetParameter"):
            await space.add_method(unit, pack(method), None)

    async def _add_machine(self, node: ua.NodeId, states: dict[str, int]) -> StateMachine:
        space = self._space
        identifiers = {name: space.standard("packml", number) for name, number in states.items()}
        for name, value in (("AvailableStates", list(identifiers.values())), ("AvailableTransitions", [])):
            await space.add_variable(node, space.name("ua", name), value, ua.ObjectIds.NodeId, rank=1)
        return await StateMachine.add(space, node, identifiers)

    async def _add_modes(self) -> ua.NodeId:
        """Add the enumeration of our modes, a subtype of that of the specification."""
        space = self._space
        base = space.server.get_node(space.standard("packml", 11))
        node = await base.add_data_type(space.own("UnitModes"), space.name("own", "UnitModes"))
        names = ["Invalid", *(mode.name.capitalize() for mode in UnitMode)]
        values = [
            ua.EnumValueType(number, ua.LocalizedText(name), ua.LocalizedText(name))
            for number, name in enumerate(names)
        ]
        await space.add_variable(
            node.nodeid,
            space.name("ua", "EnumValues"),
            values,
            ua.ObjectIds.EnumValueType,
            ua.ObjectIds.PropertyType,
            rank=1,
            variant=_EXTENSION,
        )
        return node.nodeid

    # -------------------------------------------------------------------------------- commands
    def _command(self, command: MachineCommand) -> Callable[..., Awaitable[ua.StatusCode]]:
        async def execute(_parent: ua.NodeId, *_arguments: ua.Variant) -> ua.StatusCode:
            return _status(await self._execute(command, 0, ""))

        return execute

    async def _start(self, _parent: ua.NodeId, *arguments: ua.Variant) -> ua.StatusCode:
        parameters = arguments[0].Value if arguments and arguments[0].Value else []
        job = next((round(each.Value) for each in parameters if getattr(each, "Name", "") == JOB), 0)
        return _status(await self._execute(MachineCommand.START, job, ""))

    async def _change_mode(self, _parent: ua.NodeId, *arguments: ua.Variant) -> ua.StatusCode | ua.CallMethodResult:
        if len(arguments) != 1:
            codes = ua.StatusCodes
            return status_code(codes.BadTooManyArguments if arguments else codes.BadArgumentsMissing)
        mode = arguments[0].Value
        if arguments[0].VariantType is not ua.VariantType.Int32 or isinstance(mode, list):
            return _invalid_argument(ua.StatusCodes.BadTypeMismatch)
        if mode not in list(UnitMode):
            return _invalid_argument(ua.StatusCodes.BadOutOfRange)
        return _status(await self._set_mode(mode))

    # -------------------------------------------------------------------------------- values
    async def set(self, data: UnitData) -> None:
        """Show the state of the cell."""
        state, mode = MachineState(data.state), UnitMode(data.mode)
        await self._unit_mode.write(data.mode)
        await self._item.enter(_ITEM_STATES.get(state, "NotExecuting"))
        await self._mode.enter(_OPERATION_MODES.get(mode, "Setup"))
        name: str | None = state.name.capitalize()
        for machine, states in self._machines:
            if name is None or name in states:
                await machine.enter(name)
                name = None
            else:
                await machine.enter("Cleared" if states is _BASE else "Running")
        for field, tag in self._production.items():
            await tag.write(getattr(data, field))
        defective = data.bad + data.rejected
        await self._processed.write([_count(data.recipe or data.program, data.good + defective)])
        await self._defective.write(
            [_count(kind, number) for kind, number in (("bad", data.bad), ("rejected", data.rejected))]
        )

    async def set_stop_reason(self, alarms: Sequence[AlarmRecord]) -> None:
        """Show the alarms that need attention, the first one of the most urgent priority first."""
        ordered = sorted(alarms, key=lambda each: (-PRIORITIES.index(each.priority), each.number))
        reasons = []
        for each in ordered[:10]:
            reason = ua.PackMLAlarmDataType()  # type: ignore[attr-defined]
            reason.ID, reason.Value = each.number, PRIORITIES.index(each.priority) + 1
            reason.Message, reason.Category = (
                f"{each.kind}: {each.text}",
                list(type(each.category)).index(each.category),
            )
            reason.DateTime = datetime.fromisoformat(each.raised)
            reason.AckDateTime = _time_or_none(each)
            reason.Trigger = each.active
            reasons.append(reason)
        await self._stop_reason.write(reasons)


_EXTENSION: Final = ua.VariantType.ExtensionObject


def _time_or_none(alarm: AlarmRecord) -> datetime:
    return datetime.fromisoformat(alarm.acknowledged_at) if alarm.acknowledged_at else datetime(1601, 1, 1, tzinfo=UTC)


def _status(answer: CallAnswer) -> ua.StatusCode:
    return status_code(REFUSED.get(answer.result, ua.StatusCodes.BadInvalidState) if answer.result else 0)


def _invalid_argument(reason: Any) -> ua.CallMethodResult:
    """Return the result of a call whose only argument is refused."""
    result = ua.CallMethodResult()
    result.StatusCode = status_code(ua.StatusCodes.BadInvalidArgument)
    result.InputArgumentResults = [status_code(reason)]
    return result


def _count(name: str, number: int) -> Any:
    count = ua.PackMLCountDataType()  # type: ignore[attr-defined]
    count.Name, count.Count, count.AccCount = name, number, number
    return count


def _argument(name: str, data_type: ua.NodeId | int, text: str, rank: int = -1) -> ua.Argument:
    return ua.Argument(
        Name=name,
        DataType=data_type if isinstance(data_type, ua.NodeId) else node_id(data_type),
        ValueRank=rank,
        ArrayDimensions=[0] if rank > 0 else [],
        Description=ua.LocalizedText(text),
    )
