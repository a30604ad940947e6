"""Closed-form solutions of the hand-eye equation, with the arguments and results of OpenCV's calibrateHandEye.

OpenCV 5.0 no longer has that function. Two methods with different weighting of errors are compared: Park and Martin
solve the rotation first, Daniilidis solves rotation and translation together.
"""

from collections.abc import Callable, Sequence
from typing import Final

import numpy as np

from arcor2_hw.calibration.rigid import Array, cross_matrix, rotation_vector

Method = Callable[[Sequence[Array], Sequence[Array], Sequence[Array], Sequence[Array], float], tuple[Array, Array]]

_MAX_PAIRS: Final = 4000


def park(
    gripper2base: Sequence[Array],
    gripper2base_at: Sequence[Array],
    target2cam: Sequence[Array],
    target2cam_at: Sequence[Array],
    smallest_turn: float = 0.1,
) -> tuple[Array, Array]:
    """Compute the camera's rotation (3, 3) and position (3, m) on the gripper.

    F. C. Park, B. J. Martin, Robot sensor calibration: solving AX = XB on the Euclidean group, 1994, section III.

    Args:
        gripper2base: Rotations of the gripper in the robot's base, one per station.
        gripper2base_at: Positions of the gripper in the robot's base, m.
        target2cam: Rotations of the target in the camera's frame.
        target2cam_at: Positions of the target in the camera's frame, m.
        smallest_turn: Rotation between stations below which a pair is not used, rad.
    """
    hand, hand_at, eye, eye_at = _motions(gripper2base, gripper2base_at, target2cam, target2cam_at, smallest_turn)
    alpha = np.stack([rotation_vector(each) for each in hand])
    beta = np.stack([rotation_vector(each) for each in eye])
    # The rotation from all beta to alpha is the orthogonal part of the matrix.
    u, _, v = np.linalg.svd(alpha.T @ beta)
    rotation = u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v
    left = (np.eye(3) - hand).reshape(-1, 3)
    right = (hand_at - eye_at @ rotation.T).ravel()
    return np.asarray(rotation), np.asarray(np.linalg.lstsq(left, right, rcond=None)[0])


def daniilidis(
    gripper2base: Sequence[Array],
    gripper2base_at: Sequence[Array],
    target2cam: Sequence[Array],
    target2cam_at: Sequence[Array],
    smallest_turn: float = 0.1,
) -> tuple[Array, Array]:
    """Compute the camera's rotation (3, 3) and position (3, m) on the gripper; arguments as for `park`.

    K. Daniilidis, Hand-eye calibration using dual quaternions, 1999, section 6.
    """
    hand, hand_at, eye, eye_at = _motions(gripper2base, gripper2base_at, target2cam, target2cam_at, smallest_turn)
    rows = []
    for a, a_at, b, b_at in zip(hand, hand_at, eye, eye_at, strict=True):
        qa, da = _dual_quaternion(a, a_at)
        qb, db = _dual_quaternion(b, b_at)
        block = np.zeros((6, 8))
        block[:3, 0] = block[3:, 4] = qa[1:] - qb[1:]
        block[:3, 1:4] = block[3:, 5:] = cross_matrix(qa[1:] + qb[1:])
        block[3:, 0] = da[1:] - db[1:]
        block[3:, 1:4] = cross_matrix(da[1:] + db[1:])
        rows.append(block)
    _, _, v = np.linalg.svd(np.vstack(rows), full_matrices=False)
    first, second = v[6], v[7]
    u1, w1, u2, w2 = first[:4], first[4:], second[:4], second[4:]
    # Among all combinations, the one of unit length with perpendicular halves: a quadratic equation for their ratio.
    ratios = np.roots([u1 @ w1, u1 @ w2 + u2 @ w1, u2 @ w2])
    lengths = [(s.real**2 * (u1 @ u1) + 2 * s.real * (u1 @ u2) + u2 @ u2, s.real) for s in ratios]
    length, ratio = max(lengths) if lengths else (float(u2 @ u2), 0.0)
    q = (ratio * u1 + u2) / np.sqrt(length)
    d = (ratio * w1 + w2) / np.sqrt(length)
    # The position is twice the dual half times the conjugate.
    position = 2 * (q[0] * d[1:] - d[0] * q[1:] + np.cross(q[1:], d[1:]))
    return _matrix(q), np.asarray(position)


METHODS: Final[dict[str, Method]] = {"Park": park, "Daniilidis": daniilidis}


def _motions(
    hand: Sequence[Array], hand_at: Sequence[Array], eye: Sequence[Array], eye_at: Sequence[Array], smallest: float
) -> tuple[Array, Array, Array, Array]:
    """Return motions of gripper and camera between stations with enough rotation."""
    count = len(hand)
    pairs = [(i, j) for i in range(count) for j in range(i + 1, count)]
    pairs = [(i, j) for i, j in pairs if np.linalg.norm(rotation_vector(hand[j].T @ hand[i])) >= smallest]
    pairs = pairs[:: max(1, len(pairs) // _MAX_PAIRS)]
    if not pairs:
        raise ValueError("the orientation is the same at all stations")
    a = np.stack([hand[j].T @ hand[i] for i, j in pairs])
    a_at = np.stack([hand[j].T @ (np.ravel(hand_at[i]) - np.ravel(hand_at[j])) for i, j in pairs])
    b = np.stack([eye[j] @ eye[i].T for i, j in pairs])
    b_at = np.stack([np.ravel(eye_at[j]) - eye[j] @ eye[i].T @ np.ravel(eye_at[i]) for i, j in pairs])
    return a, a_at, b, b_at


def _dual_quaternion(rotation: Array, position: Array) -> tuple[Array, Array]:
    """Convert a motion to a dual quaternion, scalars first and not negative."""
    vector = rotation_vector(rotation)
    angle = float(np.linalg.norm(vector))
    axis = vector / angle if angle > 1e-12 else np.array([0.0, 0.0, 1.0])
    q = np.array([np.cos(angle / 2), *(np.sin(angle / 2) * axis)])
    dual = np.array([-(position @ q[1:]), *(q[0] * position + np.cross(position, q[1:]))]) / 2
    return q, dual


def _matrix(q: Array) -> Array:
    """Return the rotation matrix of a quaternion, scalar first."""
    k = cross_matrix(q[1:])
    return np.asarray(np.eye(3) + 2 * q[0] * k + 2 * k @ k)
