"""The task: one demonstration, transferred to one row. It keeps nothing between rows."""

from __future__ import annotations

import hashlib
import json
import time
from dataclasses import dataclass
from typing import Any, Callable, Optional, Union

import numpy as np

from .._files import load_arrays
from .._semfm import (
    Matching,
    Mesh,
    PreparedObject,
    Region,
    SemanticCloud,
    TransferSettings,
    __version__,
    prepare,
)
from ..errors import Cancelled, FormatError, InvalidInput
from .manifest import Row
from .record import Record, answer, failure


#: Methods that read no features, so that no object needs any.
WITHOUT_FEATURES = frozenset({"wks"})


@dataclass(frozen=True)
class Demonstration:
    """What is transferred, and how; it pickles, and every worker gets it once.

    Attributes
    ----------
    source : PreparedObject
        The demonstrated object.
    region : Region
        On the source's mesh as given.
    settings : TransferSettings
    seed : int
    encoder : str or None
        Makes the features of targets that bring none; ``None`` where nobody may.
    k, working_vertices, n_samples : int or None
        How targets are prepared; see `semfm.prepare`.
    cache : str, bool or None
        Where prepared shapes of targets are kept; see `semfm.prepare`.
    point_maps : bool
        Whether records hold the whole point map.
    timeout_s : float or None
        Seconds allowed for one object.
    """

    source: PreparedObject
    region: Region
    settings: TransferSettings
    seed: int = 0
    encoder: Optional[str] = None
    k: Optional[int] = None
    working_vertices: Optional[int] = None
    n_samples: Optional[int] = None
    cache: Optional[Union[str, bool]] = None
    point_maps: bool = False
    timeout_s: Optional[float] = None

    def identity(self) -> dict[str, Any]:
        """Everything an answer depends on besides its row, as JSON values."""
        cloud = self.source.cloud
        return {
            "semfm": __version__,
            "source": self.source.mesh.hash,
            "cloud": _digest(cloud.points, cloud.features),
            "region": _digest(self.region.weights),
            "settings": json.loads(json.dumps(self.settings.to_dict(), sort_keys=True)),
            "seed": self.seed,
            "encoder": self.source.encoder,
            "k": self.k,
            "working_vertices": self.working_vertices,
            "n_samples": self.n_samples,
            "point_maps": self.point_maps,
        }

    def transfer(self, row: Row) -> Record:
        """Transfers the region to one target; whatever goes wrong there becomes its record.

        Parameters
        ----------
        row : Row

        Returns
        -------
        dict
            The columns of `record.COLUMNS`.
        """
        start = time.monotonic()
        try:
            tick = self._deadline(start)
            target = self._prepare(row, tick)
            matching = Matching(
                self.source, target, settings=self.settings, seed=self.seed, progress=tick
            )
            result = matching.transfer(self.region)
            return answer(row, result, point_map=self.point_maps, seconds=time.monotonic() - start)
        except TimeoutError as error:
            return failure(row, error, seconds=time.monotonic() - start, code="timeout")
        except Cancelled:
            raise
        except Exception as error:
            return failure(row, error, seconds=time.monotonic() - start)

    def _prepare(
        self, row: Row, tick: Optional[Callable[[str, int, int], object]]
    ) -> PreparedObject:
        mesh = Mesh.read(row.mesh)
        semantics: dict[str, Any] = {}
        if row.embeddings is not None:
            semantics["embeddings"] = row.embeddings
        elif row.features is not None:
            semantics["features"] = _array(row.features)
        elif row.cloud is not None:
            semantics["cloud"] = _cloud(row.cloud)
        elif self.encoder is not None:
            semantics["encoder"] = self.encoder
        target = prepare(
            mesh,
            settings=self.settings,
            k=self.k,
            working_vertices=self.working_vertices,
            n_samples=self.n_samples,
            seed=self.seed,
            cache=self.cache,
            progress=tick,
            **semantics,
        )
        _check_encoders(self.source, target)
        return target

    def _deadline(self, start: float) -> Optional[Callable[[str, int, int], object]]:
        """Stops the work from inside, at the next step it tells; the pool has a harder way too."""
        limit = self.timeout_s
        if limit is None:
            return None

        def tick(stage: str, done: int, total: int) -> None:
            if time.monotonic() - start > limit:
                raise TimeoutError(f"not done after {limit:g} s, in {stage}")

        return tick


def _check_encoders(source: PreparedObject, target: PreparedObject) -> None:
    """Features of two encoders, or of two versions of one, have nothing to do with each other."""
    if source.encoder is None or target.encoder is None:
        return
    ours, theirs = (
        " ".join(str(side.encoder[key]) for key in ("name", "version")) for side in (target, source)
    )
    if ours != theirs:
        raise InvalidInput(
            f"encoder: expected {theirs}, which made the features of the source, found {ours}",
            place="encoder",
        )


def _digest(*arrays: Any) -> str:
    digest = hashlib.blake2b(digest_size=16)
    for array in arrays:
        array = np.ascontiguousarray(array)
        digest.update(f"{array.dtype.str} {array.shape}".encode())
        digest.update(array.tobytes())
    return digest.hexdigest()


def _array(path: str) -> Any:
    found = _load(path)
    if not isinstance(found, np.ndarray):
        raise FormatError(f"{path}: expected one array (.npy), found an archive", place=path)
    return found


def _cloud(path: str) -> SemanticCloud:
    found = _load(path)
    if isinstance(found, np.ndarray):
        raise FormatError(f"{path}: expected an archive (.npz), found one array", place=path)
    with found:
        missing = {"points", "features"} - set(found.files)
        if missing:
            raise FormatError(
                f"{path}: expected points and features, found {sorted(found.files)}", place=path
            )
        views = found["n_views"] if "n_views" in found.files else None
        return SemanticCloud(found["points"], found["features"], views)


def _load(path: str) -> Any:
    return load_arrays(path)
