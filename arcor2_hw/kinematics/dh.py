"""Denavit-Hartenberg parameters: a controller's calibration of one arm, put into a model made from nominal ones.

Rows are of the classic convention, as robots' makers publish them: rotate by theta about z, move by d along z, by a
along x, rotate by alpha about x. Of axes that are nearly parallel, d may come out as metres in either direction, with
the next row leading back; so joints are not put where the rows' frames are, but onto the same axes, as near as can be
to where the model has them. The links' shapes stay in their places, and the tip goes exactly where the rows say.
"""

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from arcor2_hw.data.robot import KinematicCalibration
from arcor2_hw.kinematics.errors import ModelError
from arcor2_hw.kinematics.model import RobotModel
from arcor2_hw.kinematics.shapes import Array

FARTHEST: Final = 0.05
"""m, and rad, by which a calibration may move a joint's axis: what is more is the calibration of another arm."""


class DhRow(NamedTuple):
    """One joint: theta, alpha in rad, d, a in m. `plus` adds the differences that some makers give instead."""

    theta: float
    d: float
    a: float
    alpha: float

    def plus(self, delta: "DhRow") -> "DhRow":
        """Give this row with differences added."""
        return DhRow(*(one + other for one, other in zip(self, delta, strict=True)))

    def matrix(self, q: float = 0.0) -> Array:
        """Give the transform of the row for a joint value, (4, 4)."""
        ct, st = math.cos(self.theta + q), math.sin(self.theta + q)
        ca, sa = math.cos(self.alpha), math.sin(self.alpha)
        return np.array(
            (
                (ct, -st * ca, st * sa, self.a * ct),
                (st, ct * ca, -ct * sa, self.a * st),
                (0.0, sa, ca, self.d),
                (0.0, 0.0, 0.0, 1.0),
            )
        )


def rows_of(calibration: KinematicCalibration) -> list[DhRow]:
    """Give the rows of what a controller told of its arm."""
    return [DhRow(each.theta, each.d, each.a, each.alpha) for each in calibration.joints]


def chain(rows: Sequence[DhRow], q: Sequence[float] | Array) -> Array:
    """Give the end of a chain of rows for joint values, (4, 4)."""
    at = np.eye(4)
    for row, value in zip(rows, q, strict=True):
        at = at @ row.matrix(float(value))
    return at


def calibrated(model: RobotModel, end_effector: str, rows: Sequence[DhRow]) -> RobotModel:
    """Give the model of the very arm that these rows describe; they begin in the frame of the chain's first joint.

    The end of the rows is the link that is fixed to the last joint's. Raises ModelError unless the chain has as many
    joints, all turning about their z axes, and the rows are near to it: 50 mm and 0.05 rad.
    """
    arm = model.arm(end_effector)
    moving = [step for step in arm.steps if step.axis is not None]
    if len(moving) != len(rows) or any(step.prismatic or not np.allclose(step.axis, (0, 0, 1)) for step in moving):  # type: ignore[arg-type]
        raise ModelError(f"{model.name} is not described by {len(rows)} DH rows: its joints are of another kind.")
    if not np.isfinite(rows).all():
        raise ModelError(f"The calibration for {model.name} has numbers that are not finite.")
    names = [step.name for step in arm.steps]
    first, last = names.index(moving[0].name), names.index(moving[-1].name)
    if len(moving) != last - first + 1 or last + 1 == len(names):
        raise ModelError(f"{model.name} is not described by DH rows: there are fixed joints between its joints.")
    origins: dict[str, Array] = {}
    nominal, before, at = np.eye(4), np.eye(4), np.eye(4)
    for number, step in enumerate(moving):
        if number:
            nominal = nominal @ step.origin
            at = at @ rows[number - 1].matrix()
        placed = _onto(at, nominal, f"{model.name}: {step.name}")
        origins[step.name] = (moving[0].origin if number == 0 else np.eye(4)) @ np.linalg.inv(before) @ placed
        before = placed
    end = at @ rows[-1].matrix()
    if np.abs(end - nominal @ arm.steps[last + 1].origin).max() > FARTHEST:
        raise ModelError(f"The calibration is not one of {model.name}: its end is elsewhere by more than 50 mm.")
    origins[names[last + 1]] = np.linalg.inv(before) @ end
    return model.with_origins(origins)


def of_very_arm(nominal: RobotModel, calibration: KinematicCalibration) -> RobotModel:
    """Give the model of the very arm whose controller told the calibration. Raises ModelError when it is of another."""
    if not nominal.end_effectors:
        raise ModelError(f"{nominal.name} has no end effector, and so no arm that a calibration could be of.")
    # Those of one arm share its joints.
    return calibrated(nominal, next(iter(nominal.end_effectors)), rows_of(calibration))


def _onto(axis_frame: Array, nominal: Array, what: str) -> Array:
    """Give the frame on the z axis of `axis_frame` that is nearest to a nominal one."""
    z, at = axis_frame[:3, 2], axis_frame[:3, 3]
    origin = at + z * float(z @ (nominal[:3, 3] - at))
    if np.linalg.norm(origin - nominal[:3, 3]) > FARTHEST or np.linalg.norm(z - nominal[:3, 2]) > FARTHEST:
        raise ModelError(f"The calibration is not one of this arm: {what} is elsewhere by more than 50 mm or 0.05 rad.")
    x = nominal[:3, 0] - z * float(z @ nominal[:3, 0])
    x /= np.linalg.norm(x)
    out = np.eye(4)
    out[:3, 0], out[:3, 1], out[:3, 2], out[:3, 3] = x, np.cross(z, x), z, origin
    return out
