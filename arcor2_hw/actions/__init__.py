"""Actions: what marks a method as one, and the kinds of parameter it may take."""

from arcor2_hw.actions.marking import DEFAULT_DEADLINE, IntEnum, StrEnum, action, deadline_of, metadata_of

__all__ = ["DEFAULT_DEADLINE", "IntEnum", "StrEnum", "action", "deadline_of", "metadata_of"]
