"""HTTP/1.1 port of the fake controller: digest authentication (RFC 7616, MD5), sessions by cookie."""

import hashlib
import json
import re
import secrets
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from html import escape
from typing import Any, Final
from urllib.parse import parse_qsl, urlsplit

import h11

from arcor2_fakes.wire import Connection

REALM: Final = "validusers@robapi.abb"
MAX_SESSIONS: Final = 70
SESSION_TIMEOUT: Final = 300.0
"""Time after its last request at which a session ends and its mastership is released, s."""
MAX_BODY: Final = 65536
COOKIE: Final = "-http-session-"
_FIELD: Final = re.compile(r'(\w+)=(?:"([^"]*)"|([^\s,]+))')


@dataclass
class Request:
    """A request of an authenticated client."""

    method: str
    path: str
    query: dict[str, str]
    body: dict[str, str]
    session: "Session"


@dataclass
class Session:
    """A session: number, user, time of the last request."""

    number: int
    key: str
    user: str
    address: str
    last_request: float = field(default_factory=time.monotonic)


@dataclass
class Answer:
    """An answer: states as (type, title, fields), or an error of the controller."""

    status: int = 200
    states: list[tuple[str, str, dict[str, str]]] = field(default_factory=list)
    error: tuple[int, str] | None = None


class HttpPort:
    """Serves HTTP on each connection, and passes requests of authenticated users to `handle`."""

    def __init__(
        self,
        user: str,
        password: str,
        handle: Callable[[Request], Answer],
        session_ended: Callable[[int], None],
    ) -> None:
        self._user, self._password = user, password
        self._handle, self._session_ended = handle, session_ended
        self._sessions: dict[str, Session] = {}
        self._nonces: set[str] = set()
        self._numbers = 0
        self.requests = 0

    def opened(self, connection: Connection) -> None:
        """Serve a client."""
        http = h11.Connection(h11.SERVER)
        head: list[h11.Request] = []
        body = bytearray()

        def received(data: bytes) -> None:
            try:
                http.receive_data(data)
                while True:
                    event = http.next_event()
                    if isinstance(event, h11.Request):
                        head[:] = [event]
                        body.clear()
                    elif isinstance(event, h11.Data):
                        body.extend(event.data)
                        if len(body) > MAX_BODY:
                            connection.close()
                            return
                    elif isinstance(event, h11.EndOfMessage):
                        connection.send(self._respond(http, head[0], bytes(body)))
                        if http.our_state is h11.MUST_CLOSE:
                            connection.close()
                            return
                        http.start_next_cycle()
                    else:
                        return
            except h11.ProtocolError:
                connection.close()

        connection.received = received

    @property
    def sessions(self) -> int:
        """Return the number of sessions."""
        return len(self._sessions)

    def expire(self) -> None:
        """End sessions without recent requests."""
        for session in list(self._sessions.values()):
            if time.monotonic() - session.last_request > SESSION_TIMEOUT:
                self._end(session)

    def end_all(self) -> None:
        """End all sessions."""
        for session in list(self._sessions.values()):
            self._end(session)

    def _end(self, session: Session) -> None:
        del self._sessions[session.key]
        self._session_ended(session.number)

    def _respond(self, http: h11.Connection, head: h11.Request, body: bytes) -> bytes:
        self.requests += 1
        headers = {name.decode().lower(): value.decode("latin-1") for name, value in head.headers}
        method, target = head.method.decode(), head.target.decode()
        url = urlsplit(target)
        query = dict(parse_qsl(url.query, keep_blank_values=True))
        session, fresh = self._session(headers, method, target)
        extra: list[tuple[str, str]] = []
        if session is None:
            nonce = secrets.token_hex(16)
            self._nonces.add(nonce)
            challenge = (
                f'Digest realm="{REALM}", domain="/", qop="auth", nonce="{nonce}", algorithm=MD5, opaque="arcor"'
            )
            answer, extra = Answer(401), [("WWW-Authenticate", challenge)]
        elif len(self._sessions) > MAX_SESSIONS:
            self._end(session)
            answer = Answer(503, error=(-1073442809, "too many sessions"))
        else:
            if fresh:
                extra = [("Set-Cookie", f"{COOKIE}={session.key}; path=/; httponly")]
            session.last_request = time.monotonic()
            fields = dict(parse_qsl(body.decode("latin-1"), keep_blank_values=True))
            if url.path == "/logout":
                self._end(session)
                answer = Answer(200)
            else:
                answer = self._handle(Request(method, url.path, query, fields, session))
        content, kind = _rendered(answer, query.get("json") == "1")
        out = http.send(
            h11.Response(
                status_code=answer.status,
                headers=[("Content-Type", kind), ("Content-Length", str(len(content))), *extra],
            )
        )
        return out + http.send(h11.Data(data=content)) + http.send(h11.EndOfMessage())

    def _session(self, headers: dict[str, str], method: str, target: str) -> tuple[Session | None, bool]:
        cookies = dict(part.strip().partition("=")[::2] for part in headers.get("cookie", "").split(";"))
        known = self._sessions.get(cookies.get(COOKIE, ""))
        if known is not None:
            return known, False
        if not self._may(headers.get("authorization", ""), method, target):
            return None, False
        self._numbers += 1
        session = Session(self._numbers, f"{self._numbers}::http.session::{secrets.token_hex(8)}", self._user, "")
        self._sessions[session.key] = session
        return session, True

    def _may(self, authorization: str, method: str, target: str) -> bool:
        scheme, _, rest = authorization.partition(" ")
        given = {name: quoted or plain for name, quoted, plain in _FIELD.findall(rest)}
        if scheme.lower() != "digest" or given.get("nonce") not in self._nonces or given.get("uri") != target:
            return False
        one = _md5(f"{self._user}:{REALM}:{self._password}")
        two = _md5(f"{method}:{target}")
        middle = ":".join(given.get(name, "") for name in ("nonce", "nc", "cnonce", "qop"))
        return given.get("username") == self._user and given.get("response") == _md5(f"{one}:{middle}:{two}")


def _md5(text: str) -> str:
    return hashlib.md5(text.encode(), usedforsecurity=False).hexdigest()


def _rendered(answer: Answer, as_json: bool) -> tuple[bytes, str]:
    if answer.status == 204:
        return b"", "text/plain"
    embedded: dict[str, Any] = {}
    if answer.error is not None:
        code, text = answer.error
        embedded["status"] = {"code": code, "msg": text}
    else:
        embedded["_state"] = [{"_type": kind, "_title": title, **fields} for kind, title, fields in answer.states]
    if as_json:
        whole = {"_links": {"base": {"href": "http://controller/"}}, "_embedded": embedded}
        return json.dumps(whole).encode(), "application/json;v=1.0"
    if answer.error is not None:
        code, text = answer.error
        parts = f'<div class="status"><span class="code">{code}</span><span class="msg">{escape(text)}</span></div>'
    else:
        items = (
            f'<li class="{kind}" title="{escape(title)}">'
            + "".join(f'<span class="{name}">{escape(value)}</span>' for name, value in fields.items())
            + "</li>"
            for kind, title, fields in answer.states
        )
        parts = f'<div class="state"><ul>{"".join(items)}</ul></div>'
    head = '<?xml version="1.0" encoding="UTF-8"?><html xmlns="http://www.w3.org/1999/xhtml"><body>'
    return f"{head}{parts}</body></html>".encode(), "application/xhtml+xml;v=1.0"
