"""Conversion of the controller's states: control state, operating mode, collision detection."""

from typing import Final

from arcor2_hw.data.robot import Mode, Power, Safety
from arcor2_hw.messages import translatable

MOTORS_ON: Final = "motoron"
MOTORS_OFF: Final = "motoroff"
AUTOMATIC: Final = "AUTO"
COLLISION: Final = "TRIGGERED"

SAFETY: Final = {
    "init": Safety.NORMAL,
    MOTORS_OFF: Safety.NORMAL,
    MOTORS_ON: Safety.NORMAL,
    "guardstop": Safety.SAFEGUARD_STOP,
    "emergencystop": Safety.EMERGENCY_STOP,
    "emergencystopreset": Safety.EMERGENCY_STOP,
    "sysfail": Safety.FAULT,
}
"""emergencystopreset: the button is released, but the motors have not been switched on yet."""
MODES: Final = {
    "AUTO": Mode.AUTOMATIC,
    "AUTO_CH": Mode.AUTOMATIC,
    "MANR": Mode.MANUAL_REDUCED_SPEED,
    "MANF": Mode.MANUAL_HIGH_SPEED,
    "MANF_CH": Mode.MANUAL_HIGH_SPEED,
}
REMEDIES: Final = translatable(
    {
        Safety.EMERGENCY_STOP: "Release the emergency stop, press motors on at the controller, then take control.",
        Safety.SAFEGUARD_STOP: "Close the safeguard, or hold the enabling device, then take control.",
        Safety.PROTECTIVE_STOP: "Check what the robot hit, acknowledge the collision, then take control.",
        Safety.FAULT: "Restart the controller. Its event log has the cause.",
    }
)


def safety_of(control_state: str, collided: bool) -> Safety:
    """Return the safety state; an unknown control state counts as a fault."""
    found = SAFETY.get(control_state, Safety.FAULT)
    return Safety.PROTECTIVE_STOP if found is Safety.NORMAL and collided else found


def power_of(control_state: str) -> Power:
    """Return the drive power; with motors off the brakes are closed."""
    return Power.OPERATIONAL if control_state == MOTORS_ON else Power.OFF


def mode_of(operation_mode: str) -> Mode:
    """Return the operating mode."""
    return MODES.get(operation_mode, Mode.OTHER)
