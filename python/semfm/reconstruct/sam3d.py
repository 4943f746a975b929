"""SAM 3D Objects (Meta, 2025), through the inference interface of its repository.

The interface is the class ``Inference`` in ``notebook/inference.py`` of a checkout of
github.com/facebookresearch/sam-3d-objects; the package ``sam3d_objects`` alone does not have it::

    output = Inference(config_file)(image, mask, seed=seed, pointmap=pointmap)

``image`` is (height × width × 3) uint8, ``mask`` (height × width) bool, ``pointmap`` a torch tensor
(height × width × 3) in PyTorch3D's camera frame with NaN where nothing is known (infinity would
turn the scale into NaN), or None: then a depth network guesses it, up to a scale. ``output["glb"]``
is a trimesh with colours at its vertices; ``rotation``, ``translation`` and ``scale`` are its pose
(:mod:`.poses`).
"""

from __future__ import annotations

import contextlib
import importlib.metadata
import importlib.util
import os
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .._identity import file_identity
from .._semfm import Mesh
from ..errors import MissingPackage
from ..sidecar.errors import expected
from .placed_mesh import PlacedMesh, place_mesh
from .poses import OPENCV_FROM_PYTORCH3D, of_sam3d

#: Names the checkout where ``--sam3d`` does not.
VARIABLE = "SAM3D_OBJECTS"

_PACKAGE = "sam3d_objects"
_INTERFACE = Path("notebook", "inference.py")
_CONFIG = Path("checkpoints", "hf", "pipeline.yaml")
_INSTALL = (
    "SAM 3D Objects needs Linux, an NVIDIA GPU with 32 GB and an environment of its own: clone "
    "https://github.com/facebookresearch/sam-3d-objects, follow its doc/setup.md (weights are "
    "given on request), install semfm there, and name the checkout by --sam3d or "
    f"${VARIABLE}. Or run it elsewhere and give what it made: semfm-reconstruct --mesh object.glb "
    "--pose pose.json -o out (docs/observations.md)"
)


class Sam3dObjects:
    """A :class:`.tools.ReconstructionTool`."""

    name = "SAM 3D Objects"

    def __init__(self, checkout: str | None = None, config: str | None = None) -> None:
        """Loads the network.

        Parameters
        ----------
        checkout
            Folder of the repository; $SAM3D_OBJECTS, or where ``sam3d_objects`` is installed from.
        config
            ``pipeline.yaml`` of the weights; ``checkpoints/hf/pipeline.yaml`` of the checkout by
            default.
        """
        folder = _checkout(checkout)
        self._config = Path(config) if config else folder / _CONFIG
        if not self._config.is_file():
            wanted = "pipeline.yaml of the weights (doc/setup.md of the checkout, section 2)"
            raise expected(self._config, "--sam3d-config", wanted, "no such file")
        with _on_stderr():
            self._inference = _inference_class(folder)(os.fspath(self._config), compile=False)

    def describe(self) -> dict[str, Any]:
        """Name, version of the package, and its configuration's hash."""
        try:
            version: str | None = importlib.metadata.version(_PACKAGE)
        except importlib.metadata.PackageNotFoundError:
            version = None  # a checkout that was not installed
        return {"name": self.name, "version": version, "config": file_identity(self._config)}

    def reconstruct(
        self,
        picture: NDArray[np.uint8],
        mask: NDArray[np.bool_],
        point_map: NDArray[np.float32] | None,
        seed: int,
    ) -> PlacedMesh:
        """As the protocol has it."""
        with _on_stderr():
            output = self._inference(picture, mask, seed=seed, pointmap=_tensor(point_map))
        glb = output.get("glb")
        if glb is None:
            wanted = "a mesh under `glb` (decode_formats of its configuration)"
            raise expected(self.name, "output", wanted, f"the fields {sorted(output)}")
        parts = [_array(output.get(key)) for key in ("rotation", "translation", "scale")]
        return place_mesh(Mesh.from_trimesh(glb), of_sam3d(*parts), _vertex_colors(glb), self.name)


def _checkout(given: str | None) -> Path:
    """The folder of the repository."""
    named = given or os.environ.get(VARIABLE)
    if named:
        folder = Path(named)
        if not (folder / _INTERFACE).is_file():
            where = "--sam3d" if given else f"${VARIABLE}"
            wanted = f"a checkout of sam-3d-objects, with {_INTERFACE}"
            raise expected(folder, where, wanted, "none")
        return folder
    spec = importlib.util.find_spec(_PACKAGE)
    if spec is None or spec.origin is None:
        raise MissingPackage(f"{_PACKAGE}: not installed. {_INSTALL}", "missing-package", _PACKAGE)
    folder = Path(spec.origin).parent.parent
    if not (folder / _INTERFACE).is_file():
        found = f"installed without its checkout ({_INTERFACE} is not in {folder})"
        message = f"{_PACKAGE}: {found}. {_INSTALL}"
        raise MissingPackage(message, "missing-package", _PACKAGE)
    return folder


def _inference_class(folder: Path) -> Any:
    """The class ``Inference`` of a checkout."""
    # The file reads it without a default, and CUDA_HOME is set from it.
    os.environ.setdefault("CONDA_PREFIX", os.environ.get("CUDA_HOME") or sys.prefix)
    path = folder / _INTERFACE
    spec = importlib.util.spec_from_file_location("semfm_sam3d_inference", path)
    assert spec is not None and spec.loader is not None, "the file is there"
    module = importlib.util.module_from_spec(spec)
    folders = [os.fspath(folder), os.fspath(path.parent)]
    sys.path[:0] = folders
    try:
        spec.loader.exec_module(module)
    except ImportError as error:
        raise MissingPackage(f"{path}: {error}. {_INSTALL}", "missing-package", _PACKAGE) from error
    finally:
        for added in folders:
            sys.path.remove(added)
    return module.Inference


@contextlib.contextmanager
def _on_stderr() -> Iterator[None]:
    """What is printed meanwhile is no data of ours."""
    with contextlib.redirect_stdout(sys.stderr):
        yield


def _tensor(point_map: NDArray[np.float32] | None) -> Any:
    """A point map as the interface takes it."""
    if point_map is None:
        return None
    import torch

    turned = point_map * np.diag(OPENCV_FROM_PYTORCH3D).astype(np.float32)
    return torch.from_numpy(np.ascontiguousarray(turned))


def _array(value: Any) -> Any:
    """Numbers out of a tensor on any device; what is none stays as it is."""
    return value.detach().cpu().numpy() if hasattr(value, "detach") else value


def _vertex_colors(glb: Any) -> NDArray[np.uint8] | None:
    """Colours at the vertices, where the mesh has them there."""
    visual: Any = getattr(glb, "visual", None)
    if getattr(visual, "kind", None) != "vertex":
        return None
    return np.asarray(visual.vertex_colors, dtype=np.uint8)
