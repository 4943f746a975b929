"""The curve of a trajectory between its points, as ``docs/formats.md`` defines it."""

from __future__ import annotations

import numpy as np


class Cubics:
    """Positions, velocities and accelerations of a trajectory at any time.

    ``times`` (n,) seconds, rising; ``positions`` and ``velocities`` (n, joints) at them. Between two points lies the cubic
    that has both points' positions and velocities.
    """

    def __init__(self, times: np.ndarray, positions: np.ndarray, velocities: np.ndarray):
        self.times, self.q, self.v = times, positions, velocities

    def at(self, times: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Positions, velocities and accelerations, (m, joints) each, at ``times`` (m,)."""
        part = np.clip(np.searchsorted(self.times, times, side="right") - 1, 0, len(self.times) - 2)
        h = (self.times[part + 1] - self.times[part])[:, None]
        s = (times - self.times[part])[:, None]
        mean = (self.q[part + 1] - self.q[part]) / h
        v0, v1 = self.v[part], self.v[part + 1]
        a = (3 * mean - 2 * v0 - v1) / h
        b = (v0 + v1 - 2 * mean) / h**2
        return self.q[part] + s * (v0 + s * (a + s * b)), v0 + s * (2 * a + 3 * s * b), 2 * a + 6 * s * b
