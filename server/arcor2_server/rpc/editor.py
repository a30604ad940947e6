"""Requests about state that clients share besides documents: view states, breakpoints, presence, previews."""

from dataclasses import dataclass

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
from arcor2_server.collaboration.locks import Locks
from arcor2_server.collaboration.presence import PresenceBoard
from arcor2_server.collaboration.previews import Previews
from arcor2_server.collaboration.view_states import ViewStates
from arcor2_server.documents import Session
from arcor2_server.documents.changes import OF_SCENE, Kind
from arcor2_server.errors import RequestRefused
from arcor2_server.execution.breakpoints import SharedBreakpoints
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class SharedStateRequests:
    """Requests about state that clients share besides documents: view states, breakpoints, presence, previews."""

    _locks: Locks
    _session: Session
    _previews: Previews
    _view_states: ViewStates
    _breakpoints: SharedBreakpoints
    _presence: PresenceBoard

    # ---------------------------------------------------------------------------------------------- view state
    @rpc("GetViewState")
    async def get_view_state(self, context: Context, args: GetViewStateArgs) -> ViewState:
        """Return the view state of a document."""
        user = ""
        if args.scope is ViewScope.USER:
            user = context.user if isinstance(args.user, Unset) else args.user
        elif not isinstance(args.user, Unset):
            raise RequestRefused("A shared view state has no user. Omit the user.")
        return await self._view_states.get(args.scope, user, args.document)

    @rpc("SetViewState")
    async def set_view_state(self, context: Context, args: SetViewStateArgs) -> SetViewStateData:
        """Write values of the view state of a document. ViewStateChanged publishes them to other clients."""
        user = ""
        if args.scope is ViewScope.USER:
            user = context.user
        elif context.client.role < Role.STANDARD_USER:
            raise RequestRefused("Changing a shared view state needs the role standard_user or a higher one.")
        views = self._view_states
        return SetViewStateData(await views.change(args.scope, user, args.document, args.values, context.client))

    # ---------------------------------------------------------------------------------------------- shared breakpoints
    def _project_id(self, project_id: str | Unset) -> str:
        """Return the given id, else the id of the open project."""
        if not isinstance(project_id, Unset):
            return project_id
        return self._session.require_project_open().of_kind(Kind.PROJECT)[0].id

    @rpc("GetBreakpoints")
    async def get_breakpoints(self, context: Context, args: GetBreakpointsArgs) -> ProjectBreakpoints:
        """Return the shared breakpoints of a project."""
        return await self._breakpoints.get(self._project_id(args.project_id))

    @rpc("SetBreakpoints")
    async def set_breakpoints(self, context: Context, args: SetBreakpointsArgs) -> ProjectBreakpoints:
        """Set and remove shared breakpoints of a project. BreakpointsChanged publishes them."""
        if both := args.add & args.remove:
            raise RequestRefused("The breakpoint {both} cannot be set and removed by one request.", both=min(both))
        project_id = self._project_id(args.project_id)
        return await self._breakpoints.change(project_id, args.add, args.remove, context.user)

    # ---------------------------------------------------------------------------------------------- presence, previews
    @rpc("UpdatePresence")
    async def update_presence(self, context: Context, args: Presence) -> None:
        """Publish what the user is viewing and editing."""
        assert context.user
        self._presence.update(context.client, args)

    @rpc("PreviewMove")
    async def preview_move(self, context: Context, args: MovePreview) -> None:
        """Show other clients the position of an item that the caller is dragging."""
        user = context.user
        document = self._session.require_scene_open()
        for kind in (Kind.OBJECT, Kind.POINT, Kind.ORIENTATION, Kind.JOINTS):
            if (item := document.find(kind, args.id)) is not None:
                break
        else:
            raise NotFound("No object, action point, orientation or joints have the id {id!r}.", id=args.id)
        if item.kind in OF_SCENE and context.client.role < Role.TECHNICIAN:
            raise RequestRefused("Moving an object needs the role technician or a higher one.")
        if item.kind is Kind.JOINTS and not (isinstance(args.position, Unset) and isinstance(args.orientation, Unset)):
            raise RequestRefused("Joints have neither a position nor an orientation.")
        if item.kind is not Kind.JOINTS and not isinstance(args.joints, Unset):
            raise RequestRefused("{name} has no joints.", name=item.value.name)
        locked = args.id if self._locks.holds(user, args.id) else item.parent or args.id
        self._locks.require_held(user, locked)
        self._previews.show(context.client, user, args, locked)
