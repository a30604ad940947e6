"""What the controller's words mean: control state, operating mode, collision detection."""

from typing import Final

from arcor2_hw.data.robot import Mode, Power, Safety

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
"""emergencystopreset: the button is released, motors on has not been confirmed yet."""
MODES: Final = {
    "AUTO": Mode.AUTOMATIC,
    "AUTO_CH": Mode.AUTOMATIC,
    "MANR": Mode.MANUAL_REDUCED_SPEED,
    "MANF": Mode.MANUAL_HIGH_SPEED,
    "MANF_CH": Mode.MANUAL_HIGH_SPEED,
}
REMEDIES: Final = {
    Safety.EMERGENCY_STOP: "Release the emergency stop, press motors on at the controller, then take control.",
    Safety.SAFEGUARD_STOP: "Close the safeguard, or hold the enabling device, then take control.",
    Safety.PROTECTIVE_STOP: "Look what was hit, acknowledge by name, then take control.",
    Safety.FAULT: "Restart the controller; its event log says why.",
}


def safety_of(control_state: str, collided: bool) -> Safety:
    """Give what the safety system says; an unknown word counts as a fault."""
    found = SAFETY.get(control_state, Safety.FAULT)
    return Safety.PROTECTIVE_STOP if found is Safety.NORMAL and collided else found


def power_of(control_state: str) -> Power:
    """Give the drive power: with motors off the brakes are closed and the drives without power."""
    return Power.OPERATIONAL if control_state == MOTORS_ON else Power.OFF


def mode_of(word: str) -> Mode:
    """Give the operating mode."""
    return MODES.get(word, Mode.OTHER)
