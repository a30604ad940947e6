"""Conversion between SI units and the values 0 to 255 of the gripper."""

from arcor2_hw.objects.settings import within

from .settings import Robotiq2FSettings


def position(settings: Robotiq2FSettings, width: float) -> int:
    """Return the position for a width, m. Raise OutOfRange."""
    within("width", width, 0.0, settings.stroke, "m")
    span = settings.closed_position - settings.open_position
    return round(settings.closed_position - span * width / settings.stroke)


def width(settings: Robotiq2FSettings, position: int) -> float:
    """Return the width for a position, m, limited to the stroke, because the end positions vary a little."""
    span = settings.closed_position - settings.open_position
    return min(max((settings.closed_position - position) * settings.stroke / span, 0.0), settings.stroke)


def force(settings: Robotiq2FSettings, newtons: float) -> int:
    """Return the value for a force, N. Raise OutOfRange."""
    within("force", newtons, settings.min_force, settings.max_force, "N")
    return round(255.0 * (newtons - settings.min_force) / (settings.max_force - settings.min_force))


def speed(settings: Robotiq2FSettings, metres_per_second: float) -> int:
    """Return the value for a speed, m/s. Raise OutOfRange."""
    within("speed", metres_per_second, settings.min_speed, settings.max_speed, "m/s")
    return round(255.0 * (metres_per_second - settings.min_speed) / (settings.max_speed - settings.min_speed))
