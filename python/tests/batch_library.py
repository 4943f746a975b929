"""A library of small synthetic objects, and workers that die on purpose."""

from __future__ import annotations

import json
import os
import signal
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import semfm
from semfm.batch import Demonstration


@dataclass
class Library:
    """A prepared mug with its grip, and the manifest of what may be gripped like it."""

    folder: Path
    source: semfm.PreparedObject
    region: semfm.Region
    rows: list

    @property
    def manifest(self) -> Path:
        return self.folder / "library.jsonl"

    def write(self) -> Path:
        self.manifest.write_text("".join(json.dumps(row) + "\n" for row in self.rows))
        return self.manifest


def library(folder: Path, count: int, n_vertices: int = 150) -> Library:
    """`count` objects out of twelve shapes, each with meshes and features of its own name."""
    demo = semfm.demo_object("containers", n_vertices=n_vertices)
    source = semfm.prepare(demo.mesh, features=demo.shared_features(), k=12)
    shapes = [
        semfm.demo_object("containers", instance=i, n_vertices=n_vertices)
        for i in range(1, 1 + min(count, 12))
    ]
    rows = []
    for i in range(count):
        made = shapes[i % len(shapes)]
        scale = 1 + 0.01 * i  # no two meshes are the same
        name = f"object-{i:03}"
        semfm.Mesh(scale * made.mesh.vertices, made.mesh.faces).write(folder / f"{name}.ply")
        np.save(folder / f"{name}.npy", made.shared_features())
        rows.append({"name": name, "mesh": f"{name}.ply", "features": f"{name}.npy"})
    found = Library(folder, source, demo.region, rows)
    found.write()
    return found


@dataclass(frozen=True)
class Deadly(Demonstration):
    """Kills its own process at some rows: at `once` the first time only, at `always` each time."""

    once: tuple = ()
    always: tuple = ()
    marks: str = ""

    def transfer(self, row):
        if row.name in self.always:
            os.kill(os.getpid(), signal.SIGKILL)
        if row.name in self.once:
            mark = Path(self.marks, row.name)
            if not mark.exists():
                mark.touch()
                os.kill(os.getpid(), signal.SIGKILL)
        return super().transfer(row)


@dataclass(frozen=True)
class Hanging(Demonstration):
    """Never comes back from rows whose name begins with `hangs`, and does not hear that it should."""

    def transfer(self, row):
        while row.name.startswith("hangs"):
            time.sleep(60)
        return super().transfer(row)


def settings() -> semfm.TransferSettings:
    return semfm.TransferSettings("fused", zoomout={"k_final": 12})
