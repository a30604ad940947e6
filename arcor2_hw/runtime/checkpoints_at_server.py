"""Checkpoints of a run whose host is on another computer than the server, which stores them."""

import time
from collections.abc import Callable
from queue import Empty, SimpleQueue
from typing import Final

from arcor2_hw.data.parts import PartInventory
from arcor2_hw.exceptions import StorageError
from arcor2_hw.runtime import messages as m

ANSWER_TIMEOUT: Final = 5.0
"""Time limit for the server to store a checkpoint, s; its disk may be busy."""


class CheckpointsAtServer:
    """Reads and stores the checkpoints of a run by messages, each of which waits for its answer.

    One thread at a time may read or write, but not the thread that receives the messages of the server.

    Args:
        post: sends a message to the server.
    """

    def __init__(self, post: Callable[[m.ToServer], None]) -> None:
        self._post = post
        self._number = 0
        self._answers: SimpleQueue[m.CheckpointAnswer | None] = SimpleQueue()
        self._lost = False

    def write(self, inventory: PartInventory) -> None:
        """Store a checkpoint. It is on the disk of the server when this returns. Raises StorageError."""
        self._request(lambda number: m.StoreCheckpoint(number, inventory))

    def read(self) -> PartInventory | None:
        """Return the newest checkpoint, None if there is none. Raises StorageError."""
        return self._request(m.ReadCheckpoint).inventory

    def close(self) -> None:
        """Do nothing: the server closes its files."""

    def _request(self, message: Callable[[int], m.ToServer]) -> m.CheckpointAnswer:
        self._number += 1
        self._post(message(self._number))
        limit = time.monotonic() + ANSWER_TIMEOUT
        while not self._lost:
            try:
                answer = self._answers.get(timeout=max(0.0, limit - time.monotonic()))
            except Empty:
                raise StorageError("The state of the run cannot be stored: the server does not answer.") from None
            if answer is not None and answer.number == self._number:  # other answers are late ones
                if answer.problem is not None:
                    raise StorageError(answer.problem)
                return answer
        raise StorageError("The state of the run cannot be stored: the connection to the server was lost.")

    # -------------------------------------------------------------------------------- thread that receives messages
    def answered(self, answer: m.CheckpointAnswer) -> None:
        """Handle an answer of the server."""
        self._answers.put(answer)

    def abandon(self) -> None:
        """Handle the end of the connection to the server: waiting and later calls fail."""
        self._lost = True
        self._answers.put(None)
