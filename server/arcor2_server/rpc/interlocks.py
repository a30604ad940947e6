"""Requests about interlocks (docs/protocol/interlocks.md)."""

from dataclasses import dataclass

from msgspec.structs import replace

from arcor2_hw.data.base import new_id
from arcor2_hw.data.rpc import IdArgs, ListInterlocksData, PutInterlockArgs, PutInterlockData
from arcor2_server.collaboration.locks import SCENE, Locks
from arcor2_server.documents import Session
from arcor2_server.documents.changes import Kind
from arcor2_server.documents.checks.interlocks import check_interlock
from arcor2_server.execution.service import Execution
from arcor2_server.object_types.registry import ObjectTypes
from arcor2_server.online.online_scene import OnlineScene
from arcor2_server.rpc.editing import Editing
from arcor2_server.rpc.registry import Context, rpc


@dataclass(frozen=True, slots=True)
class InterlockRequests:
    """Requests about interlocks (docs/protocol/interlocks.md)."""

    _locks: Locks
    _types: ObjectTypes
    _session: Session
    _online: OnlineScene
    _execution: Execution
    _editing: Editing

    @rpc("ListInterlocks")
    async def list_interlocks(self, context: Context, args: None) -> ListInterlocksData:
        """Return the interlocks of the open scene, and the states of those of the online scene or running program."""
        states = self._execution.board.interlocks or self._online.board.interlocks
        return ListInterlocksData(self._session.require_scene_open().interlocks(), states)

    @rpc("PutInterlock")
    async def put_interlock(self, context: Context, args: PutInterlockArgs) -> PutInterlockData:
        """Add an interlock, or change one. An online scene uses it at once."""
        given = args.interlock
        self._session.require_scene_open()
        async with self._locks.auto_skip_held(context.user, SCENE, *([given.id] if given.id else [])):
            document = self._session.require_scene_open()
            known = document.interlock(given.id) if given.id else None
            interlock = given if known else replace(given, id=new_id("ilk"))
            check_interlock(interlock, document.scene_object, self._types)
            if known is None or known.name != interlock.name:
                self._editing.require_name_free(Kind.INTERLOCK, interlock.name, "an interlock")
            change = (
                document.add(Kind.INTERLOCK, interlock.id, interlock)
                if known is None
                else document.update(Kind.INTERLOCK, interlock.id, interlock)
            )
            await self._editing.commit_one(context, change)
        return PutInterlockData(interlock.id)

    @rpc("DeleteInterlock")
    async def delete_interlock(self, context: Context, args: IdArgs) -> None:
        """Delete an interlock."""
        self._session.require_scene_open()
        async with self._locks.auto_skip_held(context.user, SCENE, args.id):
            document = self._session.require_scene_open()
            if await self._editing.commit_one(context, document.remove(Kind.INTERLOCK, args.id)):
                self._editing.drop_locks(context, args.id)
