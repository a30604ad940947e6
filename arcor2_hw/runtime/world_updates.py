"""Updates of the world from the server: added bodies and kinematic calibrations of robots."""

import threading
from collections.abc import Iterable

from arcor2_hw.data.robot import KinematicCalibration
from arcor2_hw.runtime.messages import AddedBody


class WorldUpdates:
    """Store added bodies and calibrations. The reader thread writes them, the threads of robots read them."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._bodies: dict[str, AddedBody] = {}
        self._calibrations: dict[str, KinematicCalibration] = {}
        self.zones: frozenset[str] = frozenset()
        """Collision bodies that are zones of interlocks, and therefore no obstacles."""

    def put(self, body: AddedBody) -> None:
        """Add a body, replacing one of the same id."""
        with self._lock:
            self._bodies[body.id] = body

    def remove(self, ids: Iterable[str]) -> None:
        """Remove bodies."""
        with self._lock:
            for key in ids:
                self._bodies.pop(key, None)

    def calibrate(self, object_id: str, calibration: KinematicCalibration | None) -> None:
        """Set the calibration of a robot; None for nominal kinematics."""
        with self._lock:
            if calibration is None:
                self._calibrations.pop(object_id, None)
            else:
                self._calibrations[object_id] = calibration

    def bodies(self) -> dict[str, AddedBody]:
        """Return the added bodies by id."""
        with self._lock:
            return dict(self._bodies)

    def calibration(self, object_id: str) -> KinematicCalibration | None:
        """Return the kinematic calibration of a robot, or None for nominal kinematics."""
        with self._lock:
            return self._calibrations.get(object_id)
