"""All errors: each has a stable code, a message for the operator and a detail for the technician."""

from collections.abc import Mapping
from types import MappingProxyType
from typing import ClassVar, Final, Self

from arcor2_hw.messages import Message


class Arcor2Error(Exception):
    """Base of all errors. `str(error)` is the message for the operator.

    Args:
        message: The message; with values its template, such as "{robot} did not answer within {limit:g} s.". The
            default is the first line of the docstring of the class.
        detail: Detail for the technician, such as address, register or received answer.
        values: Values of the fields of the template, by name.

    Attributes:
        code: Stable text for programs.
        message: The message with the key and values for its translation.
    """

    code: ClassVar[str] = "error"

    def __init__(self, message: str | Message = "", detail: str = "", **values: object) -> None:
        if not isinstance(message, Message):
            message = Message.of(message or (type(self).__doc__ or "").strip().splitlines()[0], **values)
        super().__init__(message.text)
        self.message = message
        self.detail = detail

    def with_message(self, message: Message) -> Self:
        """Return an error like this one with another message."""
        error = type(self).__new__(type(self))  # its constructor may require other arguments
        vars(error).update(vars(self))
        error.args = (message.text,)
        error.message = message
        return error


def message_of(error: BaseException) -> Message:
    """Return the message of any error; the name of its class if it has none."""
    return error.message if isinstance(error, Arcor2Error) else Message.of(str(error) or type(error).__name__)


# ------------------------------------------------------------------------------------------------ devices
class DeviceError(Arcor2Error):
    """An error of a device or its connection."""

    code = "device"


class NotConnected(DeviceError):
    """The device is not connected. Nothing was sent."""

    code = "not_connected"


class ConnectionLost(DeviceError):
    """The connection broke. Commands sent before may or may not have been executed."""

    code = "connection_lost"


class OutcomeUnknown(ConnectionLost):
    """The connection broke before the answer arrived. It is not known whether the call was executed."""

    code = "outcome_unknown"


class DeviceTimeout(DeviceError):
    """The device did not answer, or did not finish, within the time limit."""

    code = "device_timeout"


class Refused(DeviceError):
    """The device, or its driver, refuses the command in the present state."""

    code = "refused"


class ArrivedLate(Refused):
    """The command arrived too late and was not executed."""

    code = "arrived_late"


class NotInControl(Refused):
    """Another client has control of the device."""

    code = "not_in_control"


class DifferentDevice(Refused):
    """The connected device is not the confirmed one. A technician has to confirm it."""

    code = "different_device"


class WatchdogTripped(ConnectionLost, NotInControl):
    """This computer was too slow for the watchdog of the device, which has stopped."""

    code = "watchdog_tripped"


class OutOfRange(DeviceError):
    """A value is outside of the range that the device allows. Nothing was sent."""

    code = "out_of_range"


class Stale(DeviceError):
    """The newest value is older than allowed."""

    code = "stale"


class NoDepth(DeviceError):
    """The camera has no depth, or too few pixels have one."""

    code = "no_depth"


class Overexposed(DeviceError):
    """Too many pixels are saturated. Reduce the exposure or the light."""

    code = "overexposed"


class DeviceFault(DeviceError):
    """The device reports a fault of its own."""

    code = "device_fault"

    def __init__(
        self, message: str | Message = "", detail: str = "", fault_code: int | str = "", **values: object
    ) -> None:
        super().__init__(message, detail, **values)
        self.fault_code = fault_code


class SafetyStop(DeviceError):
    """The safety system stopped the device. A person has to resolve the cause."""

    code = "safety_stop"

    def __init__(self, message: str | Message = "", detail: str = "", kind: str = "", **values: object) -> None:
        super().__init__(message, detail, **values)
        self.kind = kind


class Cancelled(DeviceError):
    """The command was stopped before it was completed."""

    code = "cancelled"


class ProgramInterrupted(Arcor2Error):
    """The program was interrupted at this action. A person decides how it continues."""

    code = "program_interrupted"


class PathBlocked(DeviceError):
    """An obstacle came into the path of a robot during a safe move; the robot was stopped."""

    code = "path_blocked"


class KinematicsError(DeviceError):
    """No joint values reach the pose, or a value is invalid for the robot."""

    code = "kinematics"


ERROR_KINDS: Final[Mapping[str, type[Arcor2Error]]] = MappingProxyType(
    {
        kind.code: kind
        for kind in (
            DeviceTimeout,
            Refused,
            OutOfRange,
            Stale,
            NoDepth,
            Overexposed,
            DeviceFault,
            PathBlocked,
            KinematicsError,
            Arcor2Error,
        )
    }
)
"""The kinds of errors that an error exit of an action can name, in the order in which exits apply. `error` is any
error."""

ENDS_PROGRAM: Final = (
    *(NotConnected, ConnectionLost, NotInControl, DifferentDevice),
    *(SafetyStop, Cancelled, ProgramInterrupted),
)
"""Errors that no error exit of an action catches: they end the program."""


# ------------------------------------------------------------------------------------------------ programs and data
class InvalidData(Arcor2Error):
    """The data is invalid."""

    code = "invalid_data"


class AddressChanged(InvalidData):
    """A stored secret was entered for another address. The message names the device, the setting and both addresses."""

    code = "address_changed"


class SeveralNodes(InvalidData):
    """Robots and grippers of a scene are on different computers. The message names all of them and the computers."""

    code = "several_nodes"


class TextTooLong(InvalidData):
    """A text is longer than its field allows. The message names the field and the limit."""

    code = "text_too_long"


class NotFound(Arcor2Error):
    """The named item does not exist."""

    code = "not_found"


class Conflict(Arcor2Error):
    """The request conflicts with the present state."""

    code = "conflict"


class PartError(Conflict):
    """An action does not agree with the part inventory."""

    code = "part"


class PlaceOccupied(PartError):
    """The place at which the action puts a part is occupied."""

    code = "place_occupied"


class PlaceEmpty(PartError):
    """The place from which the action takes a part is empty."""

    code = "place_empty"


class WrongPart(PartError):
    """The part at the place is not the expected one, or the action must not put the part at this place."""

    code = "wrong_part"


class PartUnconfirmed(PartError):
    """The place of a part is unknown. A person has to confirm it."""

    code = "part_unconfirmed"


class Interlocked(Conflict):
    """An interlock prevents an action or a motion: a condition is not met, or another robot has the zone."""

    code = "interlock"


class InvalidProject(Arcor2Error):
    """A project cannot be converted to a program."""

    code = "invalid_project"


class InvalidPackage(Arcor2Error):
    """A package is damaged or invalid."""

    code = "invalid_package"


class StorageError(Arcor2Error):
    """The storage cannot be read or written."""

    code = "storage"


class DatabaseUnreachable(StorageError):
    """The database server does not answer. Unsaved edits are stored in the journal."""

    code = "database_unreachable"


class DatabaseInUse(StorageError):
    """Another server uses the database."""

    code = "database_in_use"


class Arcor2NotImplemented(Arcor2Error):
    """This object type does not implement the optional method."""

    code = "not_implemented"


class ProgramFinished(BaseException):
    """A flow action ended the program regularly: neither an error nor a stop.

    It is not derived from Exception, so that `except Exception` in a script does not catch it.
    """


class ProgramStopped(BaseException):
    """The program was stopped. It is not derived from Exception, for the same reason as ProgramFinished."""
