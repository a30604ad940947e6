"""Script to project: a generated script, edited by hand within its conventions, goes back to actions and logic."""

from arcor2_server.build.reading.errors import NotUnderstood
from arcor2_server.build.reading.project import from_script

__all__ = ["NotUnderstood", "from_script"]
