"""Writes the training set: one .npz per object with its pictures and the fused field.

    python -m train.dataset FOLDER --teacher ENCODER.json --objects 0:800

Object i is the same on every run; files that are there already are kept, so an interrupted run goes
on and two runs may share the work. Arrays of one file, for v pictures and k points:

    grey      (v, 224, 224) uint8    pictures as the student sees them; the background is 255
    sample    (v, 56, 56) int16      point of the fused field under every fourth pixel, −1 outside
    features  (k, d) float16         the fused field
    family    str                    which generator drew the object
"""

from __future__ import annotations

import argparse
import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import semfm
from scipy.spatial import cKDTree

from .families import FAMILIES, LEFT_OUT, WEIGHTS
from .objects import TrainingObject, make_object
from .teacher import Teacher

SIZE = 224
#: Pixels between two looked-up points: a patch of 16 pixels holds 4 × 4 of them.
STRIDE = 4
#: Views of the fused field, and pictures from random cameras that only the student sees.
N_VIEWS, N_RANDOM = 14, 4
#: One object in so many belongs to a family that is left out of training.
_LEFT_OUT_EVERY = 14


@dataclass(frozen=True)
class Recipe:
    """Which object an index stands for."""

    index: int
    family: str
    left_out: bool

    @property
    def file_name(self) -> str:
        return f"{'left' if self.left_out else 'train'}_{self.index:05d}.npz"


def recipe(index: int) -> Recipe:
    """The family of the object of that index, by the weights of `families.py`."""
    rng = np.random.default_rng([7, index])
    if index % _LEFT_OUT_EVERY == _LEFT_OUT_EVERY - 1:
        return Recipe(index, str(rng.choice(LEFT_OUT)), True)
    names = [name for name in FAMILIES if name not in LEFT_OUT]
    weights = np.array([WEIGHTS[name] for name in names])
    return Recipe(index, str(rng.choice(names, p=weights / weights.sum())), False)


def example(drawn: TrainingObject, teacher: Teacher) -> dict[str, np.ndarray]:
    """Pictures of an object and the teacher's fused field: the arrays of one file."""
    mesh = semfm.Mesh(drawn.vertices, drawn.faces)
    views = semfm.render(mesh, semfm.rig(mesh, count=N_VIEWS, size=SIZE))
    field = teacher.fused_field(mesh, views)
    views += semfm.render(mesh, random_cameras(mesh, drawn.seed))
    sample_of_triangle = _nearest_samples(mesh, field.points)
    return {
        "grey": np.stack([grey(view.rgb) for view in views]),
        "sample": np.stack([_samples_seen(view.triangles, sample_of_triangle) for view in views]),
        "features": field.features.astype(np.float16),
        "family": np.array(drawn.family),
    }


def grey(rgb: np.ndarray) -> np.ndarray:
    """Luma of a picture (h, w, 3) uint8, (h, w) uint8: 0.299 R + 0.587 G + 0.114 B, rounded."""
    return np.rint(rgb.astype(np.float32) @ np.float32([0.299, 0.587, 0.114])).astype(np.uint8)


def random_cameras(mesh: semfm.Mesh, seed: int) -> list[semfm.Pinhole]:
    """Cameras from anywhere, turned anyhow, nearer or farther."""
    rng = np.random.default_rng([13, seed])
    return [
        semfm.camera_towards(
            mesh, rng.normal(size=3), rng.normal(size=3), size=SIZE, fill=rng.uniform(0.5, 0.95)
        )
        for _ in range(N_RANDOM)
    ]


def _nearest_samples(mesh: semfm.Mesh, points: np.ndarray) -> np.ndarray:
    """Point of the field nearest to each triangle's centre, (m,) int16."""
    centres = mesh.vertices[mesh.faces].mean(1)
    return cKDTree(points).query(centres)[1].astype(np.int16)


def _samples_seen(triangles: np.ndarray, sample_of_triangle: np.ndarray) -> np.ndarray:
    middle = triangles[STRIDE // 2 :: STRIDE, STRIDE // 2 :: STRIDE]
    seen = sample_of_triangle[np.maximum(middle, 0)]
    return np.where(middle >= 0, seen, -1).astype(np.int16)


def write_example(path: Path, arrays: dict[str, np.ndarray]) -> None:
    """Whole or not at all."""
    partial = path.with_suffix(f".{os.getpid()}.partial")
    with open(partial, "wb") as file:
        np.savez(file, **arrays)
    os.replace(partial, path)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--teacher", required=True, metavar="ENCODER.json")
    parser.add_argument("--objects", default="0:800", metavar="FIRST:STOP[:STEP]")
    parser.add_argument("--threads", type=int, default=1)
    arguments = parser.parse_args()
    arguments.folder.mkdir(parents=True, exist_ok=True)
    semfm.set_num_threads(arguments.threads)
    teacher = Teacher(arguments.teacher, arguments.threads)
    started = time.process_time()
    for n, index in enumerate(range(*map(int, arguments.objects.split(":")))):
        what = recipe(index)
        path = arguments.folder / what.file_name
        if path.exists():
            continue
        try:
            write_example(path, example(make_object(what.family, index), teacher))
        except (semfm.SemfmError, RuntimeError) as error:
            print(f"{what.file_name}: {what.family}, seed {index}: left out: {error}", flush=True)
        if n % 25 == 24:
            seconds = (time.process_time() - started) / (n + 1)
            print(f"{n + 1} objects, {seconds:.2f} s of CPU time each", flush=True)


if __name__ == "__main__":
    main()
