"""The request that turns a project into a package."""

from arcor2_hw.data.editor import TaskKind
from arcor2_hw.data.rpc import BuildProjectArgs, BuildProjectData
from arcor2_server.build.service import BuildService
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.tasks import Tasks
from arcor2_server.execution.service import Execution
from arcor2_server.rpc.registry import Context, rpc


class BuildRequests:
    """The request that turns a project into a package."""

    def __init__(self, locks: Locks, execution: Execution, build: BuildService, tasks: Tasks) -> None:
        self._locks = locks
        self._execution = execution
        self._build = build
        self._tasks = tasks

    @rpc("BuildProject")
    async def build_project(self, context: Context, args: BuildProjectArgs) -> BuildProjectData:
        """Build a saved project; PackageChanged announces the new package."""
        async with self._locks.auto(context.user, args.project_id):
            title = f"Building the package {args.package_name}"
            with self._tasks.running(TaskKind.BUILD, title, context.client.name):
                package_id = await self._build.build(args.project_id, args.package_name)
        await self._execution.added(package_id)
        return BuildProjectData(package_id)
