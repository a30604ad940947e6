"""Where tables are printed: to a terminal as wide as it is, to a pipe without folding."""

from typing import Final

from rich.console import Console

PIPE_WIDTH: Final = 240


def console() -> Console:
    """Give the console. A pipe has no width: without one, rich would fold columns to 80 characters."""
    found = Console(highlight=False)
    return found if found.is_terminal else Console(highlight=False, width=PIPE_WIDTH)
