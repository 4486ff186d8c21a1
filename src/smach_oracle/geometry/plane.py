"""The level plane on which things stand, found among points whose z axis points up."""

from typing import NamedTuple, Optional

import numpy as np

SAMPLE = 4000  # points that the hypotheses are counted on


class Plane(NamedTuple):
    """A plane by its unit normal (pointing up) and one of its points."""

    normal: np.ndarray  # (3,)
    point: np.ndarray  # (3,), the mean of the points that lie in it

    def height(self, points: np.ndarray) -> np.ndarray:
        """Signed distance (m) of points (..., 3) above it."""
        return points @ self.normal - self.point @ self.normal

    def z_at(self, x: float, y: float) -> float:
        """Its z (m) at a place."""
        return float(
            self.point[2]
            - (self.normal[0] * (x - self.point[0]) + self.normal[1] * (y - self.point[1]))
            / self.normal[2]
        )


def find_plane(
    points: np.ndarray,
    generator: np.random.Generator,
    tolerance: float = 0.012,
    max_tilt: float = 0.17,
    least: int = 500,
    hypotheses: int = 150,
) -> Optional[Plane]:
    """The level plane with the most points, by RANSAC and a least-squares fit.

    :param points: (n, 3), m, all finite.
    :param tolerance: m that a point of the plane may lie off it.
    :param max_tilt: rad that the plane may lean.
    :returns: None where no plane has `least` points.
    """
    if len(points) < max(3, least):
        return None
    sample = points[generator.choice(len(points), min(SAMPLE, len(points)), replace=False)]
    best = _best_hypothesis(sample, generator, tolerance, max_tilt, hypotheses)
    if best is None:
        return None
    plane = best
    for _ in range(2):  # the second fit sees the points that the first hypothesis missed
        inliers = points[np.abs(plane.height(points)) < tolerance]
        if len(inliers) < least:
            return None
        plane = _fitted(inliers)
    return plane if plane.normal[2] >= np.cos(max_tilt) else None


def _best_hypothesis(
    sample: np.ndarray,
    generator: np.random.Generator,
    tolerance: float,
    max_tilt: float,
    hypotheses: int,
) -> Optional[Plane]:
    triples = sample[generator.integers(0, len(sample), size=(hypotheses, 3))]
    normals = np.cross(triples[:, 1] - triples[:, 0], triples[:, 2] - triples[:, 0])
    lengths = np.linalg.norm(normals, axis=1)
    level = (lengths > 1e-6) & (np.abs(normals[:, 2]) >= np.cos(max_tilt) * lengths)
    if not level.any():
        return None
    normals = normals[level] * (np.sign(normals[level, 2]) / lengths[level])[:, None]
    origins = triples[level, 0]
    offsets = np.einsum('ij,ij->i', normals, origins)
    counts = (np.abs(sample @ normals.T - offsets) < tolerance).sum(axis=0)
    best = int(np.argmax(counts))
    return Plane(normals[best], origins[best])


def _fitted(points: np.ndarray) -> Plane:
    """Least squares."""
    middle = points.mean(axis=0)
    some = (points - middle)[:: max(1, len(points) // SAMPLE)]
    normal = np.linalg.svd(some, full_matrices=False)[2][2]
    return Plane(normal * np.sign(normal[2]), middle)
