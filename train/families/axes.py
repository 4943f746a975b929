"""What all families draw with: a generator of chance, and the axes."""

from __future__ import annotations

import numpy as np

Rng = np.random.Generator
X, Y, Z = np.eye(3)
