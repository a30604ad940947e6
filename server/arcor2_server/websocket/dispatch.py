"""From a decoded request to its handler, and from the result to the answer."""

import asyncio
import logging
import secrets
from collections.abc import Sequence
from time import perf_counter
from typing import Any
from weakref import WeakKeyDictionary

import msgspec
import structlog
from msgspec import UNSET

from arcor2_hw.data.audit import AuditOutcome
from arcor2_hw.data.role import Role
from arcor2_hw.data.rpc import Request, Rpc
from arcor2_hw.data.texts import check_texts, needs_check
from arcor2_hw.exceptions import Arcor2Error, InvalidData
from arcor2_hw.messages import Message
from arcor2_server.access.admission import LOG_ON_NEEDED
from arcor2_server.audit import commands
from arcor2_server.audit.changes import Change, collecting
from arcor2_server.audit.trail import ENDED_EARLY, AuditTrail
from arcor2_server.collaboration.log_ons import LogOns
from arcor2_server.durations import Durations
from arcor2_server.errors import RequestRefused
from arcor2_server.websocket.answers import Head, answer, refusal, shortened
from arcor2_server.websocket.client import Client
from arcor2_server.websocket.hub import Hub
from arcor2_server.websocket.request import Context
from arcor2_server.websocket.routes import Route

log = structlog.get_logger(__name__)


def refuse(client: Client, request: "Request | Head", message: Message, code: str = "") -> None:
    """Send the answer to a refused request."""
    encoded = refusal(request, message, code)
    if log.is_enabled_for(logging.DEBUG):
        log.debug("refused", client=client.number, request=request.request[:200], message=shortened(message.text))
    client.put(encoded)


class Dispatcher:
    """Calls the handlers of requests and answers them."""

    def __init__(self, hub: Hub, audit: AuditTrail, log_ons: LogOns) -> None:
        self.durations = Durations()
        """Durations of the handled requests, without answers from the cache."""
        self._hub = hub
        self._audit = audit
        self._log_ons = log_ons
        self._holds: WeakKeyDictionary[Client, tuple[str, str, int, str]] = WeakKeyDictionary()
        """The last noted hold-to-run request of each client."""

    def answer_from_cache(self, client: Client, request: Request, route: Route) -> bool:
        """Send the cached answer if there is one; return whether it was sent."""
        if client.role < route.rpc.role or route.cached is None:
            return False
        try:
            data = route.cached(request.codes)
        except Exception:
            # The handler will meet the same error and report it.
            log.exception("cached answer failed", request=request.request)
            return False
        if data is not None:
            client.put(answer(request, data))
        return data is not None

    async def handle(self, client: Client, request: Request, route: Route) -> None:
        """Handle a request and send its answer."""
        started, done = perf_counter(), False
        try:
            done = await self._run(client, request, route)
        except Exception:
            reference = secrets.token_hex(4)
            log.exception("request failed", request=request.request, reference=reference, user=client.user)
            message = Message.of("An error inside the server: see its log, reference {reference}.", reference=reference)
            refuse(client, request, message, "internal")
            if commands.is_command(route.rpc):
                self._audit.note(
                    AuditOutcome.REFUSED,
                    request.request,
                    user=client.name,
                    role=client.role,
                    address=client.address,
                    reason=message.text,
                )
        finally:
            self.durations.add(route.rpc.name, perf_counter() - started, failed=not done)

    async def _run(self, client: Client, request: Request, route: Route) -> bool:
        """Return whether the request was granted."""
        rpc = route.rpc
        if client.role < rpc.role and not (client.logged_off and commands.needs_person(rpc)):
            needed = Message.of(
                "{request} needs the role {role} or a higher one.", request=rpc.name, role=Role(rpc.role).shown
            )
            refuse(client, request, needed, "forbidden")
            self._note(AuditOutcome.FORBIDDEN, client, rpc, UNSET)
            return False
        if client.logged_off and commands.needs_person(rpc):
            refuse(client, request, LOG_ON_NEEDED, "log_on_needed")
            self._note(AuditOutcome.FORBIDDEN, client, rpc, UNSET)
            return False
        args = route.default
        if route.decode is not None:
            if not isinstance(request.args, msgspec.UnsetType):
                try:
                    args = route.decode(request.args)
                    if needs_check(bytes(request.args)):
                        check_texts(args)
                except InvalidData as error:
                    wrong = Message.of("The arguments of {request} are wrong: {reason}", request=rpc.name, reason=error)
                    refuse(client, request, wrong, error.code)
                    return False
                except (msgspec.DecodeError, RecursionError) as error:
                    wrong = Message.of(
                        "The arguments of {request} are wrong: {reason}.", request=rpc.name, reason=error
                    )
                    refuse(client, request, wrong, "invalid_arguments")
                    return False
            elif args is UNSET:
                missing = Message.of("The arguments of {request} are missing.", request=rpc.name)
                refuse(client, request, missing, "invalid_arguments")
                return False
        if route.handler is None:
            missing = Message.of("{request} is not available in this version.", request=rpc.name)
            refuse(client, request, missing, "not_available")
            return False
        if client.person is not None and commands.is_command(rpc) and not self._is_renewal(client, rpc, args):
            self._log_ons.touch(client)
        context = Context(client, request.dry_run and rpc.dry_run, rpc.name, request.codes, request.step)
        with collecting() as changes:
            try:
                data = await route.handler(context, args)
            except Arcor2Error as error:
                if error.detail:
                    log.info("request refused", request=rpc.name, reason=shortened(str(error)), detail=error.detail)
                if isinstance(error, RequestRefused) and error.data is not UNSET:  # a part of the request was done
                    self._send(client, refusal(request, error.message, error.code, error.data), context)
                else:
                    refuse(client, request, error.message, error.code)
                if not context.dry_run:
                    self._note(AuditOutcome.REFUSED, client, rpc, args, str(error), changes)
                return False
            except asyncio.CancelledError:
                if changes:
                    self._note(AuditOutcome.REFUSED, client, rpc, args, ENDED_EARLY, changes)
                raise
        self._send(client, answer(request, UNSET if data is None else data), context)
        if not context.dry_run:
            self._note(AuditOutcome.DONE, client, rpc, args, changes=changes)
        return True

    def _note(
        self,
        outcome: AuditOutcome,
        client: Client,
        rpc: Rpc,
        args: Any,
        reason: str = "",
        changes: Sequence[Change] = (),
    ) -> None:
        """Note a command, or any request refused by role. A hold-to-run request is noted once, not on each renewal."""
        if outcome is not AuditOutcome.FORBIDDEN and not commands.is_command(rpc):
            return
        if (hold := getattr(args, "hold", None)) is not None:
            noted = (rpc.name, args.robot_id, hold, outcome.value)
            if self._holds.get(client) == noted:
                return
            self._holds[client] = noted
        self._audit.note(
            outcome,
            rpc.name,
            target=commands.target_of(args),
            user=client.name,
            role=client.role,
            address=client.address,
            reason=reason,
            changes=changes,
        )

    def _is_renewal(self, client: Client, rpc: Rpc, args: Any) -> bool:
        """Return whether a request renews a hold-to-run motion. A button may be held without a person at the device."""
        hold = getattr(args, "hold", None)
        return hold is not None and self._holds.get(client, ())[:3] == (rpc.name, args.robot_id, hold)

    def _send(self, client: Client, message: bytes, context: Context) -> None:
        """Send an answer with the events of its request."""
        broadcast = self._hub.broadcast
        for event in context.events_before:
            broadcast(event)
        client.put(message)
        for event in context.events_to_caller:
            self._hub.send(client, event)
        for event in context.events_after:
            broadcast(event)
