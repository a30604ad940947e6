"""`arcor2-hw demo`: start the demo workplace on this machine and run its program."""

import asyncio
import random
import sys
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators
from rich.console import Console

from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.demo.display import Display
from arcor2_server.demo.run import Demo
from arcor2_server.settings import default_data_dir


def demo(
    *,
    boards: Annotated[int, Parameter(validator=validators.Number(gte=1, lte=100))] = 5,
    seed: int | None = None,
    once: bool = False,
    host: str = "127.0.0.1",
    port: Annotated[int, Parameter(validator=validators.Number(gte=0, lte=65535))] = 6789,
    data_dir: Path | None = None,
    fast: bool = False,
    picture: Path | None = None,
) -> int:
    """Start the demo workplace and run its program.

    A cell for testing printed circuit boards: robot, two-axis robot, tester, belt, I/O block with tower light, reader,
    label printer and planning service are simulated at the far end of their real protocols. The program works off an
    order: boards are scanned, tested, labelled when good, sorted and reported. Afterwards the server goes on until
    Ctrl-C, also when a fault ended the program: `arcor2-hw fake` makes and mends faults.

    Parameters
    ----------
    boards
        How many boards the order is for.
    seed
        Draws which boards are bad; drawn itself, and told, when it is not given.
    once
        End when the program has run. The exit status is 0 only if every board lies in the right box, the good ones
        bear their label, and the planning service has exactly the results.
    host
        Address on which the server listens.
    port
        Port of the server; 0 takes any free one.
    data_dir
        Where scenes, projects and packages are kept.
    fast
        Let the robots, the tester and the belt hurry.
    picture
        Write what the terminal showed when the last board was done to this SVG file.
    """
    directory = data_dir if data_dir is not None else default_data_dir() / "demo"
    drawn = seed if seed is not None else random.randrange(1_000_000)
    console = Console(highlight=False)
    with Display(console, boards) as display:
        display.note(f"{boards} boards, seed {drawn}")
        job = Demo(
            host=host, port=port, data_dir=directory, boards=boards, seed=drawn, once=once, display=display, fast=fast
        )
        try:
            outcome = asyncio.run(job.run())
        except asyncio.CancelledError:
            return ExitStatus.OK if not once else ExitStatus.INTERRUPTED
        except Arcor2Error as error:
            display.close()
            sys.stderr.write(f"arcor2-hw demo: {error}\n")
            return ExitStatus.PROGRAM_FAILED
        except OSError as error:
            display.close()
            sys.stderr.write(f"arcor2-hw demo: {directory}: {error.strerror or error}\n")
            return ExitStatus.DATA_UNUSABLE
    if picture is not None:
        display.save_picture(picture)
    return ExitStatus.OK if outcome.right else ExitStatus.PROGRAM_FAILED
