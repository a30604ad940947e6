"""A production planning service as an object type: orders are asked for, results go out by a stored outbox."""

import threading
import time
from datetime import UTC, datetime, timedelta
from typing import ClassVar, Final

import msgspec

from arcor2_hw.actions import action
from arcor2_hw.data.base import now
from arcor2_hw.data.device import Alarm, Connection, Health, Identity, LossReaction, Reading, Severity
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
from arcor2_hw.objects import Generic
from arcor2_hw.objects.generic import DEFAULT_CONNECT_TIMEOUT
from arcor2_hw.objects.observing import Observing

from .outbox import Aside, Order, Outbox, OutboxState, file_of
from .sender import Sender
from .service import Access, Service, ToldNext
from .settings import ErpSettings

STATUS_PERIOD: Final = 1.0
"""Time between looks at the service, s."""
ENDS_WITHIN: Final = 0.05
"""s disconnect waits for the sender; a request under way may take longer, and ends by itself."""
LONGEST_WAIT: Final = 3600.0
MARGIN: Final = 65.0
"""Time beyond it, s: two requests."""
LONGEST_TEXT: Final = 200
LARGEST_QUANTITY: Final = 1_000_000
WAITING, REFUSED, LOCKED_OUT = "results_wait", "results_refused", "not_let_in"


class ErpService(Generic):
    """A production planning service (ERP): orders in, results out, each exactly once."""

    _ABSTRACT = False
    category = "Services"
    icon = "service"
    loss_reaction: ClassVar[LossReaction] = LossReaction.continues()  # it plans for others too
    loss_ends_program: ClassVar[bool] = False  # results wait in the outbox; production goes on
    CANCEL_MAPPING: ClassVar[dict[str, str]] = {"next_order": "stop", "wait_until_sent": "stop"}

    def __init__(self, obj_id: str, name: str, settings: ErpSettings) -> None:
        super().__init__(obj_id, name, settings)
        self._given = settings
        self._who = f"{name} at {settings.url}"
        self._outbox = Outbox(self._who, file_of(settings.outbox, settings.station, settings.url))
        self.observing = Observing(self._who, self._open, self._watch, self._close)
        self._life = threading.Lock()
        self._asking = threading.Lock()
        self._stopped = threading.Event()
        self._stops = 0
        self._access: Access | None = None
        self._watcher: Service | None = None  # one connection each: the observer's, the callers', the sender's
        self._caller: Service | None = None
        self._sender: Sender | None = None
        self._former: Sender | None = None

    # -------------------------------------------------------------------------------- connection
    def connect(self, timeout: float = DEFAULT_CONNECT_TIMEOUT) -> None:
        """Ask the service who it is within `timeout` s, and begin to deliver what waits in the outbox.

        Raises NotConnected naming the URL or a file of the settings, DeviceTimeout, Refused when the service does not
        let us in or the outbox is open in another program, StorageError for an outbox that cannot be written.
        """
        with self._life:
            deadline = time.monotonic() + timeout
            if self._sender is not None:
                self.observing.start(timeout)
                return
            if self._former is not None and not self._former.join(timeout):
                raise DeviceTimeout("the last connection to {device} is still being closed", device=self._who)
            self._former = None
            self.observing.start(max(deadline - time.monotonic(), 0.001))
            try:
                self._begin(deadline)
            except BaseException:
                self.observing.stop()
                raise

    def _begin(self, deadline: float) -> None:
        assert self._access is not None
        self._outbox.open(deadline - time.monotonic())
        self._caller = Service(self._who, self._given, self._access)
        service = Service(self._who, self._given, self._access)
        self._sender = Sender(self._who, service, self._outbox, self._given.longest_pause)
        self._sender.start()

    def disconnect(self) -> None:
        """Stop delivering and close; does nothing when closed. What waits is kept on disk for the next time."""
        with self._life:
            self.stop()
            sender, self._sender = self._sender, None
            caller, self._caller = self._caller, None
            if caller is not None:
                caller.close()
            if sender is not None:
                sender.stop()
            self.observing.stop()
            if sender is not None:
                self._former = None if sender.join(ENDS_WITHIN) else sender

    @property
    def connection(self) -> Connection:
        """Return the state of the connection."""
        return self.observing.state

    @property
    def health(self) -> Health:
        """Return failure while the service does not answer, check_function while an alarm stands."""
        if self.connection in (Connection.LOST, Connection.FAILED):
            return Health.FAILURE
        return Health.CHECK_FUNCTION if self.alarms() else Health.NORMAL

    def identify(self) -> Identity:
        """Ask the service who it is."""
        self.observing.check()
        status = self._connected().status()
        return Identity("", status.service, "", status.version)

    def alarms(self) -> list[Alarm]:
        """Return what a person should deal with: results that wait too long or were refused, a token not taken."""
        sender = self._sender
        if sender is None:
            return []
        found = []
        state = self._outbox.state(sender.last_error)
        if state.since is not None:
            due = datetime.fromisoformat(state.since) + timedelta(seconds=self._given.waiting_alarm)
            if datetime.now(UTC) >= due:
                text = f"{state.waiting} results have waited since {state.since}: {state.last_error or 'being sent'}"
                remedy = "see that the service runs and can be reached; nothing is lost, and nothing has to be repeated"
                found.append(Alarm(WAITING, Severity.WARNING, text, remedy, due.isoformat(timespec="microseconds")))
            if sender.locked_out:
                remedy = "renew token_file or client_certificate, then connect again"
                found.append(Alarm(LOCKED_OUT, Severity.ERROR, sender.locked_out, remedy, state.since))
        if aside := self._outbox.aside():
            first = aside[0]
            text = f"the service refused {len(aside)} results, the first of order {first.order_id}: {first.why}"
            remedy = "correct it at the service and resend_refused, or acknowledge: then it is kept but not sent"
            found.append(Alarm(REFUSED, Severity.ERROR, text, remedy, first.since))
        return found

    def acknowledge(self, code: str) -> None:
        """Take note of refused results (code results_refused): they stay in the file and are not sent.

        Raises NotFound for another code: those alarms end with their cause.
        """
        if code != REFUSED or not self._outbox.note_aside():
            raise NotFound("{device} has no alarm {code!r} to be acknowledged", device=self._who, code=code)

    # -------------------------------------------------------------------------------- the outbox
    def outbox(self) -> Reading[OutboxState]:
        """Return how many results wait, since when, what the last failure was, and how many were refused."""
        sender = self._sender
        if sender is None:
            raise NotConnected("{device} is not connected", device=self._who)
        return Reading.of(self._outbox.state(sender.last_error))

    def refused(self) -> list[Aside]:
        """Return the results that the service refused, with its reasons."""
        return self._outbox.aside()

    def stop(self) -> None:
        """End what waits here, with Cancelled. What is stored is delivered all the same."""
        self._stops += 1
        self._stopped.set()
        if (sender := self._sender) is not None:
            sender.tell_change()

    # -------------------------------------------------------------------------------- actions
    @action(deadline=LONGEST_WAIT + MARGIN)
    def next_order(self, wait: float = 0.0, *, an: str | None = None) -> tuple[bool, str, str, int, int]:
        """Return the order to work on: whether there is one, its id, product, quantity, and pieces to be reported.

        It stays the same order, with the service down too, until a result was reported for each piece or it was closed.
        Then the next one is asked for. An order is never taken twice, nor lost when its answer was.

        :param wait: how long to wait for an order, s; when there is none then, the first result is false
        """
        assert 0.0 <= wait <= 3600.0

        self._in_range("wait", wait)
        stops, deadline = self._stops, time.monotonic() + wait
        if not self._asking.acquire(blocking=False):
            raise Refused("{device} is busy with another call of next_order", device=self._who)
        try:
            while True:
                self._stopped.clear()
                failure: DeviceError | None = None
                self._connected()
                if (order := self._outbox.order()) is None:
                    try:
                        order = self._ask_order()
                    except (ConnectionLost, DeviceTimeout, NotConnected, DeviceFault) as e:
                        failure = e
                if order is not None:
                    return True, order.id, order.product, order.quantity, order.quantity - order.reported
                left = deadline - time.monotonic()
                if left > 0.0 and stops == self._stops:
                    self._stopped.wait(min(self._given.poll, left))
                if stops != self._stops:
                    raise Cancelled("{device}: waiting for an order was stopped", device=self._who)
                if left <= 0.0:
                    if failure is not None:
                        raise failure
                    return False, "", "", 0, 0
        finally:
            self._asking.release()

    @action
    def report_result(self, order_id: str, serial: str, passed: bool, note: str = "", *, an: str | None = None) -> None:
        """Store the result of one piece; it is on disk when this returns, and reaches the service exactly once.

        Works with the service down too: results are delivered when it is back, those of an order in their order.

        :param order_id: id of the order that the piece belongs to
        :param serial: what tells the piece from others, such as its code
        :param passed: whether the piece is good
        :param note: anything else, such as what was measured
        """
        self._text("order_id", order_id)
        self._text("serial", serial)
        self._text("note", note, empty=True)
        body = {"order": order_id, "serial": serial, "passed": bool(passed), "note": note}
        self._store("/results", order_id, body, piece=True)

    @action
    def close_order(self, order_id: str, reason: str, *, an: str | None = None) -> None:
        """End an order before all its pieces are reported; the service is told after the results that it has so far.

        :param order_id: id of the order
        :param reason: why it ends early
        """
        self._text("order_id", order_id)
        self._text("reason", reason)
        self._store("/orders/close", order_id, {"order": order_id, "reason": reason}, last=True)

    @action
    def results_waiting(self, *, an: str | None = None) -> int:
        """Return how many results the service does not have yet."""
        return self.outbox().value.waiting

    @action(deadline=LONGEST_WAIT + MARGIN)
    def wait_until_sent(self, timeout: float, *, an: str | None = None) -> None:
        """Wait until the service has every result.

        Raises DeviceTimeout naming how many wait and why.

        :param timeout: how long at most, s
        """
        assert 0.0 <= timeout <= 3600.0

        self._in_range("timeout", timeout)
        stops, deadline = self._stops, time.monotonic() + timeout
        while (state := self.outbox().value).waiting:
            if stops != self._stops:
                raise Cancelled("{device}: waiting for the outbox was stopped", device=self._who)
            left = deadline - time.monotonic()
            if left <= 0.0:
                raise DeviceTimeout(
                    "{device}: {waiting} results still wait after {timeout:g} s",
                    state.last_error,
                    device=self._who,
                    waiting=state.waiting,
                    timeout=timeout,
                )
            if (sender := self._sender) is not None:
                sender.wait_change(min(left, 0.2))

    @action
    def resend_refused(self, *, an: str | None = None) -> int:
        """Send the refused results again, once the reason is mended at the service; give how many."""
        count = self._outbox.send_aside_again()
        self._wake()
        return count

    # -------------------------------------------------------------------------------- behind them
    def _in_range(self, name: str, value: float) -> None:
        if not 0.0 <= value <= LONGEST_WAIT:
            raise OutOfRange(
                "{device}: {name} must be 0 to {longest_wait:g} s, not {value!r}",
                device=self._who,
                name=name,
                longest_wait=LONGEST_WAIT,
                value=value,
            )

    def _text(self, name: str, value: str, empty: bool = False) -> None:
        if not (value.strip() or empty) or len(value) > LONGEST_TEXT or not value.isprintable():
            raise OutOfRange(
                "{device}: {name} must be 1 to {longest_text} printable characters, not {value!r}",
                device=self._who,
                name=name,
                longest_text=LONGEST_TEXT,
                value=value,
            )

    def _store(
        self, path: str, order_id: str, what: dict[str, object], *, piece: bool = False, last: bool = False
    ) -> None:
        self._connected()
        body = msgspec.json.encode({**what, "finished": now(), "station": self._given.station})
        self._outbox.add(path, order_id, body, piece=piece, last=last)
        self._wake()

    def _wake(self) -> None:
        if (sender := self._sender) is not None:
            sender.wake()

    def _connected(self) -> Service:
        """Return the callers' connection; the service itself may be down. Raises NotConnected."""
        service = self._caller
        if service is None:
            raise NotConnected("{device} is not connected", device=self._who)
        return service

    def _ask_order(self) -> Order | None:
        """Ask for an order, with the key of the last question if that was never answered."""
        service, key, what = self._connected(), self._outbox.asking(), "POST /orders/next"
        answer = service.request("POST", "/orders/next", key, msgspec.json.encode({"station": self._given.station}))
        try:
            service.check(answer, what)
        except Refused:
            if answer.status not in (401, 403, 407):
                self._outbox.answered(None)  # a definite answer: the next question is another one
            raise
        told: ToldNext = service.read(answer, ToldNext, what)
        if told.key != key:
            raise DeviceFault(
                "{device} answered {what} for another question", told.key[:80], "receipt", device=self._who, what=what
            )
        order = None if told.order is None else Order(told.order.id, told.order.product, told.order.quantity)
        if order is not None and not (order.id and order.product and 0 < order.quantity <= LARGEST_QUANTITY):
            self._outbox.answered(None)
            raise DeviceFault("{device} gave an order that makes no sense", str(order), "order", device=self._who)
        self._outbox.answered(order)
        self.observing.settled()
        return order

    # -------------------------------------------------------------------------------- on the observing thread
    def _open(self, timeout: float) -> None:
        self._access = self._access if self._sender is not None else Access.of(self._who, self._given)
        assert self._access is not None
        self._watcher = Service(self._who, self._given, self._access)
        self._watcher.status(min(timeout, self._given.request_timeout))
        if (sender := self._sender) is not None:
            sender.wake(back=True)

    def _watch(self, stopping: threading.Event) -> None:
        watcher = self._watcher
        assert watcher is not None
        while not stopping.wait(STATUS_PERIOD):
            try:
                watcher.status()
            except DeviceError:
                if not stopping.is_set():
                    raise

    def _close(self) -> None:
        watcher, self._watcher = self._watcher, None
        if watcher is not None:
            watcher.close()
