"""Texts of the editor that several tests search for. When the editor changes one of them, change it here."""

from typing import Final

# ------------------------------------------------------------------------------------------------ join and home
YOUR_NAME: Final = "Your name"
JOIN: Final = "Join"
PROJECTS: Final = "Projects"
SCENES: Final = "Scenes"
PACKAGES: Final = "Packages"
NEW_SCENE: Final = "New scene"
NEW_PROJECT: Final = "New project"
CREATE: Final = "Make and open"
CLOSE_DOCUMENT: Final = "Close, and go to the lists"
DISCARD_CHANGES: Final = "Throw the changes away"
HOME_HEADING: Final = "Workplace"

# ------------------------------------------------------------------------------------------------ tools of the rail
OBJECTS: Final = "Things"
POINTS: Final = "Points"
PROGRAM: Final = "Program"
RUN: Final = "Run"
ROBOT: Final = "Robot"
DEVICES: Final = "Devices"
ADD: Final = "Add"
TOOLS: Final = (OBJECTS, ROBOT, POINTS, PROGRAM, RUN, DEVICES)

# ------------------------------------------------------------------------------------------------ top bar and dock
GO_ONLINE: Final = "Go online"
GO_OFFLINE: Final = "Online. Press to go offline"
STOP_MOTION: Final = "Stop motion"
SETTINGS: Final = "Settings"
SAVE: Final = "Save"
NOT_SAVED: Final = "not saved"
STOP: Final = "Stop"
STEP: Final = "Step"
RESUME: Final = "Resume"
START_PAUSED: Final = "Start paused"
PROGRAM_STATE: Final = "The program"
TRAY: Final = "Tasks and messages"
NO_CONNECTION: Final = "No connection to the server."

# ------------------------------------------------------------------------------------------------ panel
CLOSE_PANEL: Final = "Close the panel"
LARGER_PANEL: Final = "Make the panel larger"
SMALLER_PANEL: Final = "Make the panel smaller"
PLACE: Final = "Place"
REMOVE: Final = "Remove"
DUPLICATE: Final = "Duplicate"
CANCEL: Final = "Cancel"
SAVE_SETTINGS: Final = "Save the settings"
SECRET_IS_STORED: Final = "Stored. Type to replace it."
DISMISS: Final = "Dismiss"

# ------------------------------------------------------------------------------------------------ view and program
AT_CROSSHAIR: Final = "At the cross"
GRAPH: Final = "The program as a graph"
TAP_NEXT_STEP: Final = "Tap what follows"
NEXT_STEP: Final = "What follows"
PARAMETERS: Final = "What it is told"
VARIABLES: Final = "Values"
NO_PROBLEMS: Final = "Nothing is wrong: it can be run."
HIDE: Final = "Hide it, and aim through it"

# ------------------------------------------------------------------------------------------------ robot and calibration
HOW_TO_MOVE: Final = "How to move it"
PRESS_MODE: Final = "A press"
HOLD_TO_MOVE: Final = "Hold to move"
CAN_GO_THERE: Final = "It can go there: the ghost shows how."
MOVE_POINT_TO_ROBOT: Final = "Put it where the robot is"
PUT_IT_THERE: Final = "Put it there"
FIND_BY_MARKERS: Final = "Find where it stands by markers"
SHOW_ON_TOOL: Final = "Show it on the tool first"


def open_document(name: str) -> str:
    return f"Open {name}"


def undo(edit: str) -> str:
    return f"Undo {edit}"
