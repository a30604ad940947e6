"""The Execution service over REST: packages, the running program, breakpoints, tokens (protocol, section 16)."""

import asyncio
import enum
import os
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import IO, Any, Final

import msgspec
from msgspec import field

from arcor2_hw.data.base import UNSET, Data, Timestamp, Unset, new_id
from arcor2_hw.data.events import ChangeType
from arcor2_hw.data.held import OnError
from arcor2_hw.data.package import PackageStateEnum, PackageSummary
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import InvalidData
from arcor2_hw.messages import translatable
from arcor2_server.events import EventHub, make_event
from arcor2_server.execution.package_runs import PackageRuns
from arcor2_server.execution.runs import RunStart
from arcor2_server.execution.service import Execution
from arcor2_server.rest.build import ZIP
from arcor2_server.rest.operations import MIB, Binary, Upload, operation
from arcor2_server.storage import Storage
from arcor2_server.storage.packages import MAX_UPLOAD
from arcor2_server.storage.project_tables import ExecutionToken, ProjectTables

EXECUTION = "Execution"
MAX_NAME: Final = 100


class SummaryProject(Data, frozen=True):
    """The project of a package."""

    id: str
    name: str
    description: str


class SummaryPackage(Data, frozen=True):
    """A package and its project."""

    id: str
    name: str | Unset = UNSET
    created: Timestamp | Unset = UNSET
    executed: Timestamp | Unset = UNSET
    project: SummaryProject | Unset = UNSET


class ExecutionState(enum.StrEnum):
    """States of a program as the Execution service of ARCOR2 names them."""

    UNDEFINED = "Undefined"
    RUNNING = "Running"
    COMPLETED = "Completed"
    FAULTED = "Faulted"
    PAUSED = "Paused"
    PENDING = "Pending"


class ExecutionInfo(Data, frozen=True):
    """State of the program. action_point_ids: the action points of the running action, or of the next one if paused."""

    state: ExecutionState
    active_package_id: str | Unset = UNSET
    exception_message: str | Unset = UNSET
    action_point_ids: list[str] | Unset = UNSET


class BreakpointsQuery(Data, frozen=True):
    """Ids of action points. The parameter may be repeated."""

    breakpoints: list[str] = field(default_factory=list)


class StartQuery(Data, frozen=True, rename="camel"):
    """The reaction of the program to a failed action without an error exit, the recipe, and the order."""

    on_error: OnError = OnError.END
    recipe_id: str = ""
    order: str = ""


class DebugQuery(StartQuery, frozen=True, rename="camel"):
    """Whether the program pauses before its first action, and its reaction to a failed action."""

    break_on_first_action: bool = False


class NameQuery(Data, frozen=True):
    """A name."""

    name: str


class AccessQuery(Data, frozen=True):
    """Whether the token has access."""

    access: bool


# ------------------------------------------------------------------------------------------------ packages
def _summary(package: PackageSummary) -> SummaryPackage:
    project = package.project_meta
    return SummaryPackage(
        package.id,
        package.package_meta.name,
        package.package_meta.built,
        package.package_meta.executed,
        UNSET if isinstance(project, Unset) else SummaryProject(project.id, project.name, project.description),
    )


async def _chunks(file: IO[bytes]) -> AsyncIterator[bytes]:
    with file:
        while chunk := await asyncio.to_thread(file.read, MIB):
            yield chunk


class _Before(msgspec.Struct):
    class Data(msgspec.Struct):
        action_point_ids: list[str] | Unset = UNSET

    data: Data


_STATES: Final = {
    PackageStateEnum.UNDEFINED: ExecutionState.UNDEFINED,
    PackageStateEnum.RUNNING: ExecutionState.RUNNING,
    PackageStateEnum.PAUSED: ExecutionState.PAUSED,
    PackageStateEnum.STOPPED: ExecutionState.COMPLETED,
}


@dataclass(frozen=True, slots=True)
class ExecutionOperations:
    """The Execution service over REST."""

    _hub: EventHub
    _storage: Storage
    _execution: Execution
    _package_runs: PackageRuns

    @operation("GET", "/packages", EXECUTION, Role.OPERATOR)
    async def list_packages(self) -> list[SummaryPackage]:
        """Return all packages."""
        return [_summary(package) for package in await self._execution.list()]

    @operation(
        "POST",
        "/packages/{id}",
        EXECUTION,
        Role.PROGRAMMER,
        file="executionPackage",
        title=translatable("Uploading the package {id}"),
        limit=MAX_UPLOAD + MIB,
    )
    async def upload_package(self, id: str, upload: Upload) -> None:  # noqa: A002
        """Upload a package as a zip file. It replaces a package with the same id."""
        summary = await self._execution.take(id, upload.file)
        self._hub.broadcast(make_event("PackageChanged", summary, ChangeType.ADD))

    @operation("GET", "/packages/{id}", EXECUTION, Role.OPERATOR, media_type=ZIP)
    async def download_package(self, id: str) -> Binary:  # noqa: A002
        """Return a package as a zip file."""
        file = await asyncio.to_thread(self._execution.packages.to_zip, id)
        return Binary(_chunks(file), ZIP, f"{id}.zip", os.fstat(file.fileno()).st_size)

    @operation("DELETE", "/packages/{id}", EXECUTION, Role.ADVANCED_USER)
    async def delete_package(self, id: str) -> None:  # noqa: A002
        """Delete a package that is not running, with its breakpoints."""
        summary = await self._execution.delete(id)
        await ProjectTables(self._storage).delete_breakpoints(id)
        self._hub.broadcast(make_event("PackageChanged", summary, ChangeType.REMOVE))

    # ------------------------------------------------------------------------------------------------ the program
    @operation("PUT", "/packages/{id}/start", EXECUTION, Role.OPERATOR)
    async def start_package(self, id: str, query: StartQuery, person: str) -> None:  # noqa: A002
        """Run a package. A document left open by users who disconnected does not prevent it."""
        await self._package_runs.run_package(
            id, RunStart(by=person, on_error=query.on_error, recipe_id=query.recipe_id, order=query.order)
        )

    @operation("PUT", "/packages/{id}/breakpoints", EXECUTION, Role.OPERATOR)
    async def put_breakpoints(self, id: str, query: BreakpointsQuery) -> None:  # noqa: A002
        """Store the action points at which a package pauses when it is debugged."""
        await asyncio.to_thread(self._execution.packages.directory, id)
        await ProjectTables(self._storage).put_breakpoints(id, query.breakpoints)

    @operation("GET", "/packages/{id}/breakpoints", EXECUTION, Role.OPERATOR)
    async def get_breakpoints(self, id: str) -> list[str]:  # noqa: A002
        """Return the action points at which a package pauses when it is debugged."""
        await asyncio.to_thread(self._execution.packages.directory, id)
        return await ProjectTables(self._storage).breakpoints(id)

    @operation("PUT", "/packages/{id}/debug", EXECUTION, Role.OPERATOR)
    async def debug_package(self, id: str, query: DebugQuery, person: str) -> None:  # noqa: A002
        """Run a package with its breakpoints."""
        breakpoints = await ProjectTables(self._storage).breakpoints(id)
        how = RunStart(
            query.break_on_first_action,
            breakpoints,
            by=person,
            on_error=query.on_error,
            recipe_id=query.recipe_id,
            order=query.order,
        )
        await self._package_runs.run_package(id, how)

    @operation("PUT", "/packages/stop", EXECUTION, Role.OPERATOR, stops=True)
    async def stop_package(self, person: str) -> None:
        """Stop the program."""
        self._execution.stop(person)

    @operation("PUT", "/packages/pause", EXECUTION, Role.OPERATOR)
    async def pause_package(self) -> None:
        """Pause the program before its next action."""
        self._execution.pause()

    @operation("PUT", "/packages/resume", EXECUTION, Role.OPERATOR)
    async def resume_package(self) -> None:
        """Resume the paused program."""
        self._execution.resume()

    @operation("PUT", "/packages/step", EXECUTION, Role.OPERATOR)
    async def step_package(self) -> None:
        """Resume the paused program for one action."""
        self._execution.step()

    @operation("GET", "/packages/state", EXECUTION, Role.OPERATOR)
    async def execution_state(self) -> ExecutionInfo:
        """Return the state of the program."""
        execution = self._execution
        state = _STATES.get(execution.state, ExecutionState.PENDING)
        error: str | Unset = UNSET
        if state is ExecutionState.COMPLETED and execution.program.error is not None:
            state, error = ExecutionState.FAULTED, execution.program.error.message.text
        points: Any = UNSET
        if (before := execution.program.action) is not None:
            points = msgspec.json.decode(before, type=_Before).data.action_point_ids
        return ExecutionInfo(state, execution.program.package_id or UNSET, error, points)

    # ------------------------------------------------------------------------------------------------ tokens
    @operation("POST", "/tokens/create", EXECUTION, Role.PROGRAMMER)
    async def create_token(self, query: NameQuery) -> ExecutionToken:
        """Add an entry to the token table of the protocol. It grants no access: see `arcor2-hw token add`."""
        if not query.name or len(query.name) > MAX_NAME or not query.name.isprintable():
            raise InvalidData(
                "A token needs a name of 1 to {longest_name} printable characters.", longest_name=MAX_NAME
            )
        token = ExecutionToken(new_id("tkn"), query.name)
        await ProjectTables(self._storage).put_token(token)
        return token

    @operation("GET", "/tokens", EXECUTION, Role.PROGRAMMER)
    async def list_tokens(self) -> list[ExecutionToken]:
        """Return the token table of the protocol."""
        return await ProjectTables(self._storage).tokens()

    @operation("DELETE", "/tokens/{id}", EXECUTION, Role.PROGRAMMER)
    async def delete_token(self, id: str) -> None:  # noqa: A002
        """Delete an entry of the token table."""
        await ProjectTables(self._storage).delete_token(id)

    @operation("PUT", "/tokens/{id}/access", EXECUTION, Role.PROGRAMMER)
    async def put_access(self, id: str, query: AccessQuery) -> None:  # noqa: A002
        """Set the access flag of an entry of the token table."""
        tables = ProjectTables(self._storage)
        await tables.put_token(msgspec.structs.replace(await tables.token(id), access=query.access))

    @operation("GET", "/tokens/{id}/access", EXECUTION, Role.PROGRAMMER)
    async def get_access(self, id: str) -> bool:  # noqa: A002
        """Return the access flag of an entry of the token table."""
        return (await ProjectTables(self._storage).token(id)).access
