"""The client: a connection to one server that reconnects, with a method for every request and streams of events."""

import asyncio
import os
import random
import ssl
import time
from types import TracebackType
from typing import Any, Final, Self

import msgspec

from arcor2_hw.client.errors import AnswerLost, AnswerTimeout, EventsMissed, NotAdmitted, RequestFailed, refusal
from arcor2_hw.client.requests import Requests
from arcor2_hw.client.rest import TOKEN_VARIABLE, Rest
from arcor2_hw.client.stream import EventStream
from arcor2_hw.client.wire import Message, Unanswered, Unsent, Wire
from arcor2_hw.data.base import Unset
from arcor2_hw.data.events import Event
from arcor2_hw.data.rpc import RPCS, AuthenticateArgs, RegisterForRobotEventArgs, RegisterUserArgs, SubscribeEventsArgs
from arcor2_hw.exceptions import ConnectionLost, DeviceTimeout, InvalidData, NotConnected

__all__ = ["Client", "RequestFailed"]

ANSWER_TIMEOUT: Final = 30.0
"""Time to wait for an answer, s, as in existing clients."""
FIRST_PAUSE, MAX_PAUSE = 0.1, 5.0
"""Pauses between attempts to reconnect, s: doubled each time, and randomized so that clients reconnect one by one."""
READING: Final = frozenset(
    {
        *("GetActions", "GetObjectTypes", "GetProject", "GetRobotMeta", "GetScene", "History"),
        *("ListCalibrations", "ListPackages"),
        *("ListProjects", "ListScenes", "ObjectTypeUsage", "ProjectsWithScene", "SceneObjectUsage", "SystemInfo"),
    }
)
"""Requests that change nothing and use no device.

They, and every dry run, are sent again when the connection breaks before

the answer. No other request is ever sent twice.
"""


class Client(Requests):
    """A connection to a server. Use it as `async with Client(url, user_name) as client`.

    Every request is a method (`await client.open_scene(id)`); `events()` and `follow(...)` return streams of events.
    When the connection is lost, the client reconnects: it registers its user, subscribes to the same events, and every
    stream raises EventsMissed. Requests wait for the connection within their time limit. A request that was sent but
    not answered raises AnswerLost; only those of READING and dry runs are sent again.

    Args:
        url: ws, wss, http or https.
        user_name: User to register.
        token: Access token; default: the environment variable ARCOR2_HW_TOKEN.
        tls: TLS context for a certificate that this machine does not trust (ssl.create_default_context(cafile=...)).
        timeout: Default time limit of a request, s.
        reconnect: Whether to reconnect; otherwise the first connection loss closes the client.
        connect_within: Time for which an initial connection is attempted, s.
    """

    def __init__(
        self,
        url: str,
        user_name: str | None = None,
        *,
        token: str | None = None,
        tls: ssl.SSLContext | None = None,
        timeout: float = ANSWER_TIMEOUT,
        reconnect: bool = True,
        connect_within: float = 0.0,
    ) -> None:
        self._url = url.replace("http://", "ws://", 1).replace("https://", "wss://", 1)
        self._user_name = user_name
        self._token = token or os.environ.get(TOKEN_VARIABLE) or None
        self._tls = tls
        self._timeout = timeout
        self._reconnect = reconnect
        self._connect_within = connect_within
        self._subscribed: set[str] = set()
        self._robots: dict[tuple[str, str], RegisterForRobotEventArgs] = {}
        self._wire: Wire | None = None
        self._joined = asyncio.Event()
        self._end: Exception | None = NotConnected("Not connected to {url}.", url=self._url)
        self._lost_at = 0.0
        self._keeper: asyncio.Task[None] | None = None
        self._own: EventStream[Event] = EventStream()
        self._streams: list[EventStream[Any]] = [self._own]
        self._rest: Rest | None = None

    # ------------------------------------------------------------------------------------------------ life
    async def __aenter__(self) -> Self:
        await self.open()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.close()

    @property
    def url(self) -> str:
        """URL of the server (ws or wss)."""
        return self._url

    @property
    def connected(self) -> bool:
        """Return whether a request would be sent at once."""
        return self._end is None and self._joined.is_set()

    @property
    def rest(self) -> Rest:
        """Return the client of the REST API, with the same token."""
        if self._rest is None:
            self._rest = Rest(self._url, token=self._token, tls=self._tls, timeout=self._timeout)
        return self._rest

    async def open(self) -> None:
        """Connect and, with a user name, register the user.

        Raises:
            ConnectionLost: The server does not answer; the message names its address.
            NotAdmitted: The token is not valid.
            RequestFailed: The user name is taken.
        """
        deadline = time.monotonic() + self._connect_within
        self._end = None
        pause = FIRST_PAUSE
        while True:
            try:
                await self._join()
                break
            except ConnectionLost as error:
                if time.monotonic() + pause > deadline:
                    self._end = error
                    raise
            except BaseException as error:
                self._end = (
                    error
                    if isinstance(error, Exception)
                    else NotConnected("The client is not open. Call open(), or use it in `async with`.")
                )
                raise
            await asyncio.sleep(pause)
            pause = min(2 * pause, MAX_PAUSE)
        self._joined.set()
        self._keeper = asyncio.create_task(self._keep(), name="client keeper")

    async def close(self) -> None:
        """Close the connection and end all streams. It does nothing when the connection is closed."""
        self._finish(None, ConnectionLost("The connection to {url} is closed.", url=self._url))
        if self._keeper is not None:
            self._keeper.cancel()
            await asyncio.gather(self._keeper, return_exceptions=True)
            self._keeper = None
        if self._wire is not None:
            await self._wire.close()
            self._wire = None
        if self._rest is not None:
            await self._rest.close()
            self._rest = None

    def _finish(self, reason: Exception | None, end: Exception) -> None:
        """End all streams with `reason` and refuse requests with `end`."""
        self._end = end
        self._joined.set()  # waiting requests see the end
        for stream in self._streams:
            stream.end(reason)

    def _deliver(self, item: Event | EventsMissed) -> None:
        for stream in self._streams:
            stream.put(item)

    # ------------------------------------------------------------------------------------------------ joining
    async def _join(self, gap: bool = False) -> None:
        """Connect, register and subscribe again.

        Raises:
            ConnectionLost: The server does not answer.
            NotAdmitted: The token is not valid.
            RequestFailed: The server refused a request.
            DeviceTimeout: The server did not answer in time.
        """
        seconds = time.monotonic() - self._lost_at
        held: list[Event | EventsMissed] | None = [] if gap else None

        def deliver(item: Event | EventsMissed) -> None:
            if held is None:
                self._deliver(item)
            else:
                held.append(item)  # delivered after the gap is known

        wire = await Wire.open(self._url, self._token, self._tls, deliver)
        not_resumed: list[str] = []
        try:
            if self._user_name is not None:
                await self._request(wire, "RegisterUser", RegisterUserArgs(self._user_name))
            elif self._token is not None:
                await self._request(wire, "SystemInfo", None)  # with an invalid token this request is not answered
            if self._subscribed:
                await self._request(wire, "SubscribeEvents", SubscribeEventsArgs(set(self._subscribed)))
            for key, args in list(self._robots.items()):
                try:
                    await self._request(wire, "RegisterForRobotEvent", args)
                except RequestFailed:
                    del self._robots[key]  # the scene is offline now, or the robot was removed
                    not_resumed.append(f"{args.what} of {args.robot_id}")
        except BaseException:
            await wire.close()
            raise
        if held is not None:
            self._deliver(EventsMissed(rejoined=True, seconds=seconds, not_resumed=tuple(not_resumed)))
            for item in held:
                self._deliver(item)
            held = None
        self._wire = wire

    async def _request(self, wire: Wire, name: str, args: Any) -> None:
        try:
            message = await wire.ask(name, args, False, self._timeout)
        except (Unsent, Unanswered):
            await wire.closed.wait()
            raise wire.refused or ConnectionLost("The connection to {url} is closed.", url=self._url) from None
        if not message.result:
            raise refusal(name, message.messages, reason=message.code)

    async def _keep(self) -> None:
        """Keep the client connected. An unexpected error is raised in all waiting calls and closes the client."""
        try:
            await self._stay_joined()
        except Exception as error:
            self._finish(error, error)
            raise

    async def _stay_joined(self) -> None:
        """Reconnect whenever the connection is lost, until the client is closed or not admitted."""
        while self._wire is not None:
            wire = self._wire
            await wire.closed.wait()
            self._joined.clear()
            self._lost_at = time.monotonic()
            await wire.close()
            refused = wire.refused
            if refused is not None or not self._reconnect:
                self._finish(refused, refused or ConnectionLost("The connection to {url} is closed.", url=self._url))
                return
            pause = FIRST_PAUSE
            while True:
                await asyncio.sleep(pause * random.uniform(0.5, 1.0))
                try:
                    await self._join(gap=True)
                except NotAdmitted as error:
                    self._finish(error, error)
                    return
                except (ConnectionLost, DeviceTimeout, RequestFailed):
                    # Refused: the server may still hold the old connection and the user name for a while.
                    pause = min(2 * pause, MAX_PAUSE)
                else:
                    break
            self._joined.set()

    # ------------------------------------------------------------------------------------------------ requests
    async def call(self, name: str, args: Any = None, *, dry_run: bool = False, timeout: float | None = None) -> Any:
        """Send a request and return its data, decoded as the protocol declares it. Prefer the method of the request.

        Args:
            name: Name of the request.
            args: Its arguments.
            dry_run: Whether the server only checks the request.
            timeout: Time limit, s; default: that of the client.

        Raises:
            RequestFailed: The server refused it, with a subclass for each kind of reason.
            AnswerLost: The connection broke after it was sent.
            AnswerTimeout: No answer came in time.
            NotConnected: The connection was not established in time. Nothing was sent.
            ConnectionLost: The connection is closed. Nothing was sent.
            NotAdmitted: The token is not valid. Nothing was sent.
        """
        limit = self._timeout if timeout is None else timeout
        deadline = time.monotonic() + limit
        while True:
            wire = await self._connection(name, deadline, limit)
            try:
                message = await wire.ask(name, args, dry_run, max(deadline - time.monotonic(), 0.0))
                break
            except Unsent:
                await wire.closed.wait()
            except Unanswered:
                await wire.closed.wait()
                harmless = name in READING or (dry_run and name in RPCS and RPCS[name].dry_run)
                if not (self._reconnect and harmless):
                    raise AnswerLost(name, self._url) from None
            except AnswerTimeout:
                raise AnswerTimeout(name, limit) from None
            await asyncio.sleep(0)  # lets the reconnecting task run
        data = self._data(name, message)
        if not message.result:
            raise refusal(name, message.messages, data, message.code)
        self._remember(args, dry_run)
        return data

    async def _connection(self, name: str, deadline: float, limit: float) -> Wire:
        """Return the connection, at once when there is one."""
        while self._wire is None or self._wire.closed.is_set() or not self.connected:
            try:
                async with asyncio.timeout(max(deadline - time.monotonic(), 0.0)):
                    if self._end is None:
                        await self._joined.wait()
            except TimeoutError:
                raise NotConnected(
                    "Not connected to {url} within {limit:g} s: {name} was not sent.",
                    url=self._url,
                    limit=limit,
                    name=name,
                ) from None
            if self._end is not None:
                raise self._end.with_traceback(None)
            await asyncio.sleep(0.001)  # the connection was just lost; the reconnecting task detects it
        return self._wire

    def _data(self, name: str, message: Message) -> Any:
        if isinstance(message.data, Unset):
            return None
        declared = RPCS.get(name)
        kind = Any if declared is None or declared.data is None else declared.data
        try:
            return msgspec.json.decode(message.data, type=kind)
        except msgspec.ValidationError as e:
            raise InvalidData("The server's answer to {name} is invalid.", str(e), name=name) from e

    def _remember(self, args: Any, dry_run: bool) -> None:
        """Store requests that have to be sent again after a connection loss."""
        if dry_run:
            return
        match args:
            case RegisterUserArgs(user_name=name):
                self._user_name = name
            case AuthenticateArgs(token=token):
                self._token = token
            case SubscribeEventsArgs(events=names, send=True):
                self._subscribed |= names
            case SubscribeEventsArgs(events=names):
                self._subscribed -= names
            case RegisterForRobotEventArgs(send=True):
                self._robots[args.robot_id, args.what] = args
            case RegisterForRobotEventArgs():
                self._robots.pop((args.robot_id, args.what), None)

    # ------------------------------------------------------------------------------------------------ events
    def events(self) -> EventStream[Event]:
        """Return the client's own stream of all events since it was opened, at most the newest 10,000."""
        return self._own

    def _follow(self, names: frozenset[str], limit: int) -> EventStream[Any]:
        stream: EventStream[Any] = EventStream(names, limit, self._streams.remove)
        self._streams.append(stream)
        if self._end is not None:
            stream.end(self._end if isinstance(self._end, NotAdmitted) else None)
        return stream

    async def next_event(self, *names: str, timeout: float = ANSWER_TIMEOUT) -> Event:
        """Return the next event of the own stream with one of the names, dropping others; any event without names.

        Raises:
            DeviceTimeout: No such event was received in time.
            EventsMissed: Events are missing.
            ConnectionLost: The stream has ended.
        """
        try:
            async with asyncio.timeout(timeout):
                async for event in self._own:
                    if not names or event.event in names:
                        return event
        except TimeoutError:
            raise DeviceTimeout(
                "No event {names} within {timeout:g} s.", names=" or ".join(names) or "at all", timeout=timeout
            ) from None
        raise ConnectionLost("The connection to {url} is closed.", url=self._url)


# Names before version 0.2.
LONGEST_PAUSE = MAX_PAUSE
