"""The history of runs over REST."""

from arcor2_hw.data.editor import Run
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import ListRunsArgs
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import operation
from arcor2_server.rpc.runs import newest_runs
from arcor2_server.services import Services


@operation("GET", "/api/runs", SERVER, Role.OPERATOR, plain=True)
async def list_runs(services: Services, query: ListRunsArgs) -> list[Run]:
    """Give the newest runs of packages: who started what when, and how it ended."""
    return newest_runs(services, query)
