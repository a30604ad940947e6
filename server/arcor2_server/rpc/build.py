"""The request that turns a project into a package."""

from arcor2_hw.data.editor import TaskKind
from arcor2_hw.data.rpc import BuildProjectArgs, BuildProjectData
from arcor2_server.rpc.registry import Context, rpc


@rpc("BuildProject")
async def build_project(context: Context, args: BuildProjectArgs) -> BuildProjectData:
    """Build a saved project; PackageChanged tells everybody of the new package."""
    services = context.services
    async with services.locks.auto(context.user, args.project_id):
        title = f"Building the package {args.package_name}"
        with services.tasks.running(TaskKind.BUILD, title, context.client.name):
            package_id = await services.build.build(args.project_id, args.package_name)
    await services.execution.added(package_id)
    return BuildProjectData(package_id)
