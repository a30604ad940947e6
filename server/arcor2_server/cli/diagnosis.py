"""`arcor2-hw diagnosis`: write the diagnosis bundle of a running server to a file."""

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter

from arcor2_server.cli.exit_status import ExitStatus
from arcor2_server.cli.export_files import Force, print_line
from arcor2_server.cli.server_connection import HERE, Failed, Server, run


def diagnosis(
    output: Annotated[Path, Parameter(help="The zip file to write.")],
    /,
    *,
    force: Force = False,
    server: Server = HERE,
) -> int:
    """Write the diagnosis bundle of a running server."""

    async def work() -> None:
        if output.exists() and not force:
            raise Failed(ExitStatus.CONFLICT, f"{output} already exists; use --force to replace it")
        async with server.rest() as rest:
            await rest.diagnosis(output)
        print_line(
            f"{output}: {output.stat().st_size} bytes. It was not sent anywhere; README.txt in it lists its content."
        )

    return run("diagnosis", work)
