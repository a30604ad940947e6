"""The difference between the monotonic clocks of two computers, from messages that they exchange.

Wall clocks are not used: they may be wrong by any amount, and may jump.
"""

from collections import deque
from typing import Final

WINDOW: Final = 10.0
"""Age up to which an exchange is used, s."""
DRIFT: Final = 5e-4
"""Largest relative difference between the rates of two monotonic clocks: NTP changes the rate by at most 500 ppm."""


class SessionClock:
    """Converts times of the peer's clock to times of this computer's clock.

    A message never arrives before it was sent. The peer reports when it received a message of this computer; this
    bounds the difference between the clocks. The bound is as good as the fastest message of the last seconds.
    """

    def __init__(self) -> None:
        self._lower: deque[tuple[float, float]] = deque()
        """Lower bounds of the difference (this clock minus the peer's), with their times on this clock, s."""

    @property
    def known(self) -> bool:
        """Whether a time can be converted."""
        return bool(self._lower)

    def exchanged(self, sent: float, arrived_at_peer: float, now: float) -> None:
        """Add the exchange of a message of this computer.

        Args:
            sent: when this computer sent the message, on its clock, s.
            arrived_at_peer: when the peer received it, on the peer's clock, s.
            now: time of this computer's clock, s.
        """
        bound = sent - arrived_at_peer
        while self._lower and self._lower[-1][0] <= bound:
            self._lower.pop()  # the new bound is better, and lasts longer
        self._lower.append((bound, now))
        while now - self._lower[0][1] > WINDOW and len(self._lower) > 1:
            self._lower.popleft()

    def earliest(self, moment: float, now: float) -> float:
        """Return the earliest possible time on this clock of a time of the peer's clock, s.

        A deadline that is converted like this expires early, by the round trip at most, and never late.

        Raises:
            LookupError: no exchange has been added.
        """
        if not self._lower:
            raise LookupError("no exchange with the peer has been completed")
        return moment + max(bound - DRIFT * (now - at) for bound, at in self._lower)
