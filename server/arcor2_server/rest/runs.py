"""The history of runs over REST."""

from dataclasses import dataclass

from arcor2_hw.data.editor import Run
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import ListRunsArgs
from arcor2_server.execution.runs import Runs
from arcor2_server.rest.general import SERVER
from arcor2_server.rest.operations import operation


@dataclass(frozen=True, slots=True)
class RunOperations:
    """The history of runs over REST."""

    _runs: Runs

    @operation("GET", "/api/runs", SERVER, Role.OPERATOR, plain=True)
    async def list_runs(self, query: ListRunsArgs) -> list[Run]:
        """Return the newest runs of packages: user, package, time and result."""
        return self._runs.find(query)
