"""The object type of a production planning service (ERP): requests orders, and reports results through an outbox."""

import threading
import time
from datetime import UTC, datetime, timedelta
from typing import ClassVar, Final

import msgspec

from arcor2_hw.actions import action
from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Health, Identity, LossReaction, Reading, Severity
from arcor2_hw.exceptions import (
    Cancelled,
    ConnectionLost,
    DeviceError,
    DeviceFault,
    DeviceTimeout,
    NotConnected,
    NotFound,
    OutOfRange,
    Refused,
)
from arcor2_hw.messages import Message, device_at, translatable
from arcor2_hw.objects import Generic
from arcor2_hw.objects.connected import Connected
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.settings import within

from .outbox import Order, Outbox, OutboxState, RefusedMessage, file_of
from .sender import Sender
from .service import UNAUTHORIZED, Access, NextOrder, Service
from .settings import ErpSettings

STATUS_PERIOD: Final = 1.0
"""Time between two status requests, s."""
SENDER_END_TIMEOUT: Final = 0.05
"""Time that disconnecting waits for the sender, s. A request that is running may take longer and ends by itself."""
MAX_WAIT: Final = 3600.0
"""Longest time a program may wait in one call, s."""
MARGIN: Final = 65.0
"""Time beyond MAX_WAIT for two requests, s."""
MAX_TEXT: Final = 200
MAX_QUANTITY: Final = 1_000_000
WAITING, REFUSED, NOT_AUTHORIZED = "results_wait", "results_refused", "not_let_in"
"""Codes of alarms."""


class ErpService(Connected, Generic):
    """A production planning service (ERP): orders in, results out, each exactly once."""

    _ABSTRACT = False
    display_name = "ERP service"
    category = "Services"
    icon = "service"
    loss_reaction: ClassVar[LossReaction] = LossReaction.continues()  # it also plans for other stations
    loss_ends_program: ClassVar[bool] = False  # results wait in the outbox while production continues
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"next_order": "stop", "wait_until_sent": "stop"}

    def __init__(self, obj_id: str, name: str, settings: ErpSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._config = settings
        self.keep_connection(device_at(name, settings.url))
        self._outbox = Outbox(self.who, file_of(settings.outbox, settings.station, settings.url))
        self._life = threading.Lock()
        self._requesting_order = threading.Lock()
        self._stopped = threading.Event()
        self._stops = 0
        self._access: Access | None = None
        # Three connections, because each serves one request at a time.
        self._status_service: Service | None = None
        self._action_service: Service | None = None
        self._sender: Sender | None = None
        self._ending_sender: Sender | None = None

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Read the status of the service within `timeout` s, and start to deliver the messages in the outbox.

        Raises:
            NotConnected: The service cannot be reached, or a file of the settings cannot be used.
            DeviceTimeout: The service did not answer in time.
            Refused: The service rejects our credentials, or another program has opened the outbox.
            StorageError: The outbox cannot be written.
        """
        with self._life:
            deadline = time.monotonic() + timeout
            if self._sender is not None:
                self.observing.start(timeout)
                return
            if self._ending_sender is not None and not self._ending_sender.join(timeout):
                raise DeviceTimeout("the last connection to {device} is still being closed", device=self.who)
            self._ending_sender = None
            self.observing.start(max(deadline - time.monotonic(), 0.001))
            try:
                self._start_delivery(deadline)
            except BaseException:
                self.observing.stop()
                raise

    def _start_delivery(self, deadline: float) -> None:
        assert self._access is not None
        self._outbox.open(deadline - time.monotonic())
        self._action_service = Service(self.who, self._config, self._access)
        service = Service(self.who, self._config, self._access)
        self._sender = Sender(self.who, service, self._outbox, self._config.longest_pause)
        self._sender.start()

    def disconnect(self) -> None:
        """Stop delivering and close; does nothing when closed. Waiting messages stay in the outbox."""
        with self._life:
            self.stop()
            sender, self._sender = self._sender, None
            caller, self._action_service = self._action_service, None
            if caller is not None:
                caller.close()
            if sender is not None:
                sender.stop()
            self.observing.stop()
            if sender is not None:
                self._ending_sender = None if sender.join(SENDER_END_TIMEOUT) else sender

    def condition(self) -> Health:
        """Return check_function while there is an alarm."""
        return Health.CHECK_FUNCTION if self.alarms() else Health.NORMAL

    def identify(self) -> Identity:
        """Read name and version of the service."""
        self.observing.check()
        status = self._connected_service().status()
        return Identity("", status.service, "", status.version)

    def alarms(self) -> list[Alarm]:
        """Return alarms for results that wait too long or were refused, and for credentials that were rejected."""
        sender = self._sender
        if sender is None:
            return []
        found = []
        state = self._outbox.state(sender.last_error)
        if state.since is not None:
            due = datetime.fromisoformat(state.since) + timedelta(seconds=self._config.waiting_alarm)
            if sender.unauthorized:
                remedy = translatable("renew token_file or client_certificate, then go online again")
                found.append(Alarm.of(NOT_AUTHORIZED, Severity.ERROR, sender.unauthorized, remedy, state.since))
            elif datetime.now(UTC) >= due:
                why = state.last_error or Message.of("delivery is running")
                text = Message.of(
                    "{count} results have been waiting since {since}: {reason}",
                    count=state.waiting,
                    since=state.since,
                    reason=why,
                )
                remedy = translatable("check that the service is running and reachable; the results are delivered then")
                found.append(Alarm.of(WAITING, Severity.WARNING, text, remedy, due.isoformat(timespec="microseconds")))
        if refused := self._outbox.refused():
            first = refused[0]
            text = Message.of(
                "the service refused {count} results, the first of order {order}: {reason}",
                count=len(refused),
                order=first.order_id,
                reason=first.why,
            )
            remedy = translatable(
                "fix it at the service and run resend_refused, or acknowledge: the results are then stored but not sent"
            )
            found.append(Alarm.of(REFUSED, Severity.ERROR, text, remedy, first.since))
        return found

    def acknowledge(self, code: str) -> None:
        """Acknowledge refused results (code results_refused): they stay in the outbox and are not sent.

        Raises:
            NotFound: The alarm does not exist, or ends only with its cause.
        """
        if code != REFUSED or not self._outbox.acknowledge_refused():
            raise NotFound("{device} has no alarm {code!r} that can be acknowledged", device=self.who, code=code)

    # -------------------------------------------------------------------------------- outbox
    def outbox(self) -> Reading[OutboxState]:
        """Return the state of the outbox: number of waiting and of refused results, and the last error."""
        sender = self._sender
        if sender is None:
            raise NotConnected("{device} is not connected", device=self.who)
        return Reading.of(self._outbox.state(sender.last_error))

    def refused(self) -> list[RefusedMessage]:
        """Return the results that the service refused, with its reasons."""
        return self._outbox.refused()

    def stop(self) -> None:
        """End the calls that wait, with Cancelled. Delivery continues."""
        self._stops += 1
        self._stopped.set()
        if (sender := self._sender) is not None:
            sender.notify()

    # -------------------------------------------------------------------------------- actions
    @action(deadline=MAX_WAIT + MARGIN)
    def next_order(self, wait: float = 0.0, *, an: str | None = None) -> tuple[bool, str, str, int, int]:
        """Return the present order: whether there is one, its id, product, quantity, and pieces left to report.

        The order stays the same until each piece is reported or the order is closed, also while the service is down.
        If an answer is lost, the order is neither lost nor taken twice.

        :param wait: time to wait for an order, s; the first result is false without an order
        """
        assert 0.0 <= wait <= 3600.0

        within(f"{self.who}: wait", wait, 0.0, MAX_WAIT, "s")
        stops, deadline = self._stops, time.monotonic() + wait
        if not self._requesting_order.acquire(blocking=False):
            raise Refused("{device} is busy with another call of next_order", device=self.who)
        try:
            while True:
                self._stopped.clear()
                failure: DeviceError | None = None
                self._connected_service()
                if (order := self._outbox.order()) is None:
                    try:
                        order = self._request_order()
                    except (ConnectionLost, DeviceTimeout, NotConnected, DeviceFault) as e:
                        failure = e
                if order is not None:
                    return True, order.id, order.product, order.quantity, order.quantity - order.reported
                left = deadline - time.monotonic()
                if left > 0.0 and stops == self._stops:
                    self._stopped.wait(min(self._config.poll, left))
                if stops != self._stops:
                    raise Cancelled("{device}: waiting for an order was stopped", device=self.who)
                if left <= 0.0:
                    if failure is not None:
                        raise failure
                    return False, "", "", 0, 0
        finally:
            self._requesting_order.release()

    @action(serial="serial", order="order_id")
    def report_result(self, order_id: str, serial: str, passed: bool, note: str = "", *, an: str | None = None) -> None:
        """Store the result of one piece; the service receives it exactly once.

        The result is on disk when this returns. While the service is down, results wait and are delivered later,
        in the order in which they were reported.

        :param order_id: id of the order that the piece belongs to
        :param serial: identification of the piece, such as its code
        :param passed: whether the piece is good
        :param note: other information, such as measured values
        """
        self._check_text("order_id", order_id)
        self._check_text("serial", serial)
        self._check_text("note", note, empty=True)
        body = {"order": order_id, "serial": serial, "passed": bool(passed), "note": note}
        self._store("/results", order_id, body, piece=True)

    @action
    def close_order(self, order_id: str, reason: str, *, an: str | None = None) -> None:
        """End an order before all its pieces are reported. The service is notified after the results reported so far.

        :param order_id: id of the order
        :param reason: why it ends early
        """
        self._check_text("order_id", order_id)
        self._check_text("reason", reason)
        self._store("/orders/close", order_id, {"order": order_id, "reason": reason}, last=True)

    @action(again="safe")
    def results_waiting(self, *, an: str | None = None) -> int:
        """Return the number of results that the service has not received yet."""
        return self.outbox().value.waiting

    @action(deadline=MAX_WAIT + MARGIN)
    def wait_until_sent(self, timeout: float, *, an: str | None = None) -> None:
        """Wait until the service has received every result.

        :param timeout: time limit, s
        """
        assert 0.0 <= timeout <= 3600.0

        within(f"{self.who}: timeout", timeout, 0.0, MAX_WAIT, "s")
        stops, deadline = self._stops, time.monotonic() + timeout
        while (state := self.outbox().value).waiting:
            if stops != self._stops:
                raise Cancelled("{device}: waiting for the outbox was stopped", device=self.who)
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise DeviceTimeout(
                    "{device}: {waiting} results are still waiting after {timeout:g} s",
                    state.last_error,
                    device=self.who,
                    waiting=state.waiting,
                    timeout=timeout,
                )
            if (sender := self._sender) is not None:
                sender.wait_change(min(left, 0.2))

    @action
    def resend_refused(self, *, an: str | None = None) -> int:
        """Send the refused results again, after the cause was fixed at the service. Return their number."""
        count = self._outbox.resend_refused()
        self._wake()
        return count

    # -------------------------------------------------------------------------------- internals
    def _check_text(self, name: str, value: str, empty: bool = False) -> None:
        if not (value.strip() or empty) or len(value) > MAX_TEXT or not value.isprintable():
            raise OutOfRange(
                "{device}: {name} must be 1 to {longest_text} printable characters, not {value!r}",
                device=self.who,
                name=name,
                longest_text=MAX_TEXT,
                value=value,
            )

    def _store(
        self, path: str, order_id: str, content: dict[str, object], *, piece: bool = False, last: bool = False
    ) -> None:
        self._connected_service()
        body = msgspec.json.encode({**content, "finished": now(), "station": self._config.station})
        self._outbox.add(path, order_id, body, piece=piece, last=last)
        self._wake()

    def _wake(self) -> None:
        if (sender := self._sender) is not None:
            sender.wake()

    def _connected_service(self) -> Service:
        """Return the connection for actions; the service itself may be down. Raises NotConnected."""
        service = self._action_service
        if service is None:
            raise NotConnected("{device} is not connected", device=self.who)
        return service

    def _request_order(self) -> Order | None:
        """Request an order, with the key of the last request if that was not answered."""
        service, key, what = self._connected_service(), self._outbox.request_key(), "POST /orders/next"
        answer = service.request("POST", "/orders/next", key, msgspec.json.encode({"station": self._config.station}))
        try:
            service.check(answer, what)
        except Refused:
            if answer.status not in UNAUTHORIZED:
                self._outbox.end_request(None)
            raise
        received = service.read(answer, NextOrder, what)
        if received.key != key:
            raise DeviceFault(
                "{device} answered {what} with the key of another request",
                received.key[:80],
                "receipt",
                device=self.who,
                what=what,
            )
        data = received.order
        order = None if data is None else Order(data.id, data.product, data.quantity)
        if order is not None and not (order.id and order.product and 0 < order.quantity <= MAX_QUANTITY):
            self._outbox.end_request(None)
            raise DeviceFault("{device} sent an invalid order", str(order), "order", device=self.who)
        self._outbox.end_request(order)
        self.observing.settled()
        return order

    # -------------------------------------------------------------------------------- on the observing thread
    def open_link(self, timeout: float) -> None:
        """Read the status of the service; the sender of a former connection continues."""
        self._access = self._access if self._sender is not None else Access.of(self.who, self._config)
        assert self._access is not None
        self._status_service = Service(self.who, self._config, self._access)
        self._status_service.status(min(timeout, self._config.request_timeout))
        if (sender := self._sender) is not None:
            sender.wake(back=True)

    def watch(self, stopping: threading.Event) -> None:
        """Read the status periodically."""
        service = self._status_service
        assert service is not None
        while not stopping.wait(STATUS_PERIOD):
            try:
                service.status()
            except DeviceError:
                if not stopping.is_set():
                    raise

    def close_link(self) -> None:
        """Close the connection that reads the status."""
        service, self._status_service = self._status_service, None
        if service is not None:
            service.close()
