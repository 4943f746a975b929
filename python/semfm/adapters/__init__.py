"""Objects of SemFM in the hands of other libraries: trimesh, open3d, polyscope and rerun.

Each function takes a `Mesh` (or `MeshFile`, `Shape`, `PreparedObject`), a `SemanticCloud` or a
whole `Transfer`, and needs its library only when it is called::

    from semfm.adapters import to_trimesh

    to_trimesh(mug, region=grip).show()

Vertices keep their order, so ids and arrays per vertex mean the same on both sides. The way back is
`Mesh.from_trimesh` and `Mesh.from_open3d`.
"""

from .open3d import to_open3d
from .polyscope import to_polyscope
from .rerun import to_rerun
from .trimesh import to_trimesh

__all__ = ["to_open3d", "to_polyscope", "to_rerun", "to_trimesh"]
