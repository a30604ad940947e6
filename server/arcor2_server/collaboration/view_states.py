"""View states of the clients, per user and shared. The server stores them without interpreting them."""

import asyncio
import time
from collections import OrderedDict
from collections.abc import Mapping
from typing import Any, Final

import msgspec

from arcor2_hw.data.base import UNSET
from arcor2_hw.data.editor import ViewScope, ViewState
from arcor2_server.errors import RequestRefused
from arcor2_server.events import Connection, EventHub, encode, make_event
from arcor2_server.storage.shared_data import SharedData

MAX_VALUE: Final = 64 * 1024
"""Maximum size of one value, bytes."""
MAX_VIEW: Final = 1024 * 1024
"""Maximum size of all values of one document and scope, bytes."""
MAX_KEYS: Final = 1000
"""Maximum number of values of one document and scope."""
MAX_DOCUMENTS: Final = 200
"""Maximum number of documents per user with stored views."""
MAX_SHARED: Final = 10_000
"""Maximum number of documents with stored shared views."""
MAX_CACHED: Final = 64
"""Maximum number of cached views."""


class ViewStates:
    """The view values by user (empty: shared) and document, stored in the database and cached."""

    def __init__(self, hub: EventHub, data: SharedData) -> None:
        self._hub = hub
        self._data = data
        self._views: OrderedDict[tuple[str, str], dict[str, bytes]] = OrderedDict()
        self._revision = 0
        self._turn = asyncio.Lock()

    async def get(self, scope: ViewScope, user: str, document: str) -> ViewState:
        """Return a view. Raise StorageError if it cannot be read."""
        async with self._turn:
            values = await self._view(_owner(scope, user), document)
            decoded = {key: msgspec.json.decode(value) for key, value in values.items()}
            return ViewState(scope, decoded, await self._now(), document, user or UNSET)

    async def change(
        self, scope: ViewScope, user: str, document: str, values: Mapping[str, Any], by: Connection
    ) -> int:
        """Write values and publish them to other clients; return the revision.

        Args:
            scope: Whether the view belongs to a user or is shared.
            user: The user.
            document: The id of the scene or project.
            values: The changed values by key; None deletes a value.
            by: The client that changes the view.

        Raises:
            RequestRefused: A limit is exceeded, or a value cannot be encoded.
            StorageError: The values cannot be written.
        """
        encoded = {key: _encoded(key, value) for key, value in values.items()}
        owner = _owner(scope, user)
        async with self._turn:
            before = await self._view(owner, document)
            after = {key: value for key, value in (before | encoded).items() if value is not None}
            if len(after) > max(MAX_KEYS, len(before)):
                raise RequestRefused("More than {max_keys} keys cannot be stored for one document.", max_keys=MAX_KEYS)
            if sum(map(len, after.values())) > max(MAX_VIEW, sum(map(len, before.values()))):
                raise RequestRefused("More than {max_view} bytes cannot be stored for one document.", max_view=MAX_VIEW)
            revision = max(await self._now() + 1, time.time_ns() // 1_000_000)
            await self._data.put_view(owner, document, encoded, revision)
            self._revision = revision
            if not before:
                await self._drop_oldest(owner)
            if (owner, document) in self._views or not before:
                self._views[owner, document] = after
        state = ViewState(scope, dict(values), revision, document, user or UNSET)
        self._publish(scope, user, state, by)
        return revision

    async def forget(self, document: str) -> None:
        """Delete all views of a deleted document. Raise StorageError if the database cannot be written."""
        async with self._turn:
            await self._data.delete_document(document)
            for key in [key for key in self._views if key[1] == document]:
                del self._views[key]

    # -------------------------------------------------------------------------------- internals
    async def _view(self, owner: str, document: str) -> dict[str, bytes]:
        key = owner, document
        if (view := self._views.get(key)) is None:
            view = self._views[key] = await self._data.view(owner, document)
            if len(self._views) > MAX_CACHED:
                self._views.popitem(last=False)
        self._views.move_to_end(key)
        return view

    async def _now(self) -> int:
        if not self._revision:
            self._revision = await self._data.newest_revision()
        return self._revision

    async def _drop_oldest(self, owner: str) -> None:
        oldest = await self._data.oldest_views(owner, MAX_DOCUMENTS if owner else MAX_SHARED)
        if oldest:
            await self._data.delete_views(owner, oldest)
            for document in oldest:
                self._views.pop((owner, document), None)

    def _publish(self, scope: ViewScope, user: str, state: ViewState, by: Connection) -> None:
        event = encode(make_event("ViewStateChanged", state))
        for client in self._hub.subscribers("ViewStateChanged"):
            concerned = scope is ViewScope.SHARED or user == client.user or user in client.follows
            if concerned and client is not by:
                client.put(event)


def _owner(scope: ViewScope, user: str) -> str:
    return "" if scope is ViewScope.SHARED else user


def _encoded(key: str, value: Any) -> bytes | None:
    if value is None:
        return None
    try:
        encoded = msgspec.json.encode(value)
    except (RecursionError, UnicodeEncodeError, OverflowError) as error:
        raise RequestRefused("The value of {key!r} cannot be stored: {reason}.", key=key, reason=error) from None
    if len(encoded) > MAX_VALUE:
        raise RequestRefused("The value of {key!r} has more than {max_value} bytes.", key=key, max_value=MAX_VALUE)
    return encoded
