"""The sender: one thread that delivers the outbox, in order, each message until the service has said that it has it."""

import logging
import threading
import time
from typing import Final

from arcor2_hw.exceptions import Arcor2Error, DeviceError, DeviceFault

from .outbox import Message, Outbox
from .service import RETRIED, Answer, Receipt, Service

FIRST_PAUSE: Final = 0.2
"""Time after the first failure, s; doubled after each further one."""
BUSY: Final = (*RETRIED, 502, 503, 504)
"""Statuses that speak of the service as a whole, not of one message."""
DOORS: Final = (401, 403, 407)
"""Statuses that mean that we are not let in."""

log = logging.getLogger(__name__)


class Pause:
    """A time before which nothing is tried; longer after each failure."""

    def __init__(self, longest: float) -> None:
        self._longest, self._next = longest, FIRST_PAUSE
        self.until = 0.0

    def grow(self, at_least: float = 0.0) -> None:
        """Wait longer than last time, and as long as the service asked for."""
        self.until = time.monotonic() + max(self._next, at_least)
        self._next = min(2.0 * self._next, self._longest)


class Sender:
    """Delivers while it lives. Owns service and outbox: its thread closes them at its end."""

    def __init__(self, who: str, service: Service, outbox: Outbox, longest_pause: float) -> None:
        self._who, self._service, self._outbox = who, service, outbox
        self._longest = longest_pause
        self._all = Pause(longest_pause)
        self._orders: dict[str, Pause] = {}
        self._asked_to_wait = False
        self._wake = threading.Event()
        self._ending = False
        self._changed = threading.Condition()
        self.last_error = ""
        self.locked_out = ""
        self._thread = threading.Thread(target=self._run, name=f"outbox of {who}", daemon=True)

    def start(self) -> None:
        """Begin to deliver."""
        self._thread.start()

    def stop(self) -> None:
        """End soon: at once, or when the request under way has ended."""
        self._ending = True
        self._service.close()
        self._wake.set()
        with self._changed:
            self._changed.notify_all()

    def join(self, timeout: float) -> bool:
        """Wait for the end; tell whether it has come."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def wake(self, *, back: bool = False) -> None:
        """Tell of a new message; `back`: the service answers again, so that there is no reason to wait longer."""
        if back and not self._asked_to_wait:
            self._all = Pause(self._longest)
            self._orders = {}
        self._wake.set()

    def wait_change(self, timeout: float) -> None:
        """Return after the next attempt, or after `timeout` s."""
        with self._changed:
            if not self._ending:
                self._changed.wait(timeout)

    def tell_change(self) -> None:
        """Wake whoever waits for a change."""
        with self._changed:
            self._changed.notify_all()

    # -------------------------------------------------------------------------------- on the thread
    def _run(self) -> None:
        try:
            while not self._ending:
                self._wake.clear()
                try:
                    pause = self._round()
                except Arcor2Error as e:  # the storage: nothing is lost, and it is tried again
                    self._note(str(e))
                    self._all.grow()
                    pause = self._all.until - time.monotonic()
                self.tell_change()
                if not self._ending:
                    self._wake.wait(pause)
        finally:
            self._service.close()
            self._outbox.close()

    def _round(self) -> float | None:
        """Deliver what is due; give the seconds until something is, None when nothing waits."""
        while not self._ending:
            heads = self._outbox.heads()
            if not heads:
                return None
            present = time.monotonic()
            due = {head: max(self._all.until, self._held_back(head)) for head in heads}
            ready = [head for head in heads if due[head] <= present]
            if not ready:
                return max(min(due.values()) - present, 0.0)
            self._deliver(ready[0])
            self.tell_change()
        return None

    def _held_back(self, head: Message) -> float:
        pause = self._orders.get(head.order_id)
        return 0.0 if pause is None else pause.until

    def _deliver(self, message: Message) -> None:
        what = f"POST {message.path} of order {message.order_id}"
        self._asked_to_wait = False
        try:
            answer = self._service.request("POST", message.path, message.key, message.body)
            if answer.done:
                self._check_receipt(answer, message, what)
        except DeviceError as e:
            if not self._ending:
                self._note(f"{e} {e.detail}".strip())
                self._all.grow()
            return
        if answer.done:
            self._outbox.delivered(message)
            self._all = Pause(self._longest)
            self._orders.pop(message.order_id, None)
            self.last_error = self.locked_out = ""
            return
        text = f"{self._who} answered {what} by {answer.told}"
        if answer.status in DOORS or 300 <= answer.status < 400 or answer.status in BUSY:
            self.locked_out = text if answer.status in DOORS else ""
            self._asked_to_wait = answer.retry_after > 0.0
            self._all.grow(answer.retry_after)
        elif 400 <= answer.status < 500:
            log.warning("%s; it is kept aside", text)
            self._outbox.put_aside(message, answer.told)
            self._all = Pause(self._longest)
        else:
            self._orders.setdefault(message.order_id, Pause(self._longest)).grow(answer.retry_after)
        self._note(text)

    def _check_receipt(self, answer: Answer, message: Message, what: str) -> None:
        receipt: Receipt = self._service.read(answer, Receipt, what)
        if receipt.key != message.key:
            raise DeviceFault(
                "{device} answered {what} for another message", receipt.key[:80], "receipt", device=self._who, what=what
            )

    def _note(self, text: str) -> None:
        if not self.last_error:
            log.warning("%s: results wait: %s", self._who, text)
        self.last_error = text
