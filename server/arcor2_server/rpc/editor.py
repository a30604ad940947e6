"""Requests about what clients share beside the documents: view state, breakpoints, presence, previews."""

from arcor2_hw.data.base import Unset
from arcor2_hw.data.editor import MovePreview, Presence, ProjectBreakpoints, ViewScope, ViewState
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import (
    GetBreakpointsArgs,
    GetViewStateArgs,
    SetBreakpointsArgs,
    SetViewStateArgs,
    SetViewStateData,
)
from arcor2_hw.exceptions import NotFound
from arcor2_server.documents.changes import OF_SCENE, Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.rpc.registry import Context, rpc


# ---------------------------------------------------------------------------------------------- view state
@rpc("GetViewState")
async def get_view_state(context: Context, args: GetViewStateArgs) -> ViewState:
    """Give the view state of a document."""
    user = ""
    if args.scope is ViewScope.USER:
        user = context.user if isinstance(args.user, Unset) else args.user
    elif not isinstance(args.user, Unset):
        raise RequestRefused("What is shared is nobody's: leave the user out.")
    return await context.services.views.get(args.scope, user, args.document)


@rpc("SetViewState")
async def set_view_state(context: Context, args: SetViewStateArgs) -> SetViewStateData:
    """Write values of the view state of a document; ViewStateChanged tells the others."""
    user = ""
    if args.scope is ViewScope.USER:
        user = context.user
    elif context.client.role < Role.STANDARD_USER:
        raise RequestRefused("What all see alike needs the role standard_user or a higher one.")
    views = context.services.views
    return SetViewStateData(await views.change(args.scope, user, args.document, args.values, context.client))


# ---------------------------------------------------------------------------------------------- shared breakpoints
def _project(context: Context, project_id: str | Unset) -> str:
    if not isinstance(project_id, Unset):
        return project_id
    return context.services.session.require_project_open().of_kind(Kind.PROJECT)[0].id


@rpc("GetBreakpoints")
async def get_breakpoints(context: Context, args: GetBreakpointsArgs) -> ProjectBreakpoints:
    """Give the shared breakpoints of a project."""
    return await context.services.breakpoints.get(_project(context, args.project_id))


@rpc("SetBreakpoints")
async def set_breakpoints(context: Context, args: SetBreakpointsArgs) -> ProjectBreakpoints:
    """Set and take away shared breakpoints of a project; BreakpointsChanged tells everybody."""
    if both := args.add & args.remove:
        raise RequestRefused(f"{min(both)} is to be set and taken away at once.")
    project = _project(context, args.project_id)
    return await context.services.breakpoints.change(project, args.add, args.remove, context.user)


# ---------------------------------------------------------------------------------------------- presence, previews
@rpc("UpdatePresence")
async def update_presence(context: Context, args: Presence) -> None:
    """Say what the user looks at and edits."""
    assert context.user
    context.services.presence.say(context.client, args)


@rpc("PreviewMove")
async def preview_move(context: Context, args: MovePreview) -> None:
    """Show the others where an item is that the caller drags just now."""
    services, user = context.services, context.user
    document = services.session.require_scene_open()
    for kind in (Kind.OBJECT, Kind.POINT, Kind.ORIENTATION, Kind.JOINTS):
        if (item := document.find(kind, args.id)) is not None:
            break
    else:
        raise NotFound(f"There is no object, action point, orientation or joints {args.id!r}.")
    if item.kind in OF_SCENE and context.client.role < Role.TECHNICIAN:
        raise RequestRefused("Moving an object needs the role technician or a higher one.")
    if item.kind is Kind.JOINTS and not (isinstance(args.position, Unset) and isinstance(args.orientation, Unset)):
        raise RequestRefused("Joints have neither a position nor an orientation.")
    if item.kind is not Kind.JOINTS and not isinstance(args.joints, Unset):
        raise RequestRefused(f"{args.id!r} has no joints.")
    locked = args.id if services.locks.holds(user, args.id) else item.parent or args.id
    services.locks.require_held(user, locked)
    services.previews.show(context.client, user, args, locked)
