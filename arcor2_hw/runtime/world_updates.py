"""What the server sends about the world next to the scene's objects: added bodies, and calibrations of robots."""

import threading
from collections.abc import Iterable

from arcor2_hw.data.robot import KinematicCalibration
from arcor2_hw.runtime.messages import PutIn


class WorldUpdates:
    """Written on the reader's thread, read on the threads of robots."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._bodies: dict[str, PutIn] = {}
        self._calibrations: dict[str, KinematicCalibration] = {}

    def put(self, body: PutIn) -> None:
        """Add a body, replacing one of the same id."""
        with self._lock:
            self._bodies[body.id] = body

    def remove(self, ids: Iterable[str]) -> None:
        """Remove bodies."""
        with self._lock:
            for key in ids:
                self._bodies.pop(key, None)

    def calibrate(self, object_id: str, calibration: KinematicCalibration | None) -> None:
        """Set the calibration of a robot; None when its kinematics are nominal."""
        with self._lock:
            if calibration is None:
                self._calibrations.pop(object_id, None)
            else:
                self._calibrations[object_id] = calibration

    def bodies(self) -> dict[str, PutIn]:
        """Return the current bodies, by id."""
        with self._lock:
            return dict(self._bodies)

    def calibration(self, object_id: str) -> KinematicCalibration | None:
        """Return the kinematic calibration that the controller of a robot reported; None when it is unknown."""
        with self._lock:
            return self._calibrations.get(object_id)
