"""SemFM: carry a demonstrated region from one object to another by semantic functional maps.

A demonstration touches one object, the *source*; SemFM finds where to act on another of its kind,
the *target*::

    import semfm

    mug, kettle = semfm.Mesh.read("mug.obj"), semfm.Mesh.read("kettle.ply")
    grip = semfm.Region.near(mug, contact=[0.05, 0.0, 0.04], radius=0.03)
    carried = semfm.transfer(
        mug, kettle, grip,
        source_embeddings="mug.emb.mcap", target_embeddings="kettle.emb.mcap")
    print(carried.verdict, carried.region.vertices)

`transfer` is the easy door. `prepare` and `Matching` keep what is costly when one object meets many
others or one pair carries many regions. Below lie the pieces, named as in Rust and in the papers:
`Mesh`, `Shape`, `Eigenbasis`, `SemanticCloud`, `Anchors`, `FunctionalMap`, `PointMap`, `Region`.

Arrays may be of any numeric dtype, order and stride; views that come out are read-only and share
memory. Long calls free the interpreter, answer Ctrl-C, and take ``progress``. Lengths are in the
units of the mesh, angles in radians.
"""

from . import errors
from ._semfm import (
    Anchors,
    Camera,
    Clusters,
    DemoObject,
    Eigenbasis,
    Embeddings,
    FunctionalMap,
    HeatGeodesics,
    Hypothesis,
    Laplacian,
    Matching,
    Mesh,
    MeshFile,
    PatchEmbeddings,
    PointMap,
    PreparedObject,
    Region,
    SemanticCloud,
    Shape,
    SurfaceIndex,
    Transfer,
    TransferSettings,
    View,
    __version__,
    camera_towards,
    cotan_laplacian,
    demo_object,
    diffused_indicators,
    eigenbasis,
    farthest_points,
    geodesic_distances,
    get_num_threads,
    hks,
    laplacian,
    lift,
    point_cloud_laplacian,
    prepare,
    read_mesh,
    read_views,
    render,
    rig,
    sample_even,
    sample_uniform,
    set_num_threads,
    spectral_clusters,
    transfer,
    tufted_laplacian,
    wks,
    write_views,
)
from .errors import (
    Cancelled,
    ComputationError,
    FileError,
    FormatError,
    InternalError,
    InvalidInput,
    SemfmError,
)

__all__ = [
    "Anchors",
    "Camera",
    "Cancelled",
    "Clusters",
    "ComputationError",
    "DemoObject",
    "Eigenbasis",
    "Embeddings",
    "FileError",
    "FormatError",
    "FunctionalMap",
    "HeatGeodesics",
    "Hypothesis",
    "InternalError",
    "InvalidInput",
    "Laplacian",
    "Matching",
    "Mesh",
    "MeshFile",
    "PatchEmbeddings",
    "PointMap",
    "PreparedObject",
    "Region",
    "SemanticCloud",
    "SemfmError",
    "Shape",
    "SurfaceIndex",
    "Transfer",
    "TransferSettings",
    "View",
    "__version__",
    "camera_towards",
    "cotan_laplacian",
    "demo_object",
    "diffused_indicators",
    "eigenbasis",
    "errors",
    "farthest_points",
    "geodesic_distances",
    "get_num_threads",
    "hks",
    "laplacian",
    "lift",
    "point_cloud_laplacian",
    "prepare",
    "read_mesh",
    "read_views",
    "render",
    "rig",
    "sample_even",
    "sample_uniform",
    "set_num_threads",
    "spectral_clusters",
    "transfer",
    "tufted_laplacian",
    "wks",
    "write_views",
]
