"""What the server tells of the world beside the scene's objects: bodies that were put in, calibrations of arms."""

import threading
from collections.abc import Iterable

from arcor2_hw.data.robot import KinematicCalibration
from arcor2_hw.runtime.messages import PutIn


class Told:
    """Told on the reader's thread, looked at on those of robots."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._bodies: dict[str, PutIn] = {}
        self._calibrations: dict[str, KinematicCalibration] = {}

    def put(self, body: PutIn) -> None:
        """Take in a body, in place of one of its id."""
        with self._lock:
            self._bodies[body.id] = body

    def remove(self, ids: Iterable[str]) -> None:
        """Forget bodies."""
        with self._lock:
            for key in ids:
                self._bodies.pop(key, None)

    def calibrate(self, object_id: str, calibration: KinematicCalibration | None) -> None:
        """Take the calibration of a robot, None when it is nominal."""
        with self._lock:
            if calibration is None:
                self._calibrations.pop(object_id, None)
            else:
                self._calibrations[object_id] = calibration

    def bodies(self) -> dict[str, PutIn]:
        """Give the bodies as they are now, by id."""
        with self._lock:
            return dict(self._bodies)

    def calibration(self, object_id: str) -> KinematicCalibration | None:
        """Give what the controller of a robot told of its arm, None when that is not known."""
        with self._lock:
            return self._calibrations.get(object_id)
