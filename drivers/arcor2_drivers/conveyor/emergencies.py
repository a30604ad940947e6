"""Meaning and remedy of the error codes of EMCY and 603Fh (CiA 301, CiA 402)."""

from typing import Final, NamedTuple

from arcor2_hw.data.device import Severity
from arcor2_hw.messages import translatable


class Fault(NamedTuple):
    """Meaning and remedy of an error code."""

    text: str
    remedy: str
    severity: Severity = Severity.ERROR


_RESET: Final = "then reset the fault"
_CABLE: Final = f"have the motor and its cable checked, {_RESET}"
_FREE: Final = f"check that the belt runs freely, {_RESET}"
_SUPPLY: Final = f"check the supply, {_RESET}"
_BRAKING: Final = f"check the braking resistor and the supply, {_RESET}"
_COOL: Final = f"let it cool, check its ventilation, {_RESET}"
_BUS: Final = f"check cable, termination and load of the bus, {_RESET}"
_SERVICE: Final = f"switch the drive off and on; if the fault returns, have it serviced, {_RESET}"
_PARAMETERS: Final = f"check the drive's parameters with the tool of the manufacturer, {_RESET}"
_SENSOR: Final = f"check the encoder and its cable, {_RESET} and home"

_FAULTS: Final = {
    0x2120: Fault("earth leakage at the mains side", _CABLE, Severity.CRITICAL),
    0x2130: Fault("short circuit at the mains side", _CABLE, Severity.CRITICAL),
    0x2220: Fault("continuous overcurrent inside the drive", _SERVICE),
    0x2230: Fault("short circuit or earth leakage inside the drive", _SERVICE, Severity.CRITICAL),
    0x2310: Fault("continuous overcurrent", _FREE),
    0x2320: Fault("short circuit or earth leakage", _CABLE, Severity.CRITICAL),
    0x2330: Fault("earth leakage at the motor side", _CABLE, Severity.CRITICAL),
    0x2340: Fault("short circuit at the motor side", _CABLE, Severity.CRITICAL),
    0x2350: Fault("overload of the motor (I²t)", f"let it cool, {_FREE}"),
    0x3110: Fault("mains overvoltage", _SUPPLY),
    0x3120: Fault("mains undervoltage", _SUPPLY),
    0x3130: Fault("a phase of the mains is missing", _SUPPLY),
    0x3210: Fault("overvoltage of the DC link", _BRAKING),
    0x3220: Fault("undervoltage of the DC link", _SUPPLY),
    0x4110: Fault("the surroundings are too hot", _COOL),
    0x4210: Fault("the drive is too hot", _COOL),
    0x4310: Fault("the motor is too hot", f"let it cool, {_RESET}"),
    0x5113: Fault("the 24 V supply is too low", _SUPPLY),
    0x5400: Fault("the power section fails", _SERVICE, Severity.CRITICAL),
    0x5441: Fault("contactor or emergency stop input", f"release the emergency stop, {_RESET}", Severity.CRITICAL),
    0x5530: Fault("the parameter memory fails", _SERVICE),
    0x6010: Fault("the drive's watchdog has reset it", _SERVICE),
    0x6310: Fault("parameters were lost", _PARAMETERS),
    0x6320: Fault("a parameter is wrong", _PARAMETERS),
    0x7110: Fault("the brake chopper fails", _BRAKING),
    0x7120: Fault("the motor fails", _CABLE),
    0x7121: Fault("the motor is blocked", f"free the belt, {_RESET}"),
    0x7122: Fault("the motor is commutated wrongly", _SENSOR),
    0x7300: Fault("a sensor fails", _SENSOR),
    0x7303: Fault("resolver 1 fails", _SENSOR),
    0x7305: Fault("encoder 1 fails", _SENSOR),
    0x7500: Fault("communication inside the drive fails", _SERVICE),
    0x8110: Fault("CAN overrun", _BUS),
    0x8120: Fault("CAN is error passive", _BUS),
    0x8130: Fault("our heartbeat did not come", "check the CAN bus and this computer, then take control again"),
    0x8140: Fault("CAN was off the bus and has recovered", _BUS),
    0x8150: Fault("two nodes send the same CAN identifier", f"give each node its own number, {_RESET}"),
    0x8210: Fault("a PDO is too short", _PARAMETERS),
    0x8220: Fault("a PDO is too long", _PARAMETERS),
    0x8250: Fault("a PDO did not come in time", _BUS),
    0x8311: Fault("excess torque", _FREE),
    0x8400: Fault("the velocity controller fails", _FREE),
    0x8500: Fault("the position controller fails", _FREE),
    0x8611: Fault("following error", _FREE),
    0x8612: Fault("reference limit", f"move off the limit, {_RESET}"),
}
_CLASSES: Final = translatable(
    {
        0x1: "generic error",
        0x2: "current",
        0x3: "voltage",
        0x4: "temperature",
        0x5: "device hardware",
        0x6: "device software",
        0x7: "additional modules",
        0x8: "monitoring",
        0x9: "external error",
        0xF: "specific to the device",
    }
)


def fault_of(code: int) -> Fault:
    """Return the meaning of an error code; that of its class for an unknown code."""
    return _FAULTS.get(code) or Fault(
        _CLASSES.get(code >> 12, "unknown error"), f"look the code up in the drive's manual, {_RESET}"
    )
