"""One tree of errors: each has a stable code, a sentence for the operator and a detail for the technician."""

from typing import ClassVar


class Arcor2Error(Exception):
    """Base of all errors. `str(error)` is the sentence for the operator.

    code: stable text that programs may test. detail: for the technician (address, register, answer received).
    """

    code: ClassVar[str] = "error"

    def __init__(self, message: str = "", detail: str = "") -> None:
        super().__init__(message or (type(self).__doc__ or "").strip().splitlines()[0])
        self.detail = detail


# ------------------------------------------------------------------------------------------------ devices
class DeviceError(Arcor2Error):
    """Something is wrong with a device or the way to it."""

    code = "device"


class NotConnected(DeviceError):
    """The device is not connected: nothing was sent."""

    code = "not_connected"


class ConnectionLost(DeviceError):
    """The connection broke; what had been sent may or may not have been done."""

    code = "connection_lost"


class DeviceTimeout(DeviceError):
    """The device did not answer, or did not finish, within the deadline."""

    code = "device_timeout"


class Refused(DeviceError):
    """The device, or its driver, refuses the command in the present state."""

    code = "refused"


class NotInControl(Refused):
    """Somebody else has control of the device."""

    code = "not_in_control"


class OutOfRange(DeviceError):
    """A value lies outside what the device allows: nothing was sent."""

    code = "out_of_range"


class Stale(DeviceError):
    """The newest value is older than was asked for."""

    code = "stale"


class NoDepth(DeviceError):
    """The camera gives no depth, or too little of the picture has one."""

    code = "no_depth"


class Overexposed(DeviceError):
    """Too much of the picture is white: there is more light than the exposure takes."""

    code = "overexposed"


class DeviceFault(DeviceError):
    """The device reports a fault of its own."""

    code = "device_fault"

    def __init__(self, message: str = "", detail: str = "", fault_code: int | str = "") -> None:
        super().__init__(message, detail)
        self.fault_code = fault_code


class SafetyStop(DeviceError):
    """The safety system stopped the device; a person has to deal with it."""

    code = "safety_stop"

    def __init__(self, message: str = "", detail: str = "", kind: str = "") -> None:
        super().__init__(message, detail)
        self.kind = kind


class Cancelled(DeviceError):
    """The command was stopped before it was done."""

    code = "cancelled"


class PathBlocked(DeviceError):
    """An obstacle came into the path of a robot during a safe move; the robot was stopped."""

    code = "path_blocked"


class KinematicsError(DeviceError):
    """There are no joints for the pose, or the numbers make no sense for the robot."""

    code = "kinematics"


# ------------------------------------------------------------------------------------------------ programs and data
class InvalidData(Arcor2Error):
    """What was given has a wrong form."""

    code = "invalid_data"


class AddressChanged(InvalidData):
    """A stored secret was entered for another address; the message names the device, the setting and both addresses."""

    code = "address_changed"


class TextTooLong(InvalidData):
    """A text is longer than its field allows; the message names the field and the limit."""

    code = "text_too_long"


class NotFound(Arcor2Error):
    """What was named does not exist."""

    code = "not_found"


class Conflict(Arcor2Error):
    """What was given stands against what is there."""

    code = "conflict"


class InvalidProject(Arcor2Error):
    """A project cannot be turned into a program."""

    code = "invalid_project"


class InvalidPackage(Arcor2Error):
    """A package is damaged, or is none."""

    code = "invalid_package"


class StorageError(Arcor2Error):
    """The storage cannot be read or written."""

    code = "storage"


class Arcor2NotImplemented(Arcor2Error):
    """This object type does not have the optional method."""

    code = "not_implemented"


class ProgramFinished(BaseException):
    """A flow action ended the program as meant: neither an error nor a stop.

    Not under Exception, so that a script's own `except Exception` does not swallow it.
    """


class ProgramStopped(BaseException):
    """Somebody stopped the program. Not under Exception, for the same reason."""
