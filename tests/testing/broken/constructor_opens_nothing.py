"""The constructor starts to observe."""

import threading
import weakref

from .toy_press import NOWHERE, ToyPress


class BrokenPress(ToyPress):
    """A press."""

    def __init__(self, obj_id: str, name: str, address: str = NOWHERE) -> None:
        super().__init__(obj_id, name, address)
        self._early = threading.Event()
        self._opened = threading.Thread(target=self._early.wait, name="early", daemon=True)
        self._opened.start()
        weakref.finalize(self, self._early.set)

    def disconnect(self) -> None:
        self._early.set()
        super().disconnect()
