"""`arcor2-hw demo`: start the demo cell on this machine and run its program."""

import asyncio
import importlib.util
import random
from pathlib import Path
from typing import Annotated

from cyclopts import Parameter, validators
from rich.console import Console

from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.cli.exit_status import ExitStatus, fail
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
    opcua: Annotated[bool, Parameter(negative="")] = False,
    opcua_port: Annotated[int, Parameter(validator=validators.Number(gte=1, lte=65535))] = 4840,
    picture: Path | None = None,
) -> int:
    """Start the demo cell and run its program.

    Parameters
    ----------
    boards
        Number of boards in the order.
    seed
        Seed that selects the bad boards. The default is a random seed, which is printed.
    once
        Exit when the program has ended. The exit status is 0 only if all boards are in the right box, the good ones
        have their label, and the planning service has received exactly the results.
    host
        Address on which the server listens.
    port
        Port of the server; 0 selects a free port.
    data_dir
        Data directory for scenes, projects and packages.
    fast
        Run the robots, the tester and the conveyor faster.
    opcua
        Serve the cell over OPC UA too. On 127.0.0.1 any client may read, without user or encryption.
    opcua_port
        Port of the OPC UA server.
    picture
        Write the terminal output at the last board to this SVG file.
    """
    if opcua and importlib.util.find_spec("asyncua") is None:
        return fail("demo", "--opcua needs the library asyncua: pip install 'arcor2-hw[opcua]'", ExitStatus.USAGE)
    directory = data_dir if data_dir is not None else default_data_dir() / "demo"
    seed = seed if seed is not None else random.randrange(1_000_000)
    console = Console(highlight=False)
    with Display(console, boards) as display:
        display.note(f"{boards} boards, seed {seed}")
        job = Demo(
            host=host,
            port=port,
            data_dir=directory,
            boards=boards,
            seed=seed,
            once=once,
            display=display,
            fast=fast,
            opcua_port=opcua_port if opcua else None,
        )
        try:
            outcome = asyncio.run(job.run())
        except asyncio.CancelledError:
            return ExitStatus.OK if not once else ExitStatus.INTERRUPTED
        except Arcor2Error as error:
            display.close()
            return fail("demo", error, ExitStatus.PROGRAM_FAILED)
        except OSError as error:
            display.close()
            return fail("demo", f"{directory}: {error.strerror or error}", ExitStatus.DATA_UNUSABLE)
    if picture is not None:
        display.save_picture(picture)
    return ExitStatus.OK if outcome.successful else ExitStatus.PROGRAM_FAILED
