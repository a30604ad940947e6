"""The entry point `arcor2-hw`. Subcommands are imported only when they are called."""

import gc
import os
import sys
from importlib.metadata import version

from cyclopts import App
from cyclopts.exceptions import CycloptsError

from arcor2_server.cli.exit_status import ExitStatus

# A command's imports make many objects that stay; searching them for cycles again and again takes 6 % of a start.
gc.set_threshold(200_000)

app = App(
    name="arcor2-hw",
    help="Set up, program and run robotic workplaces. Try `arcor2-hw demo`, or `arcor2-hw serve` and open a client.",
    version=lambda: f"arcor2-hw {version('arcor2-hw')}",
    version_flags=["--version"],
    result_action="return_value",
    exit_on_error=False,
    print_error=False,
    suppress_keyboard_interrupt=False,
)
app.command("arcor2_server.cli.serve:serve", help="Run the server until it is told to end.")
app.command("arcor2_server.cli.demo:demo", help="Bring up the demo workplace and run its program.")
app.command("arcor2_server.cli.scene:app", name="scene", help="List, export, import, check and compare scenes.")
app.command("arcor2_server.cli.project:app", name="project", help="List, export, import, check and compare projects.")
app.command("arcor2_server.cli.package:app", name="package", help="List the packages of a server, or run one.")
app.command(
    "arcor2_server.cli.object_type:app",
    name="object-type",
    help="Bring object types into a server, compare them.",
)
app.command("arcor2_server.cli.token:app", name="token", help="Say who may connect to a server, and in which role.")
app.command("arcor2_server.cli.device:app", name="device", help="List, find, check devices; write a driver.")
app.command(
    "arcor2_server.cli.calibrate:app", name="calibrate", help="Find out where cameras, robots and tools really are."
)
app.command("arcor2_server.cli.diagnosis:diagnosis", help="Write what somebody who helps has to know into one file.")
app.command("arcor2_server.cli.fake:app", name="fake", help="List and run simulated devices, and let them fail.")
app.command("arcor2_server.cli.analyse:analyse", help="Show what an object type offers, and what is wrong with it.")


def main() -> None:
    """Run the command line; the process ends with an ExitStatus."""
    try:
        status = app()
    except CycloptsError as error:
        # One line: which option, and what is wrong with it.
        sys.stderr.write(f"arcor2-hw: {' '.join(str(error).split())} Try --help.\n")
        status = ExitStatus.USAGE
    except KeyboardInterrupt:
        status = ExitStatus.INTERRUPTED
    except BrokenPipeError:
        # The reader of our output is gone (`| head`); the interpreter must not try to flush it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = ExitStatus.OK
    sys.exit(status if isinstance(status, int) else ExitStatus.OK)


if __name__ == "__main__":
    main()
