"""The entry point `arcor2-hw`. Commands are imported only when they are called."""

import gc
import os
import sys
from importlib.metadata import version

from cyclopts import App
from cyclopts.exceptions import CycloptsError

from arcor2_server.cli.exit_status import ExitStatus

# Imports create many permanent objects; searching them for cycles repeatedly would take 6 % of the start.
gc.set_threshold(200_000)

app = App(
    name="arcor2-hw",
    help="Set up, program and run robot cells. Start with `arcor2-hw demo`, or with `arcor2-hw serve` and a browser.",
    version=lambda: f"arcor2-hw {version('arcor2-hw')}",
    version_flags=["--version"],
    result_action="return_value",
    exit_on_error=False,
    print_error=False,
    suppress_keyboard_interrupt=False,
)
app.command(
    "arcor2_server.cli.serve:serve",
    help="Run the server until Ctrl-C or SIGTERM.\n\n"
    "Prints `ready URL` on standard output when the server accepts requests.",
)
app.command(
    "arcor2_server.cli.demo:demo",
    help="Start the demo cell and run its program.\n\n"
    "The cell tests printed circuit boards. All devices are simulated and use their real protocols: robot, two-axis "
    "robot, tester, conveyor, I/O block with tower light, barcode reader, label printer, camera, planning service. The "
    "program processes one order: it scans and tests the boards, labels the good ones, sorts all of them and reports "
    "the results. Afterwards, also after a fault, the server keeps running until Ctrl-C. `arcor2-hw fake fault` "
    "injects faults.",
)
app.command("arcor2_server.cli.scene:app", name="scene", help="List, export, import, check and compare scenes.")
app.command("arcor2_server.cli.project:app", name="project", help="List, export, import, check and compare projects.")
app.command("arcor2_server.cli.package:app", name="package", help="List and run packages, and show past runs.")
app.command(
    "arcor2_server.cli.object_type:app", name="object-type", help="Upload, list, check and compare object types."
)
app.command("arcor2_server.cli.token:app", name="token", help="Manage the access tokens of a server.")
app.command("arcor2_server.cli.metrics:app", name="metrics", help="Manage the token for the metrics of a server.")
app.command("arcor2_server.cli.person:app", name="person", help="Manage the persons who log on at shared devices.")
app.command("arcor2_server.cli.alarms:app", name="alarms", help="List, acknowledge and shelve alarms; statistics.")
app.command("arcor2_server.cli.cell:app", name="cell", help="Mode and authority of the cell, and jobs of its PLC.")
app.command(
    "arcor2_server.cli.audit:app", name="audit", help="Check and export the audit trail of changes and commands."
)
app.command(
    "arcor2_server.cli.database:app", name="database", help="Move the documents of a data directory to PostgreSQL."
)
app.command("arcor2_server.cli.device:app", name="device", help="List, find and check devices; create a driver.")
app.command("arcor2_server.cli.fleet:app", name="fleet", help="Show many cells on one page.")
app.command(
    "arcor2_server.cli.node:app",
    name="node",
    help="Run devices on another computer (node), and manage the nodes of a server.",
)
app.command(
    "arcor2_server.cli.calibrate:app", name="calibrate", help="Calibrate the poses of cameras, robots and tools."
)
app.command(
    "arcor2_server.cli.backup:backup",
    help="Copy the data of a server, which may be running, into one file.\n\n"
    "The file has the state of one moment, and contains the passwords of devices. `arcor2-hw restore` reads it.",
)
app.command(
    "arcor2_server.cli.backup:restore",
    help="Replace the data of a server, which must not be running, with a backup.\n\n"
    "The whole file is checked first. The replaced data is kept in the data directory, in `before-restore-...`.",
)
app.command(
    "arcor2_server.cli.install:install",
    help="Set up the service of this machine with this version, which is installed in /opt/arcor2-hw.\n\n"
    "`install.sh` of a release installs it there and calls this command.",
)
app.command(
    "arcor2_server.cli.install:upgrade",
    help="Replace the installed version by that of a release, without a network.\n\n"
    "The data is copied first. If the new version is not ready within a minute, the old version runs again with it.",
)
app.command(
    "arcor2_server.cli.diagnosis:diagnosis",
    help="Write a diagnosis bundle of a running server.\n\n"
    "The zip file contains the open document, object types, versions, device states and the latest log lines. Secrets "
    "are removed. The file is not sent anywhere; check its content before you pass it on.",
)
app.command("arcor2_server.cli.fake:app", name="fake", help="List and run simulated devices, and inject faults.")
app.command(
    "arcor2_server.cli.analyse:analyse",
    help="Show the settings, actions and problems of an object type.\n\n"
    "The source code is only read: neither the driver nor its imports are loaded, and no device is needed. The exit "
    "status is 10 if there are problems.",
)


def main() -> None:
    """Run the command line and exit with an ExitStatus."""
    try:
        status = app()
    except CycloptsError as error:
        sys.stderr.write(f"arcor2-hw: {' '.join(str(error).split())} Try --help.\n")
        status = ExitStatus.USAGE
    except KeyboardInterrupt:
        status = ExitStatus.INTERRUPTED
    except BrokenPipeError:
        # The process that reads the output has ended (`| head`), so the interpreter must not flush the output.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        status = ExitStatus.OK
    sys.exit(status if isinstance(status, int) else ExitStatus.OK)


if __name__ == "__main__":
    main()
