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
CREATE: Final = "Create"
CLOSE_DOCUMENT: Final = "Close"
DISCARD_CHANGES: Final = "Discard changes"
HOME_HEADING: Final = "Workplace"
AGO: Final = r"(just now|\d+ (second|minute)s? ago)"
"""Pattern of a recent time; on a busy machine some seconds pass until it is shown."""

# ------------------------------------------------------------------------------------------------ tools of the rail
OBJECTS: Final = "Objects"
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
MESSAGE_BAR: Final = "Tasks and messages"
NO_CONNECTION: Final = "No connection to the server."

# ------------------------------------------------------------------------------------------------ panel
CLOSE_PANEL: Final = "Close the panel"
LARGER_PANEL: Final = "Enlarge the panel"
SMALLER_PANEL: Final = "Shrink the panel"
PLACE: Final = "Place"
REMOVE: Final = "Remove"
DUPLICATE: Final = "Duplicate"
CANCEL: Final = "Cancel"
SAVE_SETTINGS: Final = "Save settings"
SECRET_IS_STORED: Final = "Stored. Type to replace it."
DISMISS: Final = "Dismiss"

# ------------------------------------------------------------------------------------------------ view and program
AT_CROSSHAIR: Final = "At the crosshair"
GRAPH: Final = "Program graph"
SELECT_SEVERAL: Final = "Select several actions"
TAP_NEXT_STEP: Final = "Tap the step that follows"
NEXT_STEP: Final = "Next step"
PARAMETERS: Final = "Parameters"
VARIABLES: Final = "Variables"
NO_PROBLEMS: Final = "No problems. Ready to run."
HIDE: Final = "Hide"

# ------------------------------------------------------------------------------------------------ robot and calibration
ROBOT_CONTROL: Final = "Control"
PRESS_MODE: Final = "Mode"
HOLD_TO_MOVE: Final = "Hold to move"
REACHABLE: Final = "Reachable. The ghost shows the pose."
MOVE_POINT_TO_ROBOT: Final = "Move to the robot"
UPDATE_POSE: Final = "Update the pose"
FIND_BY_MARKERS: Final = "Calibrate with markers"
SHOW_ON_TOOL: Final = "Preview on the tool"


def open_document(name: str) -> str:
    return f"Open {name}"


def undo(edit: str) -> str:
    return f"Undo {edit}"


WHOLE_PROGRAM: Final = "Show the whole program"
