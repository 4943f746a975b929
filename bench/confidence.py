"""Fits how the evidence in an answer becomes a probability, for one encoder.

    semfm-cli eval DATA --methods fused -o real
    semfm-cli eval --synthetic … --encoder … -o made      # optional: more results
    python bench/confidence.py real/results.json [made/results.json …]

A logistic regression with a ridge of 1e-3 on standardised inputs over all scored pairs of `fused`: right
is an IoU of at least one half. It is judged on objects that it was not fitted on: the target objects
are halved by their names' hashes, and each half is read with the weights of the other. Prints the weights as
they stand in `BUILTIN_ENCODERS` (crates/semfm-encoder/src/builtin.rs).
"""

from __future__ import annotations

import argparse
import hashlib
import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np

NAMES = ("ambiguity", "margin", "round_trip")
#: `ConfidenceWeights::default` (crates/semfm-geom/src/confidence_weights.rs).
GENERAL = np.array([0.06, -1.56, 5.22, 4.44])
RIDGE = 1e-3
ACCEPT = 0.8


@dataclass(frozen=True)
class Answers:
    """Evidence (n, 3), whether the IoU reaches one half (n,), and which half its target is in (n,)."""

    evidence: np.ndarray
    right: np.ndarray
    half: np.ndarray

    def where(self, chosen: np.ndarray) -> Answers:
        return Answers(self.evidence[chosen], self.right[chosen], self.half[chosen])


def read(paths: list[Path], method: str) -> Answers:
    rows = [row for path in paths for row in json.loads(path.read_text())["rows"]]
    rows = [r for r in rows if r["method"] == method and r["iou"] is not None and r.get("evidence")]
    if not rows:
        raise SystemExit(f"{paths[0]}: expected scored rows of `{method}` with evidence, found none")
    return Answers(
        np.array([[row["evidence"][name] for name in NAMES] for row in rows]),
        np.array([row["iou"] >= 0.5 for row in rows]),
        np.array([hashlib.sha256(row["target"].encode()).digest()[0] % 2 for row in rows]),
    )


def fitted(answers: Answers) -> np.ndarray:
    """Constant and three weights, by Newton's method on the ridged log-likelihood."""
    mean, std = answers.evidence.mean(0), answers.evidence.std(0) + 1e-12
    x = np.column_stack([np.ones(len(answers.right)), (answers.evidence - mean) / std])
    ridge = RIDGE * len(x) * np.diag([0.0, 1, 1, 1])
    weights = np.zeros(4)
    for _ in range(100):
        p = 1 / (1 + np.exp(-x @ weights))
        hessian = x.T @ (x * (p * (1 - p))[:, None]) + ridge + 1e-9 * np.eye(4)
        step = np.linalg.solve(hessian, x.T @ (answers.right - p) - ridge @ weights)
        weights += step
        if np.abs(step).max() < 1e-10:
            break
    slopes = weights[1:] / std
    return np.concatenate([[weights[0] - slopes @ mean], slopes])


def probability(weights: np.ndarray, answers: Answers) -> np.ndarray:
    return 1 / (1 + np.exp(-(weights[0] + answers.evidence @ weights[1:])))


def judged(p: np.ndarray, right: np.ndarray) -> str:
    good, bad = p[right], p[~right]
    above = (good[:, None] > bad).mean() + 0.5 * (good[:, None] == bad).mean()
    bins = np.minimum((p * 10).astype(int), 9)
    error = sum(abs(p[bins == b].sum() - right[bins == b].sum()) for b in range(10)) / len(p)
    accepted = p >= ACCEPT
    sound = right[accepted].mean() if accepted.any() else float("nan")
    return (
        f"AUC {above:.3f}, calibration error {error:.3f}, "
        f"accepted {accepted.sum()} of {len(p)}, of these right {sound:.3f}"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("results", type=Path, nargs="+", help="results.json of semfm-cli eval")
    parser.add_argument("--method", default="fused")
    arguments = parser.parse_args()
    answers = read(arguments.results, arguments.method)
    crossed = np.empty(len(answers.right))
    for half in (0, 1):
        weights = fitted(answers.where(answers.half != half))
        crossed[answers.half == half] = probability(weights, answers.where(answers.half == half))
    print(f"{len(answers.right)} pairs, right {answers.right.mean():.3f}")
    print(f"general weights:        {judged(probability(GENERAL, answers), answers.right)}")
    print(f"fitted, other objects:  {judged(crossed, answers.right)}")
    constant, *slopes = fitted(answers)
    print(f"fitted on all:          {judged(probability(fitted(answers), answers), answers.right)}")
    row = ", ".join(f"{n}: {v:.2f}" for n, v in zip(("constant", *NAMES), (constant, *slopes)))
    print(f"ConfidenceWeights {{ {row} }}")


if __name__ == "__main__":
    main()
