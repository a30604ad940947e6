"""Which lamps show which state: the list in the settings, taken apart and checked. Pure functions."""

from collections.abc import Collection, Mapping
from typing import Final

from arcor2_hw.exceptions import OutOfRange
from arcor2_hw.objects import MachineState

USUAL: Final = (
    "execute=green; starting=green blinking; completing=green; complete=green blinking; "
    "idle=white; resetting=white blinking; held=amber; holding=amber blinking; unholding=amber blinking; "
    "suspended=amber; suspending=amber blinking; unsuspending=amber blinking; stopped=amber; "
    "stopping=amber blinking; aborting=red blinking; aborted=red blinking; clearing=red"
)
"""What is shown when the settings say nothing, as far as the tower has the colour (red: emergency, amber: attention,
green: normal, white: neutral; IEC 60204-1, 10.3)."""

STATES: Final = tuple(state.name.lower() for state in MachineState)

Pattern = Mapping[str, bool]
"""The colours that are lit, each with whether it blinks."""


def parse_patterns(text: str, fitted: Collection[str], parameter: str = "patterns") -> dict[str, Pattern]:
    """Give the lamps by state: "execute=green; aborted=red+amber blinking; idle=off". Raises OutOfRange naming it."""
    strict = bool(text.strip())
    patterns: dict[str, Pattern] = {}
    for entry in filter(None, (part.strip() for part in (text if strict else USUAL).split(";"))):
        head, *words = entry.split()
        state, sign, lamps = head.partition("=")
        if not sign or not lamps or words not in ([], ["blinking"]):
            raise OutOfRange(f"{parameter} must be a list of state=colour or state=colour blinking, not {entry!r}")
        if state not in STATES:
            raise OutOfRange(f"{parameter} must name a state of {', '.join(STATES)}, not {state!r}")
        if state in patterns:
            raise OutOfRange(f"{parameter} must name each state once: {state!r} is there twice")
        colors = [] if lamps == "off" else lamps.split("+")
        unknown = [color for color in colors if color not in fitted]
        if unknown and strict:
            raise OutOfRange(f"{parameter} must show {state} by {', '.join(fitted)} or off, not {unknown[0]!r}")
        if not unknown:
            patterns[state] = dict.fromkeys(colors, bool(words))
    return patterns
