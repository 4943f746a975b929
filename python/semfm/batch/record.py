"""A record: the answer for one target, or why there is none."""

from __future__ import annotations

import json
import os
import socket
from collections.abc import Mapping
from typing import Any, Optional

import numpy as np

from .._semfm import Region, Transfer
from ..errors import InvalidInput
from .manifest import Row

#: The columns of a record in their order, with the type of each as Arrow writes it.
COLUMNS = {
    "name": "string",
    "key": "string",
    "status": "string",
    "verdict": "string",
    "confidence": "double",
    "n_vertices": "int64",
    "mesh_hash": "string",
    "vertices": "list<uint32>",
    "weights": "list<double>",
    "hypotheses": "list<struct<probability: double, vertices: list<uint32>>>",
    "point_map": "list<uint32>",
    "report": "string",
    "error": "string",
    "error_type": "string",
    "error_code": "string",
    "error_place": "string",
    "attempts": "int32",
    "seconds": "double",
    "from_cache": "bool",
    "worker": "string",
}

Record = dict[str, Any]


def worker_name() -> str:
    """This process among all: ``host:pid``."""
    return f"{socket.gethostname()}:{os.getpid()}"


def answer(row: Row, result: Transfer, *, point_map: bool, seconds: float) -> Record:
    """The record of a transferred region.

    A refused region is an answer: the object was looked at, and the region lands nowhere.
    """
    weights = np.asarray(result.region.weights)
    vertices = np.flatnonzero(weights)
    record = _empty(row, "done", seconds)
    record.update(
        verdict=result.verdict,
        confidence=float(result.confidence),
        n_vertices=len(weights),
        mesh_hash=result.target.mesh.hash,
        vertices=vertices.tolist(),
        weights=weights[vertices].tolist(),
        hypotheses=[
            {"probability": each.probability, "vertices": each.region.vertices.tolist()}
            for each in result.hypotheses
        ],
        report=json.dumps(result.report, sort_keys=True),
        from_cache=result.target.from_cache,
    )
    if point_map:
        record["point_map"] = np.asarray(result.point_map.source_of).tolist()
    return record


def failure(
    row: Row,
    error: BaseException,
    *,
    seconds: float = 0.0,
    code: Optional[str] = None,
    attempts: int = 1,
) -> Record:
    """The record of an object that could not be answered."""
    place = getattr(error, "place", None)
    record = _empty(row, "failed", seconds)
    record.update(
        error=str(error) or type(error).__name__,
        error_type=type(error).__name__,
        error_code=code or str(getattr(error, "code", None) or "error"),
        error_place=None if place is None else str(place),
        attempts=attempts,
    )
    return record


def region_of(record: Mapping[str, Any]) -> Region:
    """The region of a record.

    Parameters
    ----------
    record : dict
        From `records`; one that failed has no region.

    Returns
    -------
    Region
        On the target's mesh as read.

    Raises
    ------
    InvalidInput
        The record is one of a failure.
    """
    if record["status"] != "done":
        message = f"{record['name']} has no region: {record['error']}"
        raise InvalidInput(message, place=record["name"])
    weights = np.zeros(record["n_vertices"])
    weights[np.asarray(record["vertices"], dtype=np.int64)] = record["weights"]
    return Region(weights)


def _empty(row: Row, status: str, seconds: float) -> Record:
    record: Record = dict.fromkeys(COLUMNS)
    record.update(
        name=row.name,
        key=row.key,
        status=status,
        attempts=1,
        seconds=round(seconds, 6),
        worker=worker_name(),
    )
    return record
