"""Requests about what clients share: view state, breakpoints, presence, previews."""

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


class SharedStateRequests:
    """Requests about what clients share beside the documents."""

    def __init__(
        self,
        locks: Locks,
        session: Session,
        previews: Previews,
        view_states: ViewStates,
        breakpoints: SharedBreakpoints,
        presence: PresenceBoard,
    ) -> None:
        self._locks = locks
        self._session = session
        self._previews = previews
        self._view_states = view_states
        self._breakpoints = breakpoints
        self._presence = presence

    # ---------------------------------------------------------------------------------------------- view state
    @rpc("GetViewState")
    async def get_view_state(self, context: Context, args: GetViewStateArgs) -> ViewState:
        """Return the view state of a document."""
        user = ""
        if args.scope is ViewScope.USER:
            user = context.user if isinstance(args.user, Unset) else args.user
        elif not isinstance(args.user, Unset):
            raise RequestRefused("What is shared is nobody's: leave the user out.")
        return await self._view_states.get(args.scope, user, args.document)

    @rpc("SetViewState")
    async def set_view_state(self, context: Context, args: SetViewStateArgs) -> SetViewStateData:
        """Write values of the view state of a document; ViewStateChanged tells the others."""
        user = ""
        if args.scope is ViewScope.USER:
            user = context.user
        elif context.client.role < Role.STANDARD_USER:
            raise RequestRefused("What all see alike needs the role standard_user or a higher one.")
        views = self._view_states
        return SetViewStateData(await views.change(args.scope, user, args.document, args.values, context.client))

    # ---------------------------------------------------------------------------------------------- shared breakpoints
    def _project(self, context: Context, project_id: str | Unset) -> str:
        if not isinstance(project_id, Unset):
            return project_id
        return self._session.require_project_open().of_kind(Kind.PROJECT)[0].id

    @rpc("GetBreakpoints")
    async def get_breakpoints(self, context: Context, args: GetBreakpointsArgs) -> ProjectBreakpoints:
        """Return the shared breakpoints of a project."""
        return await self._breakpoints.get(self._project(context, args.project_id))

    @rpc("SetBreakpoints")
    async def set_breakpoints(self, context: Context, args: SetBreakpointsArgs) -> ProjectBreakpoints:
        """Set and remove shared breakpoints of a project; BreakpointsChanged announces them."""
        if both := args.add & args.remove:
            raise RequestRefused("{both} is to be set and taken away at once.", both=min(both))
        project = self._project(context, args.project_id)
        return await self._breakpoints.change(project, args.add, args.remove, context.user)

    # ---------------------------------------------------------------------------------------------- presence, previews
    @rpc("UpdatePresence")
    async def update_presence(self, context: Context, args: Presence) -> None:
        """Say what the user looks at and edits."""
        assert context.user
        self._presence.update(context.client, args)

    @rpc("PreviewMove")
    async def preview_move(self, context: Context, args: MovePreview) -> None:
        """Show the others where an item is that the caller drags just now."""
        user = context.user
        document = self._session.require_scene_open()
        for kind in (Kind.OBJECT, Kind.POINT, Kind.ORIENTATION, Kind.JOINTS):
            if (item := document.find(kind, args.id)) is not None:
                break
        else:
            raise NotFound("There is no object, action point, orientation or joints {id!r}.", id=args.id)
        if item.kind in OF_SCENE and context.client.role < Role.TECHNICIAN:
            raise RequestRefused("Moving an object needs the role technician or a higher one.")
        if item.kind is Kind.JOINTS and not (isinstance(args.position, Unset) and isinstance(args.orientation, Unset)):
            raise RequestRefused("Joints have neither a position nor an orientation.")
        if item.kind is not Kind.JOINTS and not isinstance(args.joints, Unset):
            raise RequestRefused("{id!r} has no joints.", id=args.id)
        locked = args.id if self._locks.holds(user, args.id) else item.parent or args.id
        self._locks.require_held(user, locked)
        self._previews.show(context.client, user, args, locked)
