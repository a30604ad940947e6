"""The request that builds a package from a project."""

from dataclasses import dataclass

from arcor2_hw.data.editor import TaskKind
from arcor2_hw.data.rpc import BuildProjectArgs, BuildProjectData
from arcor2_hw.messages import Message
from arcor2_server.build.service import BuildService
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.execution.service import Execution
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class BuildRequests:
    """The request that builds a package from a project."""

    _locks: Locks
    _execution: Execution
    _build: BuildService
    _tasks: Tasks

    @rpc("BuildProject")
    async def build_project(self, context: Context, args: BuildProjectArgs) -> BuildProjectData:
        """Build a package from a saved project. PackageChanged publishes the new package."""
        async with self._locks.auto(context.user, args.project_id):
            title = Message.of("Building the package {name}", name=args.package_name)
            with self._tasks.running(TaskKind.BUILD, title, context.client.name):
                package_id = await self._build.build(args.project_id, args.package_name)
        await self._execution.added(package_id)
        return BuildProjectData(package_id)
