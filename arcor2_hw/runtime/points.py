"""Reads the points of devices: inputs, outputs and registers, and the values that devices report otherwise."""

import enum
import inspect
import time
from collections.abc import Iterator
from functools import lru_cache
from typing import Any, Final

from msgspec.structs import replace

from arcor2_hw.actions.decorator import is_observation
from arcor2_hw.data.base import UNSET, Unset
from arcor2_hw.data.device import Connection, Quality, Reading
from arcor2_hw.data.points import LivePoint, PointQuality, PointUse, PointValue
from arcor2_hw.exceptions import Arcor2Error
from arcor2_hw.objects import Generic, IOBlock
from arcor2_hw.objects.small import HasPoints, live_point, quality_of
from arcor2_hw.runtime.device import Device
from arcor2_hw.runtime.methods import overrides

STALE_AFTER: Final = 1.0
"""Age from which a value is stale, s. Drivers poll their devices about ten times per second."""


class PointReader:
    """Reads all points of devices, and stores the last values for the time while a connection is lost."""

    def __init__(self) -> None:
        self._known: dict[str, tuple[float, dict[str, LivePoint]]] = {}

    def read(self, device: Device) -> list[LivePoint]:
        """Return all points of a device. Call it on its watch lane. Raises what the driver raises."""
        instance, cls, now = device.require(), device.recipe.cls, time.monotonic()
        then, known = self._known.get(device.id, (now, {}))
        if instance.connection not in (Connection.ONLINE, Connection.BACK):
            return [_not_connected(point, now - then) for point in list(known.values()) or _points(instance, cls)]
        points = [_aged(point) for point in _points(instance, cls)]
        points += _signals(instance, cls, {_plain(point.name) for point in points})
        self._known[device.id] = now, {point.name: point for point in points}
        return points


def _points(instance: Generic, cls: type[Generic]) -> list[LivePoint]:
    if not overrides(cls, "live_points") and isinstance(instance, HasPoints):
        return [live_point(point, instance.read) for point in instance.points()]
    return instance.live_points()


def _signals(instance: Generic, cls: type[Generic], known: set[str]) -> Iterator[LivePoint]:
    """Return what methods marked with `@observation`, and `observations`, report in addition to the points."""
    for name in _observations(cls):
        if _plain(name) not in known:
            known.add(_plain(name))
            yield _signal(instance, name)
    if not overrides(cls, "observations") or cls.observations is IOBlock.observations:  # which reports only points
        return
    try:
        reported = instance.observations()
    except Arcor2Error:  # the state of the device shows that
        return
    for each in reported:
        if _plain(each.name) not in known:
            yield LivePoint(each.name, PointUse.SIGNAL, each.value, each.unit, PointQuality(each.quality.value))


def _signal(instance: Generic, name: str) -> LivePoint:
    point = LivePoint(name, PointUse.SIGNAL)
    try:
        value: Any = getattr(instance, name)()
    except Arcor2Error as error:
        return replace(point, quality=quality_of(error))
    if not isinstance(value, Reading):
        return replace(point, value=_shown(value))
    bad = value.quality is Quality.BAD
    quality = PointQuality(value.quality.value)
    return _aged(replace(point, value=None if bad else _shown(value.value), quality=quality, age=round(value.age, 3)))


@lru_cache(maxsize=256)
def _observations(cls: type[Generic]) -> tuple[str, ...]:
    """Return the names of the methods that are observations without a parameter."""
    marked = (name for name, method in inspect.getmembers_static(cls) if is_observation(method))
    return tuple(name for name in marked if len(inspect.signature(getattr(cls, name)).parameters) == 1)


def _shown(value: Any) -> PointValue:
    value = value.value if isinstance(value, enum.Enum) else value
    return value if isinstance(value, bool | int | float | str) else str(value)


def _plain(name: str) -> str:
    """Return a name as it is compared: an observation `net_weight` is the value "Net weight"."""
    return name.casefold().replace("_", " ")


def _aged(point: LivePoint) -> LivePoint:
    old = not isinstance(point.age, Unset) and point.age > STALE_AFTER
    return replace(point, quality=PointQuality.STALE) if old and point.quality is PointQuality.GOOD else point


def _not_connected(point: LivePoint, older: float) -> LivePoint:
    age = UNSET if isinstance(point.age, Unset) else round(point.age + older, 3)
    return replace(point, quality=PointQuality.NOT_CONNECTED, age=age)
