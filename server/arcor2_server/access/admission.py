"""Admission of clients: the role that a token, the listener or a local-only server gives them."""

import ipaddress
import time
from collections import OrderedDict, deque
from typing import Any, Final

import structlog
from litestar.connection import ASGIConnection
from litestar.exceptions import NotAuthorizedException, PermissionDeniedException, TooManyRequestsException
from litestar.handlers import BaseRouteHandler, WebsocketRouteHandler

from arcor2_hw.data.base import Data
from arcor2_hw.data.role import Role
from arcor2_hw.exceptions import Arcor2Error
from arcor2_server.access.connection_limits import CONNECTION
from arcor2_server.access.route_options import AS_ROLE, OPEN, PERSON, ROLE
from arcor2_server.access.tokens import FILE, Token, TokenFile
from arcor2_server.log import audit
from arcor2_server.settings import ServerSettings

log = structlog.get_logger(__name__)

WRONG_TOKENS: Final = 10
"""Wrong tokens from one address within `WRONG_TOKENS_WITHIN` s, after which it has to wait."""
WRONG_TOKENS_WITHIN: Final = 60.0
REMEDY: Final = "Make new tokens on the server with `arcor2-hw token add`."
REMEMBERED: Final = 1000
"""Addresses of which wrong tokens are counted."""
PARAMETER: Final = "token"
"""The query parameter that may carry the token, for clients that cannot set headers, such as browsers."""


class AccessRefused(Arcor2Error):
    """The token is not valid: unknown, revoked or expired."""

    code = "access_refused"


class TooManyAttempts(AccessRefused):
    """Too many wrong tokens came from one address."""

    code = "too_many_attempts"


class Admission(Data, frozen=True):
    """The role of an admitted client; None if the client has to send a token first."""

    role: Role | None
    token: Token | None = None


def is_loopback(host: str) -> bool:
    """Return whether only this machine can reach an address."""
    if host == "localhost":
        return True
    try:
        return ipaddress.ip_address(host.strip("[]")).is_loopback
    except ValueError:
        return False


def is_local(settings: ServerSettings) -> bool:
    """Return whether only this machine reaches the server: it listens on loopback, and no proxy is in front of it."""
    return is_loopback(settings.host) and not settings.trusted_proxies


class Access:
    """Decides which clients are admitted."""

    def __init__(self, settings: ServerSettings) -> None:
        self._settings = settings
        self._tokens = TokenFile(settings.data_dir)
        self._wrong: OrderedDict[str, deque[float]] = OrderedDict()

    @property
    def open_to_all(self) -> bool:
        """Whether no token is required: by a setting, or for a local-only server without tokens."""
        if self._settings.insecure:
            return True
        return is_local(self._settings) and not self._tokens.all() and not self._tokens.unusable

    def by_token(self, secret: str, address: str) -> Admission:
        """Admit a client by a token. Raise AccessRefused, or TooManyAttempts before the token is checked."""
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
            while len(self._wrong) > REMEMBERED:
                self._wrong.popitem(last=False)
            log.warning("wrong token", address=address)
            raise AccessRefused("The token is not valid: it is unknown, was revoked, or its time is over.")
        return Admission(token.role, token)

    def admit(self, connection: ASGIConnection[Any, Any, Any, Any]) -> Admission:
        """Decide by the listener and by the token in header or query. Raise AccessRefused if that is impossible."""
        secret = _secret(connection)
        if secret is not None:
            return self.by_token(secret, address_of(connection))
        if self._by_legacy_listener(connection) and self._settings.legacy is not None:
            return Admission(self._settings.legacy.role)
        return Admission(self._settings.default_role if self.open_to_all else None)

    @property
    def damage(self) -> str:
        """What is wrong with the file of tokens, empty when it is intact."""
        return self._tokens.damage

    def repair(self) -> str:
        """Repair the file of tokens from its copy. Returns what was wrong with it, empty when it was intact."""
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
        while attempts and time.monotonic() - attempts[0] > WRONG_TOKENS_WITHIN:
            attempts.popleft()
        return attempts


def address_of(connection: ASGIConnection[Any, Any, Any, Any]) -> str:
    """Return the other side's address."""
    return connection.client.host if connection.client else ""


def _secret(connection: ASGIConnection[Any, Any, Any, Any]) -> str | None:
    kind, _, value = connection.headers.get("authorization", "").partition(" ")
    if kind.lower() == "bearer" and value.strip():
        return value.strip()
    found: str | None = connection.query_params.get(PARAMETER)
    return found


def role_needed(connection: ASGIConnection[Any, Any, Any, Any], handler: BaseRouteHandler) -> None:
    """Refuse a REST request whose sender lacks the role of the route (a guard of Litestar).

    Requests on the websocket have their own roles, and its clients may send the token later.
    """
    if isinstance(handler, WebsocketRouteHandler) or handler.opt.get(OPEN):
        return
    access: Access = connection.app.state.access
    try:
        admission = access.admit(connection)
    except TooManyAttempts as error:
        raise TooManyRequestsException(str(error)) from None
    except AccessRefused as error:
        raise NotAuthorizedException(str(error), headers={"WWW-Authenticate": "Bearer"}) from None
    role = admission.role
    extensions: dict[str, Any] = connection.scope.get("extensions") or {}
    if role is not None and CONNECTION in extensions:
        extensions[CONNECTION].admit()
    if admission.token is not None:
        connection.state[PERSON] = admission.token.name
    if role is None:
        raise NotAuthorizedException(
            "A token is needed: Authorization: Bearer ...", headers={"WWW-Authenticate": "Bearer"}
        )
    connection.state[AS_ROLE] = role
    needed = handler.opt.get(ROLE, Role.PROGRAMMER)
    if role < needed:
        audit.note(
            "forbidden",
            f"{connection.scope.get('method', '')} {connection.url.path}",
            user=connection.state.get(PERSON, ""),
            role=role,
            address=address_of(connection),
            target="",
        )
        raise PermissionDeniedException(f"This needs the role {needed.name.lower()} or a higher one.")
