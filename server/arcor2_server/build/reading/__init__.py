"""Converts an edited script that follows the conventions of generated scripts to actions and logic."""

from arcor2_server.build.reading.completion import completed_from_script
from arcor2_server.build.reading.errors import NotUnderstood
from arcor2_server.build.reading.project import from_script

__all__ = ["NotUnderstood", "completed_from_script", "from_script"]
