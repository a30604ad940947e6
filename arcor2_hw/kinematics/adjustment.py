"""Adjustment of a URDF description to the settings of an object, or to the calibration of one robot."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

from arcor2_hw.data.geometry import Orientation
from arcor2_hw.kinematics.description import ORIGIN, Description, Geometry, Joint, Primitive, Setting
from arcor2_hw.kinematics.errors import ModelError, ZeroLength
from arcor2_hw.kinematics.shapes import Array

_TINY: Final = 1e-6


def with_settings(description: Description, values: Mapping[str, object]) -> Description:
    """Apply settings that the description declares; other settings are ignored.

    Args:
        description: The description.
        values: Settings of the object by name.

    Raises:
        ModelError: A value is not a finite number, or the limits of a joint would cross.
        ZeroLength: A link to be scaled has no length in the description.
    """
    joints = {joint.name: joint for joint in description.joints}
    links = dict(description.links)
    for setting in description.settings:
        if setting.name not in values:
            continue
        value = _number(description, setting, values[setting.name])
        if setting.target == "joint":
            joints[setting.of] = _adjusted(description, joints[setting.of], setting.component, value)
        else:
            ratio = value / _nominal(description, setting)
            link = links[setting.of]
            visual, collision = (
                tuple(_stretched(each, ORIGIN.index(setting.component), ratio) for each in every)
                for every in (link.visual, link.collision)
            )
            links[setting.of] = replace(link, visual=visual, collision=collision)
    return replace(description, links=links, joints=tuple(joints.values()))


def with_origins(description: Description, origins: Mapping[str, Array]) -> Description:
    """Replace the origins of joints in their parent links.

    Args:
        description: The description.
        origins: Origin (4, 4) by joint name, from a calibration.

    Raises:
        ModelError: The joint does not exist.
    """
    if unknown := origins.keys() - {joint.name for joint in description.joints}:
        raise ModelError("{name} has no joint {unknown}.", name=description.name, unknown=", ".join(sorted(unknown)))
    moved = (replace(joint, origin=origins.get(joint.name, joint.origin)) for joint in description.joints)
    return replace(description, joints=tuple(moved))


def _number(description: Description, setting: Setting, value: object) -> float:
    if isinstance(value, bool) or not isinstance(value, int | float) or not np.isfinite(value):
        raise ModelError(
            "{name}: {setting_name} must be a finite number, not {value!r}.",
            name=description.name,
            setting_name=setting.name,
            value=value,
        )
    return float(value)


def _adjusted(description: Description, joint: Joint, component: str, value: float) -> Joint:
    if component == "velocity":
        return replace(joint, velocity=value)
    if component in ("lower", "upper"):
        lower, upper = (value, joint.upper) if component == "lower" else (joint.lower, value)
        if lower > upper and component == "upper":  # a new lower limit has been set before
            raise ModelError(
                "{name}: the limits of {joint_name} cross: {lower:g} to {upper:g}.",
                name=description.name,
                joint_name=joint.name,
                lower=lower,
                upper=upper,
            )
        return replace(joint, lower=lower, upper=upper)
    at = ORIGIN.index(component)
    origin = joint.origin.copy()
    if at < 3:
        origin[at, 3] = value
    else:
        vector = [*Orientation.from_matrix(origin[:3, :3]).rotation_vector()]
        vector[at - 3] = value
        origin[:3, :3] = Orientation.from_rotation_vector(*vector).matrix()
    return replace(joint, origin=origin)


def _nominal(description: Description, setting: Setting) -> float:
    """Return the nominal value of a setting that scales a link: the origin of the joint that follows it too."""
    for other in description.settings:
        if other.target == "joint" and other.name == setting.name and other.component in ORIGIN[:3]:
            joint = next(joint for joint in description.joints if joint.name == other.of)
            value = float(joint.origin[ORIGIN.index(other.component), 3])
            if abs(value) < _TINY:
                raise ZeroLength(
                    "{name}: {setting_name} is zero, so {of} has no length.",
                    name=description.name,
                    setting_name=setting.name,
                    of=setting.of,
                )
            return value
    raise ModelError(
        "{name}: {of} cannot follow {setting_name}, because no joint does.",
        name=description.name,
        of=setting.of,
        setting_name=setting.name,
    )


def _stretched(geometry: Geometry, axis: int, ratio: float) -> Geometry:
    if not isinstance(geometry.what, Primitive) or geometry.what.kind != "box":
        return geometry
    origin = geometry.origin.copy()
    origin[axis, 3] *= ratio
    sizes = tuple(size * (ratio if at == axis else 1.0) for at, size in enumerate(geometry.what.sizes))
    return replace(geometry, what=Primitive("box", sizes), origin=origin)
