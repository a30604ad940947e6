"""The console for tables: as wide as the terminal, unfolded in a pipe."""

from typing import Final

from rich.console import Console

PIPE_WIDTH: Final = 240


def console() -> Console:
    """Return the console. A pipe has no width: without one, rich would fold columns to 80 characters."""
    found = Console(highlight=False)
    return found if found.is_terminal else Console(highlight=False, width=PIPE_WIDTH)
