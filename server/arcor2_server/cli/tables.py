"""The console for tables: as wide as the terminal, without line breaks in a pipe."""

from typing import Final

from rich.console import Console

PIPE_WIDTH: Final = 240
"""Line length if the output is not a terminal. The default of rich would be 80 characters."""


def console() -> Console:
    """Return a console for standard output."""
    terminal = Console(highlight=False)
    return terminal if terminal.is_terminal else Console(highlight=False, width=PIPE_WIDTH)
