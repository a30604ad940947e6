"""Admission of clients: determines the role of a client from its token, its listener or the server settings."""

import time
from collections import OrderedDict, deque
from typing import Any, Final

import structlog
from litestar.connection import ASGIConnection
from litestar.exceptions import NotAuthorizedException, PermissionDeniedException, TooManyRequestsException
from litestar.handlers import BaseRouteHandler, WebsocketRouteHandler

from arcor2_hw.data.audit import AuditOutcome
from arcor2_hw.data.base import Data
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.messages import Message, translatable
from arcor2_server.access.connection_limits import CONNECTION
from arcor2_server.access.route_options import AS_ROLE, OPEN, PERSON, ROLE, STOPS
from arcor2_server.access.tokens import FILE, Token, TokenFile
from arcor2_server.settings import ServerSettings, is_loopback

log = structlog.get_logger(__name__)

WRONG_TOKENS: Final = 10
"""Number of wrong tokens from one address within WRONG_TOKENS_PERIOD after which further tokens are refused."""
WRONG_TOKENS_PERIOD: Final = 60.0
"""Period in which wrong tokens are counted, s."""
REMEDY: Final = "Create new tokens on the server with `arcor2-hw token add`."
MAX_ADDRESSES: Final = 1000
"""Maximum number of addresses whose wrong tokens are counted."""
PARAMETER: Final = "token"
"""The query parameter that may carry the token, for clients that cannot set headers, such as browsers."""
SESSION: Final = "arcor2-session"
"""The header with the session of a person who is logged on at a shared device."""
LOG_ON_NEEDED: Final = Message.of("Log on at this device first.")


class AccessRefused(Arcor2Error):
    """The token is not valid: unknown, revoked or expired."""

    code = "access_refused"


class TooManyAttempts(AccessRefused):
    """Too many wrong tokens came from one address."""

    code = "too_many_attempts"


class Admission(Data, frozen=True):
    """Role of an admitted client. The role is None if the client has to send a token first."""

    role: Role | None
    token: Token | None = None


def right(ceiling: Role, *, shared: bool, person: Role | None) -> Role:
    """Return the role of a client: the lower one of its token and of the person who is logged on.

    A shared device without a logged-on person can view what an operator can view.
    """
    if person is not None:
        return min(ceiling, person)
    return min(ceiling, Role.OPERATOR) if shared else ceiling


def is_local(settings: ServerSettings) -> bool:
    """Return whether only this machine reaches the server: it listens on loopback, and not behind a proxy."""
    return is_loopback(settings.host) and not settings.trusted_proxies


class Access:
    """Decides which clients are admitted."""

    def __init__(self, settings: ServerSettings) -> None:
        self._settings = settings
        self._tokens = TokenFile(settings.data_dir)
        self._wrong: OrderedDict[str, deque[float]] = OrderedDict()

    @property
    def open_to_all(self) -> bool:
        """Whether clients need no token: by a setting, or if none exists and only this machine reaches the server."""
        if self._settings.insecure:
            return True
        return is_local(self._settings) and not self._tokens.all() and not self._tokens.unusable

    def by_token(self, secret: str, address: str) -> Admission:
        """Return the admission for a token.

        Raises:
            TooManyAttempts: too many wrong tokens came from this address; the token was not checked.
            AccessRefused: the token is not valid.
        """
        attempts = self._attempts(address)
        if len(attempts) >= WRONG_TOKENS:
            raise TooManyAttempts("Too many wrong tokens came from {address}: wait a minute.", address=address)
        token = self._tokens.find(secret)
        if token is None and self._tokens.unusable:
            raise AccessRefused(
                "No token can be checked: the server's file {file} is damaged. {remedy}", file=FILE, remedy=REMEDY
            )
        if token is None:
            attempts.append(time.monotonic())
            self._wrong[address] = attempts
            while len(self._wrong) > MAX_ADDRESSES:
                self._wrong.popitem(last=False)
            log.warning("wrong token", address=address)
            raise AccessRefused("The token is not valid: it is unknown, revoked or expired.")
        return Admission(token.role, token)

    def admit(self, connection: ASGIConnection[Any, Any, Any, Any]) -> Admission:
        """Return the admission for a connection, by its token in header or query, or without one by its listener.

        Raises:
            AccessRefused: the token is not valid.
        """
        secret = _secret(connection)
        if secret is not None:
            return self.by_token(secret, address_of(connection))
        if self._by_legacy_listener(connection) and self._settings.legacy is not None:
            return Admission(self._settings.legacy.role)
        return Admission(self._settings.default_role if self.open_to_all else None)

    @property
    def damage(self) -> Message | None:
        """The problem of the token file, empty if it is intact."""
        return self._tokens.damage

    def device_names(self) -> dict[str, str]:
        """Return the names of the tokens by id."""
        return {token.id: token.name for token in self._tokens.all()}

    def repair(self) -> Message | None:
        """Repair the token file from its copy. Return its problem, None if it was intact."""
        return self._tokens.repair()

    def valid(self, token: Token) -> bool:
        """Return whether a token is still valid."""
        return self._tokens.valid(token)

    def _by_legacy_listener(self, connection: ASGIConnection[Any, Any, Any, Any]) -> bool:
        legacy, local = self._settings.legacy, connection.scope.get("server")
        if legacy is None or local is None or local[1] != legacy.port:
            return False
        return legacy.port != self._settings.port or local[0] == legacy.host

    def _attempts(self, address: str) -> deque[float]:
        attempts = self._wrong.get(address, deque())
        while attempts and time.monotonic() - attempts[0] > WRONG_TOKENS_PERIOD:
            attempts.popleft()
        return attempts


def address_of(connection: ASGIConnection[Any, Any, Any, Any]) -> str:
    """Return the address of the client, empty if unknown."""
    return connection.client.host if connection.client else ""


def _secret(connection: ASGIConnection[Any, Any, Any, Any]) -> str | None:
    kind, _, value = connection.headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer" and value.strip():
        return value.strip()
    found: str | None = connection.query_params.get(PARAMETER)
    return found


def role_needed(connection: ASGIConnection[Any, Any, Any, Any], handler: BaseRouteHandler) -> None:
    """Refuse a REST request of a client without the role of the route (a guard of Litestar).

    The websocket is not checked here: each of its requests has its own role, and clients may send the token later.
    """
    if isinstance(handler, WebsocketRouteHandler) or handler.opt.get(OPEN):
        return
    access: Access = connection.app.state.access
    try:
        admission = access.admit(connection)
    except TooManyAttempts as error:
        raise TooManyRequestsException(str(error), extra=error.message.translation()) from None
    except AccessRefused as error:
        raise NotAuthorizedException(
            str(error), headers={"WWW-Authenticate": "Bearer"}, extra=error.message.translation()
        ) from None
    role = admission.role
    extensions: dict[str, Any] = connection.scope.get("extensions") or {}
    if role is not None and CONNECTION in extensions:
        extensions[CONNECTION].admit()
    token, method, shared, person = admission.token, connection.scope.get("method", ""), False, None
    if token is not None:
        connection.state[PERSON], shared = token.name, token.shared
    if (session := connection.headers.get(SESSION)) is not None:
        device = address_of(connection) if token is None else token.id
        person = connection.app.state.log_ons.person_of(session, device, active=method != "GET")
    if person is not None:
        connection.state[PERSON] = person.name
    if role is None:
        raise NotAuthorizedException(
            translatable("A token is needed: Authorization: Bearer ..."), headers={"WWW-Authenticate": "Bearer"}
        )
    role = connection.state[AS_ROLE] = right(role, shared=shared, person=None if person is None else person.role)
    needed = handler.opt.get(ROLE, Role.PROGRAMMER)
    logged_off = shared and person is None
    if role < needed or (logged_off and method != "GET" and not handler.opt.get(STOPS)):
        connection.app.state.audit.note(
            AuditOutcome.FORBIDDEN,
            f"{method} {connection.url.path}",
            user=connection.state.get(PERSON, ""),
            role=role,
            address=address_of(connection),
        )
        message = Message.of("This needs the role {role} or a higher one.", role=needed.shown)
        if logged_off:
            message = LOG_ON_NEEDED
        raise PermissionDeniedException(message.text, extra=message.translation())
