"""Fits the probability of a tracked pose (crates/semfm-track/src/probability.rs) to examined poses.

    cargo run --release -p semfm-track --example bench_track -- --poses poses.jsonl MESH...
    python bench/track.py poses.jsonl

Each line of the file is a pose as the image left it, with what the image says of it and whether it is right. Prints the
coefficients of a logistic function by maximum likelihood with a weak prior (standard deviation 3), and how often poses of each
probability are right. The coefficient of the share that was looked through is held: where the outline tells, it tells nearly all,
and a fit would leave views whose outline does not tell without a witness.
"""

import json
import sys

import numpy as np

# Logarithm of the odds that a pose loses when everything was looked through.
THROUGH = -6.0


def features(line):
    """As `features` of probability.rs."""
    return [
        1.0,
        line["through"],
        line["outline"] - 0.5,
        100 * (line["residual"] or 0.0) / line["diameter"],
    ]


def fitted(x, y, offset, prior=3.0, steps=100):
    """Newton's method on the penalised likelihood, with an offset of each pose's logarithm of the odds."""
    w = np.zeros(x.shape[1])
    for _ in range(steps):
        p = 1 / (1 + np.exp(-x @ w - offset))
        gradient = x.T @ (y - p) - w / prior**2
        hessian = (x.T * (p * (1 - p))) @ x + np.eye(len(w)) / prior**2
        step = np.linalg.solve(hessian, gradient)
        w += step
        if np.abs(step).max() < 1e-9:
            break
    return w


def main():
    lines = [json.loads(line) for path in sys.argv[1:] for line in open(path)]
    lines = [line for line in lines if line["right"] is not None and line["probability"] > 0]
    x = np.array([features(line) for line in lines])
    y = np.array([float(line["right"]) for line in lines])
    free = [0, 2, 3]
    w = np.full(4, THROUGH)
    w[free] = fitted(x[:, free], y, THROUGH * x[:, 1])
    p = 1 / (1 + np.exp(-x @ w))
    print(f"{len(y)} poses, {y.mean():.3f} of them right")
    print("coefficients", [round(float(c), 3) for c in w])
    for low, high in zip([0, 0.1, 0.5, 0.8, 0.9, 0.99], [0.1, 0.5, 0.8, 0.9, 0.99, 1.01]):
        here = (p >= low) & (p < high)
        if here.any():
            print(f"{low:4} to {min(high, 1.0):4}: {here.sum():5} poses, mean {p[here].mean():.3f}, right {y[here].mean():.3f}")


if __name__ == "__main__":
    main()
