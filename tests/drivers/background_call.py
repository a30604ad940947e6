"""A call in a separate thread."""

import threading
import time
from collections.abc import Callable
from typing import Any

from arcor2_hw.testing.own_time import own_time


class BackgroundCall:
    """A call in its own thread, which ended at `ended_at` (monotonic, s)."""

    def __init__(self, call: Callable[..., Any], *arguments: Any, **options: Any) -> None:
        self._value: Any = None
        self._error: BaseException | None = None
        self.ended_at = 0.0

        def run() -> None:
            try:
                self._value = call(*arguments, **options)
            except BaseException as e:
                self._error = e
            self.ended_at = time.monotonic()

        self._thread = threading.Thread(target=run, daemon=True)
        self._thread.start()

    @property
    def over(self) -> bool:
        return not self._thread.is_alive()

    def outcome(self, within: float = 30.0) -> Any:
        """Return the result of the call, or its error."""
        began = own_time()
        while not self.over:
            self._thread.join(0.01)
            assert not began.is_past(within), f"still busy after {within} s"
        return self._value if self._error is None else self._error

    def result(self, within: float = 30.0) -> Any:
        outcome = self.outcome(within)
        if self._error is not None:
            raise self._error
        return outcome
