"""What the worker has at hand: robots' models that were read, and the collision world that it was told of."""

from collections.abc import Callable, Sequence

from arcor2_hw.compute.world import Body


class Desk:
    """Kept from one computation to the next. progress(share, message): tells how far the present one is."""

    def __init__(self, progress: Callable[[float, str], None]) -> None:
        self.progress = progress
        self.bodies: dict[str, Body] = {}

    def change(self, put: Sequence[Body], remove: Sequence[str]) -> None:
        """Change the world; nothing is read of it before a computation needs it."""
        for key in remove:
            self.bodies.pop(key, None)
        for body in put:
            self.bodies[body.id] = body
