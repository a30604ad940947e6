"""Rigid motions as arrays, for the solvers."""

import numpy as np
import numpy.typing as npt

Array = npt.NDArray[np.float64]


def cross_matrix(vector: Array) -> Array:
    """Return the matrix of the cross product with a vector; for (n, 3) vectors, (n, 3, 3)."""
    zero = np.zeros(vector.shape[:-1])
    x, y, z = vector[..., 0], vector[..., 1], vector[..., 2]
    rows = [np.stack(row, axis=-1) for row in ((zero, -z, y), (z, zero, -x), (-y, x, zero))]
    return np.stack(rows, axis=-2)


def turned(vector: Array) -> Array:
    """Return the rotation matrix of a rotation vector, rad (Rodrigues)."""
    angle = float(np.linalg.norm(vector))
    k = cross_matrix(vector)
    if angle < 1e-9:
        return np.asarray(np.eye(3) + k + k @ k / 2)
    return np.asarray(np.eye(3) + np.sin(angle) / angle * k + (1 - np.cos(angle)) / angle**2 * (k @ k))


def rotation_vector(rotation: Array) -> Array:
    """Return the rotation vector of a rotation matrix, with an angle from 0 to pi."""
    skew = np.array([rotation[2, 1] - rotation[1, 2], rotation[0, 2] - rotation[2, 0], rotation[1, 0] - rotation[0, 1]])
    sine, cosine = float(np.linalg.norm(skew)) / 2, (float(np.trace(rotation)) - 1) / 2
    angle = float(np.arctan2(sine, cosine))
    if sine > 1e-6:
        return np.asarray(skew / (2 * sine) * angle)
    if cosine > 0:
        return skew / 2
    outer = (rotation + rotation.T) / 4 + np.eye(3) / 2
    axis = outer[:, int(np.argmax(np.diag(outer)))]
    axis = axis if skew @ axis >= 0 else -axis
    return np.asarray(axis / np.linalg.norm(axis) * angle)


def motion(rotation: Array, position: Array) -> Array:
    """Return the homogeneous matrix (4, 4) of a rotation and a position."""
    result = np.eye(4)
    result[:3, :3] = rotation
    result[:3, 3] = np.ravel(position)
    return result


def inverted(matrix: Array) -> Array:
    """Return the inverse of a homogeneous matrix."""
    rotation = matrix[:3, :3].T
    return motion(rotation, -rotation @ matrix[:3, 3])


def moved(matrix: Array, step: Array) -> Array:
    """Return a motion followed by a small one in its end frame: rotation vector (rad), then displacement (m)."""
    turn = turned(step[:3])
    return motion(turn @ matrix[:3, :3], turn @ matrix[:3, 3] + step[3:])


def pose_difference(a: Array, b: Array) -> tuple[float, float]:
    """Return the difference of two motions: m, rad."""
    return (float(np.linalg.norm(a[:3, 3] - b[:3, 3])), float(np.linalg.norm(rotation_vector(a[:3, :3].T @ b[:3, :3]))))


def mean_rotation(rotations: Array, weights: Array) -> Array:
    """Return the weighted mean of rotations, (n, 3, 3), by F. L. Markley et al., Averaging Quaternions, 2007, eq. 13.

    The mean is the eigenvector of the weighted sum of outer products of quaternions with the largest eigenvalue. For
    rotation matrices, the same mean is the rotation nearest to their weighted sum (section II.B there).
    """
    total = np.einsum("n,nij->ij", weights, rotations)
    u, _, v = np.linalg.svd(total)
    return np.asarray(u @ np.diag([1.0, 1.0, np.linalg.det(u @ v)]) @ v)
