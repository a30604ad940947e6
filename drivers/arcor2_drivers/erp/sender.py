"""Sender: a thread that delivers the messages of the outbox. It repeats each until the service confirms it."""

import logging
import threading
import time
from typing import Final

from arcor2_hw import messages
from arcor2_hw.exceptions import Arcor2Error, DeviceError, DeviceFault

from .outbox import Message, Outbox
from .service import RETRIED, UNAUTHORIZED, Answer, Receipt, Service

FIRST_PAUSE: Final = 0.2
"""Pause after the first failure, s; it doubles after each further one."""
UNAVAILABLE: Final = (*RETRIED, 502, 503, 504)
"""HTTP statuses that concern the whole service, not one message."""

log = logging.getLogger(__name__)


class Pause:
    """A pause between attempts that grows with each failure."""

    def __init__(self, longest: float) -> None:
        self._longest, self._next = longest, FIRST_PAUSE
        self.until = 0.0

    def grow(self, at_least: float = 0.0) -> None:
        """Start a pause that is longer than the last one, and at least `at_least` s long."""
        self.until = time.monotonic() + max(self._next, at_least)
        self._next = min(2.0 * self._next, self._longest)


class Sender:
    """Delivers messages until `stop`. Its thread closes service and outbox at its end."""

    def __init__(self, who: str | messages.Message, service: Service, outbox: Outbox, longest_pause: float) -> None:
        self._who, self._service, self._outbox = who, service, outbox
        self._longest = longest_pause
        self._service_pause = Pause(longest_pause)
        self._order_pauses: dict[str, Pause] = {}
        self._has_retry_after = False
        self._wake = threading.Event()
        self._ending = False
        self._changed = threading.Condition()
        self.last_error = ""
        """Why the last delivery failed; empty after a success."""
        self.unauthorized = ""
        """How the service rejected our credentials; empty when it accepts them."""
        self._thread = threading.Thread(target=self._run, name=f"outbox of {who}", daemon=True)

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def stop(self) -> None:
        """Request the end of the thread, which ends after its present request."""
        self._ending = True
        self._service.close()
        self._wake.set()
        self.notify()

    def join(self, timeout: float) -> bool:
        """Wait at most `timeout` s for the end of the thread. Return whether it has ended."""
        self._thread.join(timeout)
        return not self._thread.is_alive()

    def wake(self, *, back: bool = False) -> None:
        """Check for messages to deliver now. `back`: the service answers again, so pauses end."""
        if back and not self._has_retry_after:
            self._service_pause = Pause(self._longest)
            self._order_pauses = {}
        self._wake.set()

    def wait_change(self, timeout: float) -> None:
        """Wait for the next attempt, at most `timeout` s."""
        with self._changed:
            if not self._ending:
                self._changed.wait(timeout)

    def notify(self) -> None:
        """End the calls of `wait_change`."""
        with self._changed:
            self._changed.notify_all()

    # -------------------------------------------------------------------------------- on the thread
    def _run(self) -> None:
        try:
            while not self._ending:
                self._wake.clear()
                try:
                    pause = self._round()
                except Arcor2Error as e:  # storage error: the message stays in the outbox and is sent again
                    self._report(str(e))
                    self._service_pause.grow()
                    pause = self._service_pause.until - time.monotonic()
                self.notify()
                if not self._ending:
                    self._wake.wait(pause)
        finally:
            self._service.close()
            self._outbox.close()

    def _round(self) -> float | None:
        """Deliver the messages that are due. Return the time until the next is due, s; None when none waits."""
        while not self._ending:
            heads = self._outbox.heads()
            if not heads:
                return None
            present = time.monotonic()
            due = {head: max(self._service_pause.until, self._paused_until(head)) for head in heads}
            ready = [head for head in heads if due[head] <= present]
            if not ready:
                return max(min(due.values()) - present, 0.0)
            self._deliver(ready[0])
            self.notify()
        return None

    def _paused_until(self, head: Message) -> float:
        pause = self._order_pauses.get(head.order_id)
        return 0.0 if pause is None else pause.until

    def _deliver(self, message: Message) -> None:
        what = f"POST {message.path} for order {message.order_id}"
        self._has_retry_after = False
        try:
            answer = self._service.request("POST", message.path, message.key, message.body)
            if answer.done:
                self._check_receipt(answer, message, what)
        except DeviceError as e:
            if not self._ending:
                self._report(f"{e} {e.detail}".strip())
                self._service_pause.grow()
            return
        if answer.done:
            self._outbox.delivered(message)
            self._service_pause = Pause(self._longest)
            self._order_pauses.pop(message.order_id, None)
            self.last_error = self.unauthorized = ""
            return
        text = f"{self._who} answered {what} with {answer.text}"
        if answer.status in (*UNAUTHORIZED, *UNAVAILABLE) or 300 <= answer.status < 400:
            self.unauthorized = text if answer.status in UNAUTHORIZED else ""
            self._has_retry_after = answer.retry_after > 0.0
            self._service_pause.grow(answer.retry_after)
        elif 400 <= answer.status < 500:
            log.warning("%s; it is not sent again until the user requests it", text)
            self._outbox.mark_refused(message, answer.text)
            self._service_pause = Pause(self._longest)
        else:
            self._order_pauses.setdefault(message.order_id, Pause(self._longest)).grow(answer.retry_after)
        self._report(text)

    def _check_receipt(self, answer: Answer, message: Message, operation: str) -> None:
        receipt: Receipt = self._service.read(answer, Receipt, operation)
        if receipt.key != message.key:
            raise DeviceFault(
                "{device} confirmed {what} with the key of another message",
                receipt.key[:80],
                "receipt",
                device=self._who,
                what=operation,
            )

    def _report(self, text: str) -> None:
        if not self.last_error:
            log.warning("%s: results are waiting for delivery: %s", self._who, text)
        self.last_error = text
