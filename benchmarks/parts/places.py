"""The actions of the demo program that move boards, and the places between which they move them."""

from typing import Final

PICKS: Final = {"pick": "stop", "pick_unread": "stop", "take_out": "tester", "out_of_nest": "label"}
"""The physical place from which an action takes a board."""
PLACES: Final = {
    "insert": "tester", "into_nest": "label", "into_good_box": "good", "into_bad_box": "bad", "reject_unread": "bad",
}  # fmt: skip
NAMES: Final = {
    "stop": "feeder", "belt": "feeder", "gripper": "robot", "tester": "tester", "label": "label_place",
    "good": "good_boards", "bad": "bad_boards",
}  # fmt: skip
"""The place in the inventory for each physical place; all others are outside of the cell."""
REPORTS: Final = ("report", "report_unread")
