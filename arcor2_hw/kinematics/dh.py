"""Denavit-Hartenberg parameters: the calibration of one robot, applied to its nominal model.

Rows use the classic convention, as manufacturers publish them: rotate by theta about z, move by d along z, move by a
along x, rotate by alpha about x. For nearly parallel axes, d can be several metres in one row and the opposite in the
next row. Joints are therefore not placed at the frames of the rows, but on the same axes, as near as possible to their
nominal places. The shapes of links do not move, and the end is exactly at the end of the rows.
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
"""Maximum displacement of an axis by a calibration, m and rad; a larger one belongs to another robot."""


class DhRow(NamedTuple):
    """One joint: theta and alpha in rad, d and a in m."""

    theta: float
    d: float
    a: float
    alpha: float

    def plus(self, delta: "DhRow") -> "DhRow":
        """Return this row with differences added, as some manufacturers publish them."""
        return DhRow(*(one + other for one, other in zip(self, delta, strict=True)))

    def matrix(self, q: float = 0.0) -> Array:
        """Return the transform of the row for a joint value, (4, 4)."""
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
    """Return the rows of a calibration."""
    return [DhRow(each.theta, each.d, each.a, each.alpha) for each in calibration.joints]


def chain(rows: Sequence[DhRow], q: Sequence[float] | Array) -> Array:
    """Return the end of a chain of rows for joint values, (4, 4)."""
    at = np.eye(4)
    for row, value in zip(rows, q, strict=True):
        at = at @ row.matrix(float(value))
    return at


def calibrated(model: RobotModel, end_effector: str, rows: Sequence[DhRow]) -> RobotModel:
    """Return the model of the robot that these rows describe.

    Args:
        model: The nominal model.
        end_effector: End effector whose chain the rows describe.
        rows: One row for each joint, starting in the frame of the first joint. Their end is the link that is fixed to
            the link of the last joint.

    Raises:
        ModelError: The joints are not revolute about their z axes, their number differs, or the rows deviate from the
            nominal model by more than 50 mm or 0.05 rad.
    """
    arm = model.arm(end_effector)
    moving = [step for step in arm.steps if step.axis is not None]
    if len(moving) != len(rows) or any(step.prismatic or not np.allclose(step.axis, (0, 0, 1)) for step in moving):  # type: ignore[arg-type]
        raise ModelError(
            "{name} cannot be described by {count} DH rows: its joints do not match them.",
            name=model.name,
            count=len(rows),
        )
    if not np.isfinite(rows).all():
        raise ModelError("The calibration of {name} has numbers that are not finite.", name=model.name)
    names = [step.name for step in arm.steps]
    first, last = names.index(moving[0].name), names.index(moving[-1].name)
    if len(moving) != last - first + 1 or last + 1 == len(names):
        raise ModelError(
            "{name} cannot be described by DH rows: it has fixed joints between its joints.", name=model.name
        )
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
        raise ModelError(
            "The calibration does not belong to {name}: its end differs by more than 50 mm.", name=model.name
        )
    origins[names[last + 1]] = np.linalg.inv(before) @ end
    return model.with_origins(origins)


def calibrated_model(nominal: RobotModel, calibration: KinematicCalibration) -> RobotModel:
    """Return the model of one robot, calibrated with the parameters from its controller.

    Raises:
        ModelError: The calibration belongs to another kind of robot.
    """
    if not nominal.end_effectors:
        raise ModelError("{name} has no end effector, so no calibration can be applied.", name=nominal.name)
    # All end effectors share the joints of the arm.
    return calibrated(nominal, next(iter(nominal.end_effectors)), rows_of(calibration))


def _onto(axis_frame: Array, nominal: Array, what: str) -> Array:
    """Return the frame on the z axis of `axis_frame` that is nearest to the nominal frame."""
    z, at = axis_frame[:3, 2], axis_frame[:3, 3]
    origin = at + z * float(z @ (nominal[:3, 3] - at))
    if np.linalg.norm(origin - nominal[:3, 3]) > FARTHEST or np.linalg.norm(z - nominal[:3, 2]) > FARTHEST:
        raise ModelError(
            "The calibration belongs to another robot: {what} differs by more than 50 mm or 0.05 rad.", what=what
        )
    x = nominal[:3, 0] - z * float(z @ nominal[:3, 0])
    x /= np.linalg.norm(x)
    out = np.eye(4)
    out[:3, 0], out[:3, 1], out[:3, 2], out[:3, 3] = x, np.cross(z, x), z, origin
    return out
