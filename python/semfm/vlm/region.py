"""Regions as the project's files hold them: ``semfm.region/1``."""

from __future__ import annotations

import json
import os
from typing import Any

import numpy as np

from ..sidecar.errors import SidecarError, expected
from .object_views import ObjectViews

REGION_FORMAT = "semfm.region/1"
#: A vertex belongs to a region where its weight is this or more.
COUNTS = 0.5


def read_json(path: str | os.PathLike[str]) -> Any:
    """The value in a JSON file; raises SidecarError with file and place."""
    name = os.fspath(path)
    try:
        with open(name, encoding="utf-8") as file:
            return json.load(file)
    except OSError as error:
        raise SidecarError(f"{name}: {error.strerror or error}") from error
    except (ValueError, RecursionError) as error:
        raise expected(name, "content", "JSON", error) from error


def read_region(path: str | os.PathLike[str], of: ObjectViews) -> np.ndarray:
    """Weights (n) in [0, 1] of a region file, one per vertex of the object.

    ``{"vertices": […], "weights": […]}``, bare or under ``region``; weights default to 1. Where
    the file names its mesh, it must be the object's.

    Raises
    ------
    SidecarError
        If the file is broken, of another mesh, or the region is empty.
    """
    name = os.fspath(path)
    value = read_json(path)
    if isinstance(value, dict) and "region" in value:
        value = value["region"]
    if not isinstance(value, dict) or not isinstance(value.get("vertices"), list):
        raise expected(name, "region", "an object with `vertices`, a list of ids", type(value))
    if (form := value.get("format", REGION_FORMAT)) != REGION_FORMAT:
        raise expected(name, "format", REGION_FORMAT, repr(form))
    mesh = value.get("mesh") or {}
    for key, wanted in of.identity.items():
        if isinstance(mesh, dict) and mesh.get(key, wanted) != wanted:
            raise expected(name, f"mesh {key}", f"{wanted}, as in {of.path}", mesh[key])
    n, ids = len(of.vertices), value["vertices"]
    given = value.get("weights", [1.0] * len(ids))
    if not isinstance(given, list) or len(given) != len(ids):
        raise expected(name, "weights", f"{len(ids)}, one per vertex", given)
    weights = np.zeros(n)
    for at, (id, weight) in enumerate(zip(ids, given)):
        if type(id) is not int or not 0 <= id < n:
            raise expected(name, f"vertices[{at}]", f"an id below {n}, the vertex count", id)
        if type(weight) not in (int, float) or not 0 <= weight <= 1:
            raise expected(name, f"weights[{at}]", "a number from 0 to 1", weight)
        weights[id] = weight
    if not (weights >= COUNTS).any():
        raise expected(name, "region", f"a weight of {COUNTS} or more", "an empty region")
    return weights


def region_entries(weights: np.ndarray) -> dict[str, list]:
    """``vertices`` (ascending, those that count) and their ``weights``, ready for JSON."""
    ids = np.flatnonzero(weights >= COUNTS)
    return {"vertices": ids.tolist(), "weights": [round(float(w), 6) for w in weights[ids]]}
