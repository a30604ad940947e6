"""`arcor2-hw diagnosis`: write the diagnosis bundle of a running server into one file."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.export_files import Force, say
from arcor2_server.cli.server_connection import HERE, Failed, Server, run


def diagnosis(
    output: Annotated[Path, Parameter(help="The zip that is written.")],
    /,
    *,
    force: Force = False,
    server: Server = HERE,
) -> int:
    """Write a zip of what is open, types and versions, states of devices and the log's last lines of a running server.

    Secrets are left out. It is sent to nobody: look through it before you give it away.
    """

    async def work() -> None:
        if output.exists() and not force:
            raise Failed(ExitStatus.CONFLICT, f"{output} exists: --force replaces it")
        async with server.rest() as rest:
            await rest.diagnosis(output)
        say(f"{output}: {output.stat().st_size} bytes. It was sent to nobody; README.txt in it says what it has.")

    return run("diagnosis", work)
