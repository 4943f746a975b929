# Written by python/tools/stubs.py from the compiled module. Do not edit.
# ruff: noqa: E501, UP007, UP045
"""The compiled half of `semfm`."""

import os
from collections.abc import Iterable, Mapping
from typing import Any, Callable, Optional, Protocol, Union

import numpy
from numpy.typing import ArrayLike, NDArray

class _WithFaces(Protocol):
    @property
    def vertices(self) -> Any: ...
    @property
    def faces(self) -> Any: ...

class _WithTriangles(Protocol):
    @property
    def vertices(self) -> Any: ...
    @property
    def triangles(self) -> Any: ...

_Path = Union[str, os.PathLike[str]]
_MeshLike = Union["Mesh", _Path, _WithFaces, _WithTriangles]
_PoseLike = Union[ArrayLike, "Alignment", _Path]
_Progress = Union[bool, Callable[[str, int, int], object]]
_Cache = Union[bool, _Path]

__version__: str

class Alignment:
    """Pose and scale of an object before a camera, and how far to trust them: see `align`."""
    @property
    def alternatives(self) -> NDArray[numpy.float64]:
        """(a, 4, 4) float64 array: other values of `camera_from_object` that explain what was seen as well."""
        ...
    @property
    def camera_from_object(self) -> NDArray[numpy.float64]:
        """(4, 4) float64 array: from the mesh's frame and units to the camera's frame in metres; the
        scale is included.
        """
        ...
    @property
    def inlier_share(self) -> float:
        """float: share of the observed points that lie on the model."""
        ...
    @property
    def position_std(self) -> float:
        """float: standard deviation of the position in its least certain direction, metres."""
        ...
    @property
    def reasons(self) -> list[str]:
        """list of str: what speaks against accepting the pose."""
        ...
    @property
    def residual_m(self) -> float:
        """float: root mean square distance of the points that lie on the model, metres."""
        ...
    @property
    def rigid(self) -> NDArray[numpy.float64]:
        """(4, 4) float64 array: the same once the object is measured in metres, for `find_grasps`."""
        ...
    @property
    def rival(self) -> float:
        """float: what the best pose that puts some of the surface elsewhere explains of what was seen, as a
        share of what this one does.
        """
        ...
    @property
    def rotation_std(self) -> float:
        """float: standard deviation of the rotation about its least certain axis, radians; π where what
        was seen does not determine it.
        """
        ...
    @property
    def scale(self) -> float:
        """float: metres per unit of the mesh."""
        ...
    @property
    def scale_std(self) -> float:
        """float: standard deviation of the scale."""
        ...
    def to_dict(self) -> dict[str, Any]:
        """The content of `aligned.json`.

        Returns
        -------
        dict
        """
        ...
    @property
    def undetermined(self) -> list[dict[str, Any]]:
        """list of dict: axes about which what was seen does not determine the rotation: ``axis``, a unit
        vector (x, y, z) in the mesh's frame, and ``turns``, the ranges of turns about it (radians, 0
        the pose itself) that fit as well.
        """
        ...
    @property
    def verdict(self) -> str:
        """str: ``"accept"``, ``"check"`` or ``"refuse"``."""
        ...
    @property
    def visibility(self) -> float:
        """float: of the model's side that faces the camera, the share that was seen where it is."""
        ...
    def write(self, path: _Path) -> None:
        """Writes `aligned.json`, whole or not at all: what `semfm-cli align` writes and
        ``semfm-cli grasp --aligned`` reads.

        Parameters
        ----------
        path : path
        """
        ...

class Anchors:
    """The paired parts of two objects, by falling cosine.

    See Also
    --------
    Anchors.select, Matching.anchors
    """
    def __len__(self) -> int: ...
    @property
    def cosines(self) -> NDArray[numpy.float64]:
        """(K_source, K_target) float64 array: all cosines, a read-only view."""
        ...
    @property
    def margins(self) -> NDArray[numpy.float64]:
        """(a,) float64 array: by how much each cosine exceeds its best rival; infinite without one."""
        ...
    @property
    def pairs(self) -> NDArray[numpy.uint32]:
        """(a, 2) uint32 array: cluster of the source and of the target of each pair."""
        ...
    @property
    def scores(self) -> NDArray[numpy.float64]:
        """(a,) float64 array: cosine of the two mean features of each pair."""
        ...
    @staticmethod
    def select(source_cloud: SemanticCloud, source_clusters: Clusters, target_cloud: SemanticCloud, target_clusters: Clusters, *, alpha: int = 2) -> Anchors:
        """The one-to-one pairs of clusters with the largest total cosine between mean features.

        Parameters
        ----------
        source_cloud : SemanticCloud
        source_clusters : Clusters
        target_cloud : SemanticCloud
        target_clusters : Clusters
        alpha : int, default 2
            How many pairs; fewer where there are fewer clusters.

        Returns
        -------
        Anchors
        """
        ...

class Clusters:
    """A cloud cut into parts: one label per point, every label from 0 on at least one.

    Parameters
    ----------
    labels : (m,) array_like
        Labels from elsewhere (ids); gaps in the numbering are closed.

    See Also
    --------
    spectral_clusters : cuts a cloud by its features.
    """
    def __init__(self, labels: ArrayLike) -> None: ...
    @property
    def labels(self) -> NDArray[numpy.uint32]:
        """(m,) uint32 array: label of each point, a read-only view."""
        ...
    @property
    def n_clusters(self) -> int:
        """int: number of parts."""
        ...

class DemoObject:
    """A procedural object with everything that is known about it: shape, parts, true grip.

    Made by `demo_object`.
    """
    def embeddings(self, level: str = 'medium', *, progress: Optional[_Progress] = None) -> Embeddings:
        """Simulated patch embeddings of the default views.

        Parameters
        ----------
        level : str, default "medium"
            How hard they are: ``"easy"``, ``"medium"`` or ``"hard"``.
        progress : progress, optional

        Returns
        -------
        Embeddings
            They say that they are simulated.
        """
        ...
    @property
    def kind(self) -> str:
        """str: hammer, pickaxe, mug …"""
        ...
    @property
    def mesh(self) -> Mesh:
        """Mesh: the surface, bounding-box diagonal 1, in a random upright-ish pose."""
        ...
    @property
    def name(self) -> str:
        """str: a short name, unique among objects."""
        ...
    def part_features(self) -> NDArray[numpy.float32]:
        """The parts as one-hot features, one column per part of this object.

        Returns
        -------
        (n, parts) float32 array
        """
        ...
    @property
    def part_names(self) -> list[str]:
        """list of str: names of the parts."""
        ...
    @property
    def parts(self) -> NDArray[numpy.uint8]:
        """(n,) uint8 array: part of each vertex, an index into `part_names`; a read-only view."""
        ...
    @property
    def region(self) -> Region:
        """Region: the true grip."""
        ...
    def shared_features(self) -> NDArray[numpy.float32]:
        """The parts as one-hot features, with the same columns for every object.

        Returns
        -------
        (n, 21) float32 array
        """
        ...
    def write(self, folder: _Path, level: str = 'medium', *, progress: Optional[_Progress] = None) -> dict[str, Any]:
        """Writes ``NAME.obj``, ``NAME.json`` (the truth) and ``NAME.emb.mcap`` into a folder.

        Parameters
        ----------
        folder : path
            Must exist.
        level : str, default "medium"
            As in `embeddings`.
        progress : progress, optional

        Returns
        -------
        dict
            The files, as ``mesh``, ``truth`` and ``embeddings``.
        """
        ...

class Eigenbasis:
    """The first k eigenpairs of ``L φ = λ M φ``, ascending, orthonormal for the lumped mass M.

    Parameters
    ----------
    values : (k,) array_like
        Eigenvalues, ascending, never negative.
    functions : (n, k) array_like
        Eigenfunctions, one column each, with ``functions.T @ (mass[:, None] * functions) = I``.
    mass : (n,) array_like
        The diagonal of M, positive.
    residuals : (k,) array_like, optional
        Relative residuals; zeros where nothing is known about them.

    See Also
    --------
    eigenbasis : computes one from a Laplacian.
    Shape.basis : the one of a prepared mesh.
    """
    def __init__(self, values: ArrayLike, functions: ArrayLike, mass: ArrayLike, residuals: Optional[ArrayLike] = None) -> None: ...
    def diffuse(self, functions: ArrayLike, t: float) -> NDArray[numpy.float64]:
        """Heat diffusion exp(−tΔ)F on the truncated basis.

        Parameters
        ----------
        functions : (n,) or (n, p) array_like
        t : float
            Time, in the units of 1 / `values`; relative to area 1 for the basis of a `Shape`.

        Returns
        -------
        (n,) or (n, p) float64 array
        """
        ...
    @staticmethod
    def from_npz(path: _Path) -> Eigenbasis:
        """Reads what `to_npz` wrote.

        Parameters
        ----------
        path : path

        Returns
        -------
        Eigenbasis
        """
        ...
    @property
    def functions(self) -> NDArray[numpy.float64]:
        """(n, k) float64 array: eigenfunctions Φ, one column each, a read-only view."""
        ...
    @property
    def k(self) -> int:
        """int: number of eigenpairs k."""
        ...
    @property
    def mass(self) -> NDArray[numpy.float64]:
        """(n,) float64 array: lumped mass, a read-only view."""
        ...
    @property
    def n_vertices(self) -> int:
        """int: number of vertices n."""
        ...
    def orthonormality_error(self) -> float:
        """Largest entry of |ΦᵀMΦ − I|.

        Returns
        -------
        float
        """
        ...
    def project(self, functions: ArrayLike) -> NDArray[numpy.float64]:
        """Coefficients ΦᵀMF of functions on the vertices.

        Parameters
        ----------
        functions : (n,) or (n, p) array_like
            On the working vertices, for the basis of a `Shape`: `Shape.onto_working` makes them of
            functions on the mesh as given.

        Returns
        -------
        (k,) or (k, p) float64 array
        """
        ...
    def reconstruct(self, coefficients: ArrayLike) -> NDArray[numpy.float64]:
        """The functions ΦA with the coefficients A, of which there may be fewer than k.

        Parameters
        ----------
        coefficients : (c,) or (c, p) array_like

        Returns
        -------
        (n,) or (n, p) float64 array
        """
        ...
    @property
    def residuals(self) -> NDArray[numpy.float64]:
        """(k,) float64 array: relative residuals of the pairs, a read-only view."""
        ...
    def to_npz(self, path: _Path) -> None:
        """Writes `values`, `functions`, `mass` and `residuals` to an .npz file.

        Parameters
        ----------
        path : path
        """
        ...
    def truncated(self, k: int) -> Eigenbasis:
        """The first pairs only.

        Parameters
        ----------
        k : int

        Returns
        -------
        Eigenbasis
        """
        ...
    @property
    def values(self) -> NDArray[numpy.float64]:
        """(k,) float64 array: eigenvalues λ, ascending, a read-only view."""
        ...

class Embeddings:
    """The embeddings of an object's views, with the cameras and the mesh they were made of.

    Parameters
    ----------
    mesh : mesh_like
        The mesh that the views show.
    cameras : list of Pinhole
        One per view, all of one size.
    patches : list of PatchEmbeddings
        One per view, all of one dimension.
    encoder : str, default "unnamed"
        Name of the encoder, for the file.
    """
    def __init__(self, mesh: _MeshLike, cameras: Iterable[Pinhole], patches: Iterable[PatchEmbeddings], *, encoder: str = 'unnamed') -> None: ...
    def __len__(self) -> int: ...
    @property
    def cameras(self) -> list[Pinhole]:
        """list of Pinhole: one per view."""
        ...
    @property
    def dim(self) -> int:
        """int: dimension d of the vectors."""
        ...
    @property
    def encoder(self) -> str:
        """str: name of the encoder."""
        ...
    @property
    def mesh_hash(self) -> str:
        """str: hash of the mesh that the views show."""
        ...
    @property
    def metadata(self) -> dict[str, Any]:
        """dict: the file's metadata record ``semfm``, all entries as text."""
        ...
    @property
    def n_views(self) -> int:
        """int: number of views."""
        ...
    @staticmethod
    def of_views(views: ViewsFile, patches: Iterable[PatchEmbeddings], *, encoder: str, revision: str = 'unknown', preprocessing: str = 'unknown', rolls: int = 1, outliers: str = 'unknown', more: Optional[Mapping[str, Any]] = None) -> Embeddings:
        """What an encoder made of the views of a file; `semfm-embed` calls this.

        Parameters
        ----------
        views : ViewsFile
            The views that were encoded; their metadata are kept.
        patches : list of PatchEmbeddings
            One per view, all of one dimension.
        encoder : str
            Name of the encoder.
        revision : str, default "unknown"
            Its revision, or the hash of its file.
        preprocessing : str, default "unknown"
            How a picture was made into the encoder's input.
        rolls : int, default 1
            Number of turned pictures of each view that were averaged.
        outliers : str, default "unknown"
            What was done with outlier tokens.
        more : dict, optional
            Further entries of the metadata, text by name.

        Returns
        -------
        Embeddings
        """
        ...
    @property
    def patches(self) -> list[PatchEmbeddings]:
        """list of PatchEmbeddings: one per view."""
        ...
    @staticmethod
    def read(path: _Path) -> Embeddings:
        """Reads a ``NAME.emb.mcap`` and checks everything in it.

        Parameters
        ----------
        path : path

        Returns
        -------
        Embeddings
        """
        ...
    @property
    def simulated(self) -> bool:
        """bool: True where the embeddings were made up, without a network."""
        ...
    def write(self, path: _Path, *, dtype: str = 'f16') -> None:
        """Writes a ``NAME.emb.mcap``, whole or not at all.

        Parameters
        ----------
        path : path
        dtype : str, default "f16"
            ``"f16"`` or ``"f32"``.
        """
        ...

class FunctionalMap:
    """C (k_target × k_source): takes coefficients of a source function to those on the target.

    Parameters
    ----------
    matrix : (k_target, k_source) array_like

    See Also
    --------
    PointMap : the map of vertices, which runs the other way.
    """
    def __init__(self, matrix: ArrayLike) -> None: ...
    def __eq__(self, other: object) -> bool: ...
    def commutativity(self, source: Eigenbasis, target: Eigenbasis) -> float:
        """‖C Λ_source − Λ_target C‖ / (λ_max ‖C‖): 0 where the map keeps lengths.

        Parameters
        ----------
        source : Eigenbasis
        target : Eigenbasis

        Returns
        -------
        float
        """
        ...
    @staticmethod
    def fit(source: Eigenbasis, target: Eigenbasis, source_descriptors: ArrayLike, target_descriptors: ArrayLike, *, k: Optional[int] = None, laplacian: float = 0.0, descriptors: float = 0.0, orientation: float = 0.0, reversing: bool = False, source_mesh: Optional[_MeshLike] = None, target_mesh: Optional[_MeshLike] = None, coefficients: bool = False, progress: Optional[_Progress] = None) -> FunctionalMap:
        """The map of least ``‖C A − B‖²`` for descriptors A of the source and B of the target.

        Without regularisers and with fewer descriptors than eigenfunctions the minimum-norm one.

        Parameters
        ----------
        source : Eigenbasis
        target : Eigenbasis
        source_descriptors : (n_source, p) array_like
            Functions on the source's vertices.
        target_descriptors : (n_target, p) array_like
            The same functions on the target's vertices.
        k : int, optional
            Size of the map (k × k); the smaller basis where none is given.
        laplacian : float, default 0.0
            μ, weight of commutation with the Laplacian, ``‖C Λ_source − Λ_target C‖²``.
        descriptors : float, default 0.0
            ν, weight of commutation with multiplication by each descriptor (Nogneng & Ovsjanikov).
        orientation : float, default 0.0
            ω, weight of commutation with the turned gradient of each descriptor (Ren et al. 2018),
            which tells left from right. Needs both meshes.
        reversing : bool, default False
            Whether the orientation is to be reversed instead of preserved.
        source_mesh : mesh_like, optional
            Triangles on the source's vertices, of a `Shape` its `working` mesh. They must be wound
            consistently (all but one in a thousand), and both meshes outward or both inward.
        target_mesh : mesh_like, optional
            The same for the target.
        coefficients : bool, default False
            Whether the descriptors are given as coefficients (k × p) in the two bases.
        progress : progress, optional

        Returns
        -------
        FunctionalMap

        Examples
        --------
        >>> import semfm, semfm.zoo
        >>> shape = semfm.Shape(semfm.zoo.torus(20, 10), k=10)
        >>> signature = semfm.wks(shape.basis)
        >>> fitted = semfm.FunctionalMap.fit(
        ...     shape.basis, shape.basis, signature, signature, laplacian=0.01)
        >>> fitted
        FunctionalMap(10 × 10)
        """
        ...
    @staticmethod
    def from_npz(path: _Path) -> FunctionalMap:
        """Reads what `to_npz` wrote.

        Parameters
        ----------
        path : path

        Returns
        -------
        FunctionalMap
        """
        ...
    @staticmethod
    def from_point_map(map: PointMap, source: Eigenbasis, target: Eigenbasis, *, k: Optional[int] = None) -> FunctionalMap:
        """C f = f ∘ T in the two bases: ``Φ_targetᵀ M_target Φ_source[T]``.

        Parameters
        ----------
        map : PointMap
            Target → source.
        source : Eigenbasis
        target : Eigenbasis
        k : int, optional
            Size of the map (k × k); the smaller basis where none is given.

        Returns
        -------
        FunctionalMap
        """
        ...
    @property
    def k_source(self) -> int:
        """int: size of the source basis."""
        ...
    @property
    def k_target(self) -> int:
        """int: size of the target basis."""
        ...
    @property
    def matrix(self) -> NDArray[numpy.float64]:
        """(k_target, k_source) float64 array: C, a read-only view."""
        ...
    def orthogonality(self) -> float:
        """‖C Cᵀ − I‖ / √k_target: 0 where the map keeps areas.

        Returns
        -------
        float
        """
        ...
    def to_npz(self, path: _Path) -> None:
        """Writes `matrix` to an .npz file.

        Parameters
        ----------
        path : path
        """
        ...
    def to_point_map(self, source: Eigenbasis, target: Eigenbasis, *, adjoint: bool = False, source_features: Optional[ArrayLike] = None, target_features: Optional[ArrayLike] = None, feature_weight: float = 0.0) -> PointMap:
        """The point map target → source: each target vertex takes the source vertex whose delta
        function, sent through C, comes nearest to its own.

        Parameters
        ----------
        source : Eigenbasis
        target : Eigenbasis
        adjoint : bool, default False
            Compare on the source instead, with the target's deltas brought back through Cᵀ. The same
            for an orthogonal C.
        source_features : (n_source, d) array_like, optional
            Features that take part in the search, as in `zoomout`.
        target_features : (n_target, d) array_like, optional
        feature_weight : float, default 0.0

        Returns
        -------
        PointMap
        """
        ...
    def to_precise_map(self, source: Eigenbasis, target: Eigenbasis, source_mesh: _MeshLike) -> PreciseMap:
        """The precise map target → source (Ezuz & Ben-Chen 2017): each target vertex takes the nearest
        point on the source's triangles, whose corners stand where their delta functions, sent through
        C, come to. Exact; of equally near triangles the first.

        Parameters
        ----------
        source : Eigenbasis
        target : Eigenbasis
        source_mesh : mesh_like
            Triangles on the source's vertices, of a `Shape` its `working` mesh.

        Returns
        -------
        PreciseMap
        """
        ...
    def zoomout(self, source: Eigenbasis, target: Eigenbasis, *, k_final: int = 50, step: int = 5, source_features: Optional[ArrayLike] = None, target_features: Optional[ArrayLike] = None, feature_weight: float = 0.0, source_samples: Optional[ArrayLike] = None, target_samples: Optional[ArrayLike] = None, progress: Optional[_Progress] = None) -> FunctionalMap:
        """ZoomOut (Melzi et al. 2019): grows this map by turns of point map and projection.

        Parameters
        ----------
        source : Eigenbasis
        target : Eigenbasis
        k_final : int, default 50
            Size of the last map.
        step : int, default 5
            Growth per turn.
        source_features : (n_source, d) array_like, optional
            Features that take part in the search, in the same space on both sides.
        target_features : (n_target, d) array_like, optional
        feature_weight : float, default 0.0
            w: the search runs in ``[spectral, w √k · features]``.
        source_samples : (r,) array_like, optional
            Source vertices among which matches are sought while the map grows; all where none are
            given.
        target_samples : (s,) array_like, optional
            Target vertices that are matched while the map grows; all where none are given.
        progress : progress, optional

        Returns
        -------
        FunctionalMap
        """
        ...

class Grasp:
    """One parallel-jaw grasp, in the frame of the object scaled to metres."""
    @property
    def approach(self) -> NDArray[numpy.float64]:
        """(3,) float64 array: the unit direction in which the hand comes (+z of the TCP), in the object's
        frame.
        """
        ...
    @property
    def camera_from_tcp(self) -> Optional[NDArray[numpy.float64]]:
        """(4, 4) float64 array, optional: the same in the camera's frame; None where `find_grasps` was told
        no `camera_from_object`.
        """
        ...
    @property
    def closing_turn(self) -> float:
        """float: angle by which the object turns while the pads close, radians."""
        ...
    @property
    def command_width(self) -> float:
        """float: what to tell a hand that stops at a force, metres: below contact, so that the pads press, and no
        less than the gripper can close to.
        """
        ...
    @property
    def contact_width(self) -> float:
        """float: distance between the two contacts along the closing direction, metres: where the pads touch."""
        ...
    @property
    def contacts(self) -> NDArray[numpy.float64]:
        """(2, 3) float64 array: one contact for each pad, in the object's frame, metres."""
        ...
    @property
    def epsilon(self) -> float:
        """float: Ferrari and Canny's ε."""
        ...
    @property
    def hold(self) -> Optional[float]:
        """float, optional: the probability that the grasp holds while the object is lifted, shaken and tilted;
        None where no `mass` was given.
        """
        ...
    @property
    def normals(self) -> NDArray[numpy.float64]:
        """(2, 3) float64 array: the object's unit normal at each contact, in the object's frame."""
        ...
    @property
    def object_from_tcp(self) -> NDArray[numpy.float64]:
        """(4, 4) float64 array: the gripper's TCP frame in the object's frame."""
        ...
    @property
    def opening(self) -> float:
        """float: distance between the pads on the way in, metres."""
        ...
    @property
    def position(self) -> NDArray[numpy.float64]:
        """(3,) float64 array: the TCP, between the pads, in the object's frame, metres."""
        ...
    @property
    def score(self) -> float:
        """float: the probability that the grasp holds, times what is asked beyond that; without a `mass`, as for
        an object of .3 kg.
        """
        ...
    @property
    def terms(self) -> dict[str, Any]:
        """dict: the terms of the score, each 0 to 1."""
        ...
    @property
    def width(self) -> float:
        """float: distance between the closed pads where they touch nothing yet, metres."""
        ...

class GraspPlan:
    """A motion of an arm that carries out a grasp, or what kept each grasp from one: see `plan`."""
    def at(self, times: ArrayLike) -> dict[str, Any]:
        """The state at each of some times; before the motion begins and after it ends, that of its ends.

        Parameters
        ----------
        times : (t,) array_like
            Seconds.

        Returns
        -------
        dict
            ``positions``, ``velocities`` and ``accelerations`` (t, n), ``openings`` (t,), metres between the pads.
        """
        ...
    @property
    def duration(self) -> float:
        """float: seconds that the motion takes; 0 without one."""
        ...
    @property
    def gates(self) -> list[dict[str, Any]]:
        """list of dict: grasps that did not become the motion, counted by the first gate that each did not pass: ``gate``,
        ``n``, the first such ``grasp``, its ``obstruction`` with its numbers, and that in words (``text``).
        """
        ...
    @property
    def grasp(self) -> Optional[int]:
        """int, optional: the grasp that is carried out, its place among the grasps from 0; None where none can be."""
        ...
    @property
    def joint_names(self) -> list[str]:
        """list of str: the arm's joints, base to tip: the columns of every array of joint values."""
        ...
    @property
    def n_replayed(self) -> int:
        """int: states of the finished motion, a millisecond apart, that were checked again."""
        ...
    @property
    def notes(self) -> list[str]:
        """list of str: what was found or assumed."""
        ...
    @property
    def outcomes(self) -> list[dict[str, Any]]:
        """list of dict: what became of each grasp, in their order: ``ending`` is ``"planned"``, ``"stopped"`` (at a
        ``gate``, by an ``obstruction``) or ``"not_tried"``.
        """
        ...
    def picture(self) -> bytes:
        """A picture of the motion or, where there is none, of the nearest miss, which notebooks show by themselves.

        Returns
        -------
        bytes
            PNG.
        """
        ...
    @property
    def segments(self) -> list[Segment]:
        """list of Segment: the motion: to the pre-grasp, approach, close, lift; empty without one."""
        ...
    @property
    def start_contact(self) -> Optional[dict[str, Any]]:
        """dict, optional: where the start itself touches something: the things ``a`` and ``b``, ``depth`` in metres and
        ``nearest_free`` joint values.
        """
        ...
    def to_dict(self) -> dict[str, Any]:
        """The content of `plan.json`.

        Returns
        -------
        dict
        """
        ...
    def write(self, folder: _Path, *, progress: Optional[_Progress] = None) -> list[str]:
        """Writes what ``semfm-cli plan`` writes: `plan.json` and, of a motion, `trajectory.json`, a ROS 2 bag, a scene for
        Foxglove, an animated model and a picture, else a picture of the nearest miss. An object that came from no file is
        written beside them (`planned_object.ply`).

        Parameters
        ----------
        folder : path
            Made if it is not there.
        progress : progress, optional

        Returns
        -------
        list of str
            The files.
        """
        ...

class Grasps:
    """Grasps of an object, best first, and what became of the other candidates: see `find_grasps`.

    A sequence of `Grasp`.
    """
    def __getitem__(self, index: int) -> Grasp: ...
    def __len__(self) -> int: ...
    @property
    def advice(self) -> Optional[str]:
        """str, optional: what kept most candidates from being grasps, what to do about it, and the options of
        `find_grasps` that would change it.
        """
        ...
    @property
    def camera_from_tcp(self) -> Optional[NDArray[numpy.float64]]:
        """(g, 4, 4) float64 array, optional: the same in the camera's frame, where one is known."""
        ...
    @property
    def gripper(self) -> Gripper:
        """Gripper: the gripper."""
        ...
    @property
    def mesh(self) -> Mesh:
        """Mesh: the object, in its own units."""
        ...
    @property
    def n_candidates(self) -> int:
        """int: gripper poses examined."""
        ...
    @property
    def nearest_miss(self) -> Optional[Any]:
        """object, optional: what the nearest miss failed, by how much, and the unit (str,
        float, str).
        """
        ...
    @property
    def object_from_tcp(self) -> NDArray[numpy.float64]:
        """(g, 4, 4) float64 array: the gripper's TCP frames in the object's frame, metres."""
        ...
    def picture(self) -> bytes:
        """A picture of the best grasps on the object, which notebooks show by themselves.

        Returns
        -------
        bytes
            PNG.
        """
        ...
    @property
    def region(self) -> Region:
        """Region: where the pads close."""
        ...
    @property
    def rejected(self) -> dict[str, Any]:
        """dict: candidates refused, by the first thing that each failed."""
        ...
    @property
    def scale(self) -> float:
        """float: metres per unit of the mesh."""
        ...
    @property
    def scores(self) -> NDArray[numpy.float64]:
        """(g,) float64 array: scores, falling."""
        ...
    def to_dict(self) -> dict[str, Any]:
        """The content of `grasps.json`.

        Returns
        -------
        dict
        """
        ...
    @property
    def widths(self) -> NDArray[numpy.float64]:
        """(g,) float64 array: distances between the closed pads, metres."""
        ...
    def write(self, path: _Path, *, format: Optional[str] = 'json') -> None:
        """Writes the grasps, whole or not at all.

        Parameters
        ----------
        path : path
        format : str, optional
            ``"json"``, ``"ros2"`` or ``"isaac"``: `grasps.json`, a ROS 2 MCAP with a `geometry_msgs/msg/PoseArray` and the widths and scores beside it, or Isaac's YAML.
        """
        ...

class Gripper:
    """A parallel-jaw gripper: +z along the approach, y along the closing direction, origin between the
    finger pads (TCP), metres.

    Parameters
    ----------
    name_or_path : path
        A built-in gripper (see `Gripper.builtin_names`) or a URDF file.
    packages : dict, optional
        Folders of the packages that a URDF names (``package://NAME/…``).

    Examples
    --------
    >>> import semfm
    >>> gripper = semfm.Gripper("franka")
    >>> gripper.opening
    (0.0, 0.08)
    >>> gripper.joints_at(0.04)
    {'panda_finger_joint1': 0.02, 'panda_finger_joint2': 0.02}
    """
    def __init__(self, name_or_path: _Path, *, packages: Optional[Mapping[str, Any]] = None) -> None: ...
    @staticmethod
    def builtin_names() -> list[str]:
        """Names of the built-in grippers.

        Returns
        -------
        list of str
        """
        ...
    def flange_from_tcp(self, width: float) -> NDArray[numpy.float64]:
        """The TCP in the flange's frame.

        Parameters
        ----------
        width : float
            Distance between the pads, metres; outside of the opening, the nearest inside.

        Returns
        -------
        (4, 4) float64 array
        """
        ...
    def joints_at(self, width: float) -> dict[str, Any]:
        """Positions of the joints that open and close the gripper.

        Parameters
        ----------
        width : float
            Distance between the pads, metres.

        Returns
        -------
        dict
            Metres or radians; empty where the joints are not known by name.
        """
        ...
    def mesh_at(self, width: float) -> Mesh:
        """The gripper's collision shapes as a mesh, for pictures and viewers.

        Parameters
        ----------
        width : float
            Distance between the pads, metres; outside of the opening, the nearest inside.

        Returns
        -------
        Mesh
            In the TCP frame, metres.
        """
        ...
    @property
    def name(self) -> str:
        """str: as in the URDF, or of the built-in set."""
        ...
    @property
    def notes(self) -> list[str]:
        """list of str: what was replaced or left out when the URDF was read."""
        ...
    @property
    def opening(self) -> tuple[float, float]:
        """tuple of float, float: distances between the pads that the joints can reach, metres."""
        ...
    @property
    def pad(self) -> tuple[float, float]:
        """tuple of float, float: the pads' sides across (x) and along (z) the approach, metres."""
        ...

class Hand:
    """A hand: a surface, open at the wrist or not, or points alone, in metres.

    Made by `read_hand` of what programs reconstruct, by `from_mask` of what a depth camera saw, or of arrays.

    Parameters
    ----------
    points : (n, 3) array_like
        In metres, in the frame of a camera (x right, y down, z forward) or of a mesh.
    faces : (m, 3) array_like, optional
        Ids of points; a cloud where none are given. Fingers are known for MANO's 778 points.
    joints : (21, 3) array_like, optional
        The wrist, then four joints of each finger from the thumb on, its tip last: tells fingers for other hands.

    Examples
    --------
    >>> import semfm, semfm.zoo
    >>> ball = semfm.zoo.icosphere(4)
    >>> mug = semfm.Mesh(0.05 * ball.vertices, ball.faces)
    >>> fist = semfm.Hand(0.04 * ball.vertices + [0.089, 0, 0], ball.faces)
    >>> touched = semfm.find_contact(mug, fist)
    >>> bool((mug.vertices[touched.region.vertices, 0] > 0.035).all())
    True
    """
    def __init__(self, points: ArrayLike, faces: Optional[ArrayLike] = None, *, joints: Optional[ArrayLike] = None) -> None: ...
    def __len__(self) -> int: ...
    @property
    def faces(self) -> NDArray[numpy.uint32]:
        """(m, 3) uint32 array: the faces, a read-only view; none for points alone."""
        ...
    @staticmethod
    def from_mask(observation: Observation, mask: Optional[Union[str, ArrayLike]] = None) -> Hand:
        """A hand of which a camera saw one side: the points under its mask, with the thickness of a finger behind them.

        Parameters
        ----------
        observation : Observation
        mask : str or (height, width) array_like, optional
            The hand's mask: a name, an array of dtype bool, or the only one that there is where none is given.

        Returns
        -------
        Hand
            In the camera's frame.
        """
        ...
    @property
    def parts(self) -> Optional[list[str]]:
        """list of str, optional: what each point belongs to: ``thumb``, ``index``, ``middle``, ``ring``, ``little`` or
        ``palm``; None where that is not known.
        """
        ...
    @property
    def points(self) -> NDArray[numpy.float64]:
        """(n, 3) float64 array: the points, metres."""
        ...
    @property
    def shift(self) -> Optional[dict[str, Any]]:
        """dict, optional: how `read_hand` brought it to its measured depth: ``along_axis`` and ``residual`` in metres, the
        ``scale`` by which its width changed, and ``n_measured`` points; None where it did not.
        """
        ...

class HeatGeodesics:
    """Geodesic distances on one mesh (Crane, Weischedel & Wardetzky 2013): two matrices are factorised
    once, then every question costs two triangular solves. Distances are those of the surface: vertices
    at the same place (a UV seam, flat shading) are one point of it.

    Parameters
    ----------
    mesh : mesh_like
    kind : str, default "tufted"
        The Laplacian: ``"tufted"`` or ``"cotan"``.
    time : float, default 1.0
        Diffusion time in squared mean edge lengths; larger is smoother and less exact.

    Examples
    --------
    >>> import semfm, semfm.zoo
    >>> heat = semfm.HeatGeodesics(semfm.zoo.icosphere(4))
    >>> distances = heat.distances(0)
    >>> float(distances[0]), round(float(distances.max()), 1)  # half a great circle
    (0.0, 3.1)
    """
    def __init__(self, mesh: _MeshLike, *, kind: str = 'tufted', time: float = 1.0) -> None: ...
    def distances(self, sources: Union[int, ArrayLike]) -> NDArray[numpy.float64]:
        """Distance of every vertex from the nearest source.

        One source is good to about an edge length. Several far apart share one function; where that
        matters, take the minimum over `distances_from_each`.

        Parameters
        ----------
        sources : int or (s,) array_like
            Vertex ids.

        Returns
        -------
        (n,) float64 array
            In the units of the mesh; infinite on components without a source.
        """
        ...
    def distances_from_each(self, sources: Union[int, ArrayLike]) -> NDArray[numpy.float64]:
        """Distances from each source alone.

        Parameters
        ----------
        sources : int or (s,) array_like
            Vertex ids.

        Returns
        -------
        (n, s) float64 array
            One column per source.
        """
        ...
    @property
    def n_vertices(self) -> int:
        """int: number of vertices n."""
        ...

class Hypothesis:
    """One place where the region may belong."""
    @property
    def probability(self) -> float:
        """float: share of the votes that fell there, among the hypotheses returned."""
        ...
    @property
    def region(self) -> Region:
        """Region: the region there."""
        ...

class Laplacian:
    """Stiffness and lumped mass of a surface: ``L = M⁻¹ · stiffness`` is the Laplace–Beltrami operator.

    The stiffness is symmetric, positive semidefinite (not negative, as in part of the literature)
    and its rows sum to zero. The mass is positive and adds up to the surface area.

    Parameters
    ----------
    stiffness : object
        Any SciPy sparse matrix (n × n).
    mass : (n,) array_like
        The diagonal of M, positive.

    See Also
    --------
    laplacian, tufted_laplacian, cotan_laplacian, point_cloud_laplacian
    """
    def __init__(self, stiffness: Any, mass: ArrayLike) -> None: ...
    @property
    def mass(self) -> NDArray[numpy.float64]:
        """(n,) float64 array: the diagonal of the mass matrix, a read-only view."""
        ...
    @property
    def mass_matrix(self) -> Any:
        """scipy.sparse.csc_matrix: the mass as a diagonal matrix (n × n); needs SciPy."""
        ...
    @property
    def n_vertices(self) -> int:
        """int: number of vertices n."""
        ...
    @property
    def stiffness(self) -> Any:
        """scipy.sparse.csc_matrix: stiffness (n × n); needs SciPy."""
        ...

class Matching:
    """A matched pair: computed once, it transfers any number of regions.

    Parameters
    ----------
    source : PreparedObject
        The demonstrated object.
    target : PreparedObject
        The one to act on.
    method : str, optional
        ``fused`` (where neither this nor `settings` is given), ``semfm``, ``anchored``,
        ``sinkhorn``, ``nearest`` or ``wks``.
    rule : str, optional
        How a map transfers the region: ``preimage`` (where none is given) or ``image``.
    seed : int, optional
        Of everything drawn by chance; 0 where none is given.
    second_opinion : bool, optional
        Whether an independent method judges the result, too; the method's own default where none is
        given: True where its confidence is the agreement of the two.
    settings : TransferSettings, optional
        Everything that can be set, in place of `method` and `rule`.
    progress : progress, optional

    Examples
    --------
    >>> import semfm
    >>> mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=500) for i in (0, 1))
    >>> source, target = (
    ...     semfm.prepare(o.mesh, features=o.shared_features(), k=30) for o in (mug, kettle))
    >>> matching = semfm.Matching(source, target)
    >>> matching.transfer(mug.region).verdict in ("accept", "check", "refuse")
    True
    """
    def __init__(self, source: PreparedObject, target: PreparedObject, *, method: Optional[str] = None, rule: Optional[str] = None, seed: Optional[int] = None, second_opinion: Optional[bool] = None, settings: Optional[TransferSettings] = None, progress: Optional[_Progress] = None) -> None: ...
    @property
    def anchors(self) -> Anchors:
        """Anchors: the paired parts of the two objects."""
        ...
    @property
    def functional_map(self) -> Optional[FunctionalMap]:
        """FunctionalMap, optional: C between the working shapes; None for methods without a map."""
        ...
    @property
    def source(self) -> PreparedObject:
        """PreparedObject: the demonstrated object."""
        ...
    @property
    def target(self) -> PreparedObject:
        """PreparedObject: the one to act on."""
        ...
    def transfer(self, region: Union[Region, _Path]) -> Transfer:
        """Transfers one region.

        Parameters
        ----------
        region : Region or path
            On the source's mesh as given.

        Returns
        -------
        Transfer
        """
        ...
    @property
    def working_point_map(self) -> PointMap:
        """PointMap: target → source, between the working meshes."""
        ...

class Memory:
    """Demonstrations in a folder: objects with a region each, of one kind or of many.

    Parameters
    ----------
    folder : path
        A memory, or an empty or missing folder in which one begins with the first `remember`.
    cache : cache, optional
        Where prepared shapes and embeddings are kept: a folder, or True for the user's own.

    Examples
    --------
    >>> import semfm, tempfile
    >>> mug, pot, kettle = (semfm.demo_object("containers", instance=i, n_vertices=500) for i in range(3))
    >>> memory = semfm.Memory(tempfile.mkdtemp())
    >>> memory.remember("mug", mug.mesh, mug.region, kind="container")
    >>> memory.remember("pot", pot.mesh, pot.region, kind="container")
    >>> memory.names
    ['mug', 'pot']
    >>> answer = memory.transfer(kettle.mesh)
    >>> answer.verdict in ("accept", "check", "refuse")
    True
    """
    def __init__(self, folder: _Path, *, cache: Optional[_Cache] = None) -> None: ...
    def __len__(self) -> int: ...
    @property
    def encoder(self) -> Optional[dict[str, Any]]:
        """dict, optional: the encoder behind all features; None while the memory is empty."""
        ...
    @property
    def entries(self) -> list[dict[str, Any]]:
        """list of dict: the demonstrations as `memory.json` has them: name, kind, mesh, provenance."""
        ...
    @property
    def folder(self) -> str:
        """str: the folder."""
        ...
    def forget(self, name: str) -> None:
        """Takes a demonstration away.

        Parameters
        ----------
        name : str
        """
        ...
    @property
    def names(self) -> list[str]:
        """list of str: names of the demonstrations, in alphabetical order."""
        ...
    def remember(self, name: str, mesh: Union[_MeshLike, MeshFile], region: Union[Region, _Path], *, kind: Optional[str] = None, embeddings: Optional[Union[Embeddings, _Path]] = None, encoder: Optional[str] = None, replace: bool = False, progress: Optional[_Progress] = None) -> None:
        """Adds a demonstration. Its files are complete before the memory names it.

        Parameters
        ----------
        name : str
            Its name in the memory.
        mesh : mesh_like or MeshFile
            The demonstrated object.
        region : Region or path
            Where one acts on it.
        kind : str, optional
            What kind of object it is, in your words.
        embeddings : Embeddings or path, optional
            Patch embeddings of its views, instead of an encoder.
        encoder : str, optional
            Shown rendered views in grey; that of the memory, or ``builtin``, where none is given.
        replace : bool, default False
            Replace the entry of that name, or with the same mesh and region.
        progress : progress, optional
        """
        ...
    def transfer(self, target: Union[_MeshLike, MeshFile, PreparedObject], *, kind: Optional[str] = None, shortlist: int = 5, embeddings: Optional[Union[Embeddings, _Path]] = None, encoder: Optional[str] = None, progress: Optional[_Progress] = None) -> MemoryTransfer:
        """Carries what was demonstrated to an object: the most similar demonstrations are matched and their
        answers fused.

        Parameters
        ----------
        target : mesh_like or MeshFile or PreparedObject
            The object to act on.
        kind : str, optional
            Only demonstrations of this kind.
        shortlist : int, default 5
            Demonstrations that are matched.
        embeddings : Embeddings or path, optional
            Patch embeddings of the target's views, instead of an encoder.
        encoder : str, optional
            Must be that of the memory, which is opened where none is given.
        progress : progress, optional

        Returns
        -------
        MemoryTransfer
        """
        ...

class MemoryTransfer:
    """What a memory says of an object: the answers of several demonstrations, fused. Made by `Memory.transfer`."""
    @property
    def agreement(self) -> float:
        """float: mean IoU of the answers with the fused region, by their shares of the vote."""
        ...
    @property
    def answers(self) -> list[dict[str, Any]]:
        """list of dict: what each demonstration said, the most trusted first: name, kind, similarity,
        confidence, verdict, evidence, share of the vote, agreement with the others.
        """
        ...
    @property
    def confidence(self) -> float:
        """float: the probability that the IoU with the true region is at least one half, in [0, 1]."""
        ...
    @property
    def hypotheses(self) -> list[Hypothesis]:
        """list of Hypothesis: where the region may belong, by falling probability."""
        ...
    def picture(self) -> bytes:
        """A picture of who said what, which notebooks show by themselves: `memory.png` of `write`.

        Returns
        -------
        bytes
            PNG.
        """
        ...
    @property
    def region(self) -> Region:
        """Region: the region on the target."""
        ...
    @property
    def report(self) -> dict[str, Any]:
        """dict: the whole report, as ``report.json`` has it."""
        ...
    @property
    def target(self) -> PreparedObject:
        """PreparedObject: the object to act on."""
        ...
    @property
    def verdict(self) -> str:
        """str: ``"accept"``, ``"check"`` or ``"refuse"``."""
        ...
    @property
    def weights(self) -> NDArray[numpy.float64]:
        """(n_target,) float64 array: weight of each target vertex, a read-only view."""
        ...
    @property
    def why(self) -> Optional[str]:
        """str, optional: why the answer is not accepted, where that is known."""
        ...
    def write(self, folder: _Path, *, pictures: bool = True, progress: Optional[_Progress] = None) -> list[str]:
        """Writes every file that `semfm-cli transfer --memory` writes: region, report, painted target, picture.

        Parameters
        ----------
        folder : path
            Made if it is not there.
        pictures : bool, default True
            Also draw ``memory.png``.
        progress : progress, optional

        Returns
        -------
        list of str
            The files.
        """
        ...

class Mesh:
    """A triangle mesh in its own frame and units.

    The arrays are checked once and kept as they are: no vertex is moved, merged or dropped, so that
    a vertex id means the same everywhere. Components, holes, non-manifold edges and degenerate
    triangles are all allowed. A mesh cannot be changed.

    Parameters
    ----------
    vertices : (n, 3) array_like
        Positions, finite.
    faces : (m, 3) array_like
        Vertex ids of each triangle, counter-clockwise seen from outside.

    Raises
    ------
    InvalidInput
        No vertex or no triangle, a coordinate that is not finite, an id out of range.

    Examples
    --------
    >>> import semfm
    >>> mesh = semfm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> mesh
    Mesh(3 vertices, 1 triangles)
    >>> mesh.area
    0.5
    """
    def __init__(self, vertices: ArrayLike, faces: ArrayLike) -> None: ...
    def __eq__(self, other: object) -> bool: ...
    def __hash__(self) -> int: ...
    @property
    def area(self) -> float:
        """float: surface area, in squared units of the mesh."""
        ...
    @property
    def bounds(self) -> NDArray[numpy.float64]:
        """(2, 3) float64 array: lower and upper corner of the bounding box."""
        ...
    @property
    def diagonal(self) -> float:
        """float: length of the bounding box's diagonal."""
        ...
    @property
    def faces(self) -> NDArray[numpy.uint32]:
        """(m, 3) uint32 array: vertex ids of each triangle, a read-only view."""
        ...
    @staticmethod
    def from_open3d(mesh: Any) -> Mesh:
        """The mesh of an `open3d.geometry.TriangleMesh`.

        Parameters
        ----------
        mesh : object
            Anything with `vertices` (n, 3) and `triangles` (m, 3).

        Returns
        -------
        Mesh
        """
        ...
    @staticmethod
    def from_trimesh(mesh: Any) -> Mesh:
        """The mesh of a `trimesh.Trimesh` or `trimesh.Scene` (what ``trimesh.load`` returns for GLB), vertex
        by vertex: load it with ``process=False``, or trimesh will have merged vertices.

        Parameters
        ----------
        mesh : object
            Anything with `vertices` (n, 3) and `faces` (m, 3); or a scene, whose meshes are put behind each
            other in the order of its graph, each where its node stands. Points and lines are left out.

        Returns
        -------
        Mesh
        """
        ...
    @property
    def hash(self) -> str:
        """str: the mesh's name, ``blake3:`` and 64 digits over counts, positions and triangles."""
        ...
    @property
    def n_faces(self) -> int:
        """int: number of triangles m."""
        ...
    @property
    def n_vertices(self) -> int:
        """int: number of vertices n."""
        ...
    def picture(self, *, region: Optional[Union[Region, _Path]] = None) -> bytes:
        """A picture from two sides, which notebooks show by themselves.

        Parameters
        ----------
        region : Region or path, optional
            Painted grey to red by weight; the sides are those from which it is seen best.

        Returns
        -------
        bytes
            PNG.
        """
        ...
    @staticmethod
    def read(path: _Path) -> Mesh:
        """Reads a mesh file in any format of ``mesh_formats()``; polygons are cut to triangles.

        Parameters
        ----------
        path : path
            The file; its format is told by the extension, else by the first bytes.

        Returns
        -------
        Mesh

        See Also
        --------
        read_mesh : the same with the colours of the file.
        """
        ...
    def report(self, *, stored: bool = False) -> dict[str, Any]:
        """What is regular and what is not: edges, components, boundaries, manifoldness.

        They are those of the surface: vertices at the same place (a UV seam, flat shading) count as one.

        Parameters
        ----------
        stored : bool, default False
            Count vertices at the same place apart, as the file stores them.

        Returns
        -------
        dict
            Counts and flags by name, as `semfm-cli info --json` has them.

        Examples
        --------
        >>> import semfm.zoo
        >>> semfm.zoo.icosphere(2).report()["watertight"]
        True
        """
        ...
    def vertex_areas(self) -> NDArray[numpy.float64]:
        """A third of the area of the triangles around each vertex.

        Returns
        -------
        (n,) float64 array
        """
        ...
    @property
    def vertices(self) -> NDArray[numpy.float64]:
        """(n, 3) float64 array: positions, a read-only view."""
        ...
    def weld(self) -> tuple[Mesh, NDArray[numpy.uint32]]:
        """The surface that the vertices describe: those at the same place joined.

        `Laplacian`, `Eigenbasis` and neighbours go by vertex ids, so that a UV seam is a cut to them;
        give them this mesh. `Shape` and `HeatGeodesics` join by themselves.

        Returns
        -------
        Mesh
            The joined mesh (n_joined vertices), triangles in their order.
        (n,) uint32 array
            For each vertex of this mesh, its vertex in the joined one.

        Examples
        --------
        >>> import numpy as np, semfm, semfm.zoo
        >>> ball = semfm.zoo.icosphere(1)
        >>> soup = semfm.Mesh(ball.vertices[ball.faces.ravel()], np.arange(240).reshape(80, 3))
        >>> joined, of_original = soup.weld()
        >>> joined.n_vertices, of_original.shape
        (42, (240,))
        """
        ...
    def write(self, path: _Path, *, colors: Optional[ArrayLike] = None, scalars: Optional[Mapping[str, Any]] = None) -> None:
        """Writes a mesh file, whole or not at all, in a format that ``mesh_formats()`` says is written.

        OBJ, OFF and PLY keep coordinates exactly. GLB and STL have 32 bits a number.

        Parameters
        ----------
        path : path
            The file; its extension names the format.
        colors : (n, 4) array_like, optional
            RGBA bytes of each vertex, in sRGB (uint8). Not for STL.
        scalars : dict, optional
            Names of numbers, (n,) each, kept at the vertices in 32 bits. PLY and GLB only.
        """
        ...

class MeshFile:
    """A mesh file: the mesh and what the file says about its colours."""
    @property
    def format(self) -> str:
        """str: the format, such as ``"ply"``."""
        ...
    @property
    def has_colors(self) -> bool:
        """bool: whether the file has vertex colours, materials or images."""
        ...
    @property
    def mesh(self) -> Mesh:
        """Mesh: the geometry."""
        ...
    @property
    def notes(self) -> list[str]:
        """list of str: what could not be read of the colours, and why."""
        ...
    @property
    def vertex_colors(self) -> Optional[NDArray[numpy.uint8]]:
        """(n, 4) uint8 array, optional: RGBA of each vertex in sRGB; None where the file has none."""
        ...

class Observation:
    """What a camera saw at one moment: colour, depth and masks on one grid of pixels, and the camera.

    Whatever it came from, depth is in metres, 0 is where nothing came back, and the pictures are without
    distortion. `read` makes one of files, `read_observations` of a BOP scene or a bag.

    Parameters
    ----------
    intrinsics : Pinhole or (3, 3) array_like
        The camera, or the matrix of a calibration, counted as by `Pinhole.from_matrix`.
    color : (height, width, 3) array_like, optional
        sRGB, of dtype uint8.
    depth : (height, width) array_like, optional
        Depth along the camera's axis. What is 0 or not finite is no return; nor is 65535 in whole numbers.
    depth_scale : float, optional
        Units of `depth` to the metre; 1000 for whole numbers and 1 for floats where none is given.
    cloud : (n, 3) array_like, optional
        Points in the camera's frame, metres, where the sensor gave them in place of a depth image.
    masks : dict or list of (height, width) array_like, optional
        Which pixels show what, of dtype bool, by name; those of a list are called 0, 1 and so on.
    distortion : (c,) array_like, optional
        Coefficients of the lens in OpenCV's order; the pictures come out without distortion.
    distortion_model : str, optional
        ``"plumb_bob"`` or ``"rational_polynomial"`` (4, 5 or 8 coefficients), or ``"equidistant"`` (4, a fisheye);
        ``"plumb_bob"`` where none is given.
    camera_from_world : (4, 4) array_like, optional
        Where the camera stood; that of a `Pinhole`, else its own frame is the world, where none is given.
    time_nanos : int, optional
        When it was, in nanoseconds.

    Raises
    ------
    InvalidInput
        Pictures of different sizes, a mask that marks nothing or everything, an argument that nothing would read
        (`depth_scale` without `depth`). A depth image in which nothing came back is none of it.

    Examples
    --------
    >>> import numpy as np
    >>> import semfm
    >>> depth = np.full((48, 64), 0.7)
    >>> depth[16:32, 20:44] = 0.5
    >>> k = [[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]]
    >>> seen = semfm.Observation(k, depth=depth, masks={"box": depth < 0.6})
    >>> seen
    Observation(64 × 48, depth, 1 mask)
    >>> seen.cloud("box").shape
    (384, 3)
    >>> seen.surface().mesh
    Mesh(308 vertices, 546 triangles)
    """
    def __init__(self, intrinsics: Union[Pinhole, ArrayLike], *, color: Optional[ArrayLike] = None, depth: Optional[ArrayLike] = None, depth_scale: Optional[float] = None, cloud: Optional[ArrayLike] = None, masks: Optional[Union[Mapping[str, Any], Iterable[ArrayLike]]] = None, distortion: Optional[ArrayLike] = None, distortion_model: Optional[str] = None, camera_from_world: Optional[ArrayLike] = None, time_nanos: Optional[int] = None) -> None: ...
    def __eq__(self, other: object) -> bool: ...
    @property
    def camera(self) -> Pinhole:
        """Pinhole: the camera, in the world that its pose says."""
        ...
    def cloud(self, mask: Optional[Union[str, ArrayLike]] = None) -> NDArray[numpy.float64]:
        """The points that were seen, or those under a mask, for `align` and for scenes of `find_grasps`.

        Parameters
        ----------
        mask : str or (height, width) array_like, optional
            A mask by name, or an array of dtype bool; all points where none is given.

        Returns
        -------
        (n, 3) float64 array
            In the camera's own frame (x right, y down, z forward), metres.
        """
        ...
    @property
    def color(self) -> Optional[NDArray[numpy.uint8]]:
        """(height, width, 3) uint8 array, optional: sRGB, a read-only view; None where there is no picture."""
        ...
    @property
    def depth(self) -> Optional[NDArray[numpy.float32]]:
        """(height, width) float32 array, optional: metres along the camera's axis, 0 where nothing came back, a read-only
        view; None where there is no depth image.
        """
        ...
    @property
    def masks(self) -> dict[str, Any]:
        """dict: (height, width) bool arrays by name, in the order of their files, read-only views."""
        ...
    @property
    def objects(self) -> list[dict[str, Any]]:
        """list of dict: objects whose poses somebody knew, as in a BOP scene: ``id``, ``camera_from_object`` (4, 4) in
        metres, and the name of its ``mask`` or None.
        """
        ...
    def picture(self) -> bytes:
        """The colours, or the depth where there are none, as notebooks show them by themselves.

        Returns
        -------
        bytes
            PNG.
        """
        ...
    @staticmethod
    def read(intrinsics: _Path, *, color: Optional[_Path] = None, depth: Optional[_Path] = None, depth_scale: Optional[float] = None, mask: Optional[Union[_Path, Iterable[_Path], Mapping[str, Any]]] = None, hand_mask: Optional[_Path] = None, camera_from_world: Optional[Union[_Path, ArrayLike]] = None) -> Observation:
        """Reads an observation of single files, as ``semfm-cli frames`` does: see `docs/observations.md` for their forms.

        Parameters
        ----------
        intrinsics : path
            The camera (JSON); a lens that distorts is taken out of the pictures.
        color : path, optional
            A PNG, JPEG or EXR.
        depth : path, optional
            A 16-bit PNG, an EXR or .npy, registered to the colour.
        depth_scale : float, optional
            Units of the depth to the metre; 1000 for whole numbers and 1 for floats where none is given.
        mask : path or list of path or dict, optional
            What the pixels show, ``FILE`` or ``FILE#LABEL``; called as its file is, or as the dict says.
        hand_mask : path, optional
            The pixels of a hand: one more mask, called ``hand``.
        camera_from_world : path or (4, 4) array_like, optional
            Where the camera stood.

        Returns
        -------
        Observation
        """
        ...
    def surface(self, mask: Optional[Union[str, ArrayLike]] = None, *, smooth_pixels: int = 3, trim_pixels: int = 1, most_vertices: int = 20000) -> ObservedObject:
        """What the camera saw of an object as an object, in the camera's own frame, metres: what ``semfm-cli surface``
        makes. Several frames of known poses: `merged_surface`.

        Parameters
        ----------
        mask : str or (height, width) array_like, optional
            The object's mask: a name, an array of dtype bool, or the only one that there is where none is given; without
            any, all that was seen is the object.
        smooth_pixels : int, default 3
            Radius of the window in which depth is smoothed, 0 to 20.
        trim_pixels : int, default 1
            Pixels along the mask's outline that are left out, 0 to 100.
        most_vertices : int, default 20000
            Of a larger picture every second pixel is taken, or fewer.

        Returns
        -------
        ObservedObject
        """
        ...
    def surroundings(self, mask: Optional[Union[str, ArrayLike]] = None) -> NDArray[numpy.float64]:
        """Points of what was seen beside an object, as obstacles of grasps: one in 4 mm, within 0.4 m of it.

        Parameters
        ----------
        mask : str or (height, width) array_like, optional
            The object's mask: a name, an array of dtype bool, or the only one that there is where none is given.

        Returns
        -------
        (n, 3) float64 array
            In the camera's own frame, metres.
        """
        ...
    @property
    def time_nanos(self) -> Optional[int]:
        """int, optional: when it was, in nanoseconds of its recorder's clock; None where nobody said."""
        ...

class Observations:
    """The frames of a BOP scene or of a bag, in order: an iterator of `Observation`, made by `read_observations`.

    Reading begins at once, in a thread of its own, and stays up to two frames ahead of what was asked for; a source of any
    length needs the memory of some frames. What nobody iterates any more is not read on. A process that was forked off has
    no such thread: it raises `InvalidInput`.
    """
    def __iter__(self) -> Observations: ...
    def __next__(self) -> Observation: ...
    @property
    def notes(self) -> list[str]:
        """list of str: what was chosen or left out (topics, messages without a counterpart), known at the end."""
        ...

class ObservedObject:
    """What a depth camera saw of an object, as an object: the surface with the pictures' colours and what lies around it.

    Made by `Observation.surface` and `merged_surface`. Its mesh and the embeddings that `embed` makes are taken by
    `transfer`, `prepare` and `find_grasps` like those of any other object.

    Examples
    --------
    >>> import numpy as np
    >>> import semfm
    >>> mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=800) for i in (0, 1))
    >>> camera = semfm.rig(kettle.mesh, count=2, size=96)[0]
    >>> view = semfm.render(kettle.mesh, [camera])[0]
    >>> depth = np.where(np.isfinite(view.depth), view.depth, 0)
    >>> seen = semfm.Observation(camera, depth=depth, masks={"kettle": view.triangles >= 0}).surface()
    >>> result = semfm.transfer(mug.mesh, seen.mesh, mug.region, target_embeddings=seen.embed())
    >>> result.region.n_vertices == seen.mesh.n_vertices
    True
    """
    @property
    def around(self) -> NDArray[numpy.float64]:
        """(m, 3) float64 array: points of what was seen beside the object, in the frame of `mesh`, metres: obstacles
        (``scene_points``) of `find_grasps`.
        """
        ...
    @property
    def cameras(self) -> list[Pinhole]:
        """list of Pinhole: the cameras in the frame of `mesh`."""
        ...
    @property
    def colors(self) -> Optional[NDArray[numpy.uint8]]:
        """(n, 3) uint8 array, optional: sRGB of each vertex, a read-only view; None where a frame has no colours."""
        ...
    def embed(self, *, encoder: str = 'builtin', rolls: Optional[int] = None, views: Optional[str] = None, progress: Optional[_Progress] = None) -> Embeddings:
        """Embeddings for `transfer` and `prepare`: of the pictures, of the surface rendered from where it was seen, or of both.

        Parameters
        ----------
        encoder : str, default "builtin"
            ``builtin``, a ``.net`` file, a Hugging Face name, a local checkpoint, an ONNX encoder's JSON,
            or ``package.module:Class``.
        rolls : int, optional
            Rotations of each view that are averaged, 1, 2 or 4; what the encoder wants where none is given.
        views : str, optional
            What the encoder is shown: ``"pictures"``, ``"surface"`` or ``"both"``; what suits it where none is given:
            ``"surface"`` where it was trained on grey views, as the built-in one, or where there are no colours.
        progress : progress, optional

        Returns
        -------
        Embeddings
        """
        ...
    @property
    def mesh(self) -> Mesh:
        """Mesh: the surface, metres, in its camera's own frame; in that of the cameras' poses where it was merged."""
        ...
    @property
    def notes(self) -> list[str]:
        """list of str: which frames `merged_surface` left out, and why, as ``semfm-cli surface --merge`` prints it."""
        ...
    @property
    def observations(self) -> list[Observation]:
        """list of Observation: the frames."""
        ...
    def picture(self) -> bytes:
        """A picture of the surface in its colours, which notebooks show by themselves.

        Returns
        -------
        bytes
            PNG.
        """
        ...
    @property
    def report(self) -> dict[str, Any]:
        """dict: where it comes from and what became of the pixels, as `surface.json` of ``semfm-cli surface`` has it."""
        ...
    def write(self, folder: _Path, *, embeddings: Optional[Embeddings] = None, progress: Optional[_Progress] = None) -> list[str]:
        """Writes the folder that ``semfm-cli surface`` writes: `surface.ply`, `surface.emb.mcap`, `surface.views.mcap`,
        `around.ply` and `surface.json`.

        Parameters
        ----------
        folder : path
            Made if it is not there.
        embeddings : Embeddings, optional
            From `embed`; without them `surface.emb.mcap` is not written.
        progress : progress, optional

        Returns
        -------
        list of str
            The files.
        """
        ...

class PatchEmbeddings:
    """What an encoder says about a view: one vector per image patch.

    Parameters
    ----------
    data : (rows, cols, d) array_like
        Vectors, top-left patch first; finite in valid patches.
    rect : (4,) array_like
        The grid's rectangle in pixels, edges not centres: left, top, right, bottom.
    coverage : (rows, cols) array_like, optional
        Share of each patch covered by the object, 0 to 255 (uint8); 255 where none is given.
    valid : (rows, cols) array_like, optional
        False where the patch is to be ignored (bool).
    """
    def __init__(self, data: ArrayLike, rect: ArrayLike, *, coverage: Optional[ArrayLike] = None, valid: Optional[ArrayLike] = None) -> None: ...
    @property
    def coverage(self) -> NDArray[numpy.uint8]:
        """(rows, cols) uint8 array: share of each patch covered by the object, a read-only view."""
        ...
    @property
    def data(self) -> NDArray[numpy.float32]:
        """(rows, cols, d) float32 array: the vectors, a read-only view."""
        ...
    @property
    def dim(self) -> int:
        """int: dimension d of each vector."""
        ...
    @property
    def rect(self) -> NDArray[numpy.float32]:
        """(4,) float32 array: left, top, right, bottom of the grid in pixels."""
        ...
    @property
    def valid(self) -> NDArray[numpy.bool_]:
        """(rows, cols) bool array: False where the patch is to be ignored, a read-only view."""
        ...

class Pinhole:
    """A pinhole camera without distortion: x right, y down, z forward, in the units of the world.

    A point (x, y, z) of the camera's frame projects to ``u = fx x / z + cx``, ``v = fy y / z + cy``
    in pixels, where the centre of pixel (0, 0) is at (½, ½). The world is the frame that the camera
    stands in: an object's in rendered views. The two constructors differ in how the numbers that
    they are given count pixels.

    Examples
    --------
    >>> import numpy as np
    >>> import semfm
    >>> camera = semfm.Pinhole.with_pixel_centres_at_half(64, 48, 70, 70, 32, 24, np.eye(4))
    >>> camera.project([[0, 0, 2]]).tolist()
    [[32.0, 24.0, 2.0]]
    >>> camera == semfm.Pinhole.with_pixel_centres_at_integers(
    ...     64, 48, 70, 70, 31.5, 23.5, np.eye(4))
    True
    """
    def __eq__(self, other: object) -> bool: ...
    @property
    def camera_from_world(self) -> NDArray[numpy.float64]:
        """(4, 4) float64 array: rigid motion from the world's frame to the camera's."""
        ...
    def cloud(self, depth: ArrayLike, *, mask: Optional[ArrayLike] = None) -> NDArray[numpy.float64]:
        """The points of a depth image, for `align` and for scenes of `find_grasps`.

        Parameters
        ----------
        depth : (height, width) array_like
            Depth along the camera's axis, in metres for `align`. What is 0, negative or not finite is no
            point.
        mask : (height, width) array_like, optional
            Of dtype bool: only the pixels where it is true.

        Returns
        -------
        (n, 3) float64 array
            In the world's frame, row by row of the image.

        Examples
        --------
        >>> import numpy as np
        >>> import semfm
        >>> camera = semfm.Pinhole.from_matrix([[50, 0, 1], [0, 50, 1], [0, 0, 1]], 3, 3)
        >>> depth = np.zeros((3, 3))
        >>> depth[1, 1] = 0.5
        >>> camera.cloud(depth).tolist()
        [[0.0, 0.0, 0.5]]
        """
        ...
    @property
    def cx(self) -> float:
        """float: principal point, x, in pixels."""
        ...
    @property
    def cy(self) -> float:
        """float: principal point, y, in pixels."""
        ...
    @property
    def eye(self) -> NDArray[numpy.float64]:
        """(3,) float64 array: where the camera stands, in the world's frame."""
        ...
    @staticmethod
    def from_matrix(matrix: ArrayLike, width: int, height: int, *, camera_from_world: Optional[ArrayLike] = None) -> Pinhole:
        """A camera from a calibration's matrix ``[[fx, 0, cx], [0, fy, cy], [0, 0, 1]]``, counted as by
        `with_pixel_centres_at_integers`.

        Parameters
        ----------
        matrix : (3, 3) array_like
            K of OpenCV, ROS `CameraInfo` and most calibration tools, in pixels.
        width : int
            Pixels.
        height : int
            Pixels.
        camera_from_world : (4, 4) array_like, optional
            Rigid motion from the world's frame to the camera's, as a homogeneous matrix; without one
            the camera's own frame is the world.

        Returns
        -------
        Pinhole

        Examples
        --------
        >>> import semfm
        >>> camera = semfm.Pinhole.from_matrix([[70, 0, 31.5], [0, 70, 23.5], [0, 0, 1]], 64, 48)
        >>> camera.cx, camera.cy
        (32.0, 24.0)
        """
        ...
    @property
    def fx(self) -> float:
        """float: focal length along x, in pixels."""
        ...
    @property
    def fy(self) -> float:
        """float: focal length along y, in pixels."""
        ...
    @property
    def height(self) -> int:
        """int: pixels."""
        ...
    def project(self, points: ArrayLike) -> NDArray[numpy.float64]:
        """Pixel position and depth of points.

        Parameters
        ----------
        points : (n, 3) array_like
            In the world's frame.

        Returns
        -------
        (n, 3) float64 array
            u, v, and depth z; u and v mean nothing where z ≤ 0.
        """
        ...
    def rays(self, pixels: ArrayLike) -> NDArray[numpy.float64]:
        """Directions of the lines of sight through pixel positions. They start at `eye`.

        Parameters
        ----------
        pixels : (n, 2) array_like
            u to the right and v down, in pixels; the centre of pixel (0, 0) is at (½, ½).

        Returns
        -------
        (n, 3) float64 array
            In the world's frame, scaled so that the depth is 1: the point at depth z is
            ``eye + z * ray``.

        Examples
        --------
        >>> import semfm
        >>> camera = semfm.Pinhole.with_pixel_centres_at_half(64, 48, 70, 70, 32, 24)
        >>> camera.rays([[32, 24], [67, 24]]).tolist()
        [[0.0, 0.0, 1.0], [0.5, 0.0, 1.0]]
        """
        ...
    def unproject(self, pixels: ArrayLike) -> NDArray[numpy.float64]:
        """The points that the camera sees at pixel positions and depths: undoes `project`.

        Parameters
        ----------
        pixels : (n, 3) array_like
            u, v, and depth z along the camera's axis, as `project` gives them.

        Returns
        -------
        (n, 3) float64 array
            In the world's frame.
        """
        ...
    @property
    def width(self) -> int:
        """int: pixels."""
        ...
    @staticmethod
    def with_pixel_centres_at_half(width: int, height: int, fx: float, fy: float, cx: float, cy: float, camera_from_world: Optional[ArrayLike] = None) -> Pinhole:
        """A camera whose numbers count as ours do: the centre of pixel (0, 0) is at (½, ½).

        Parameters
        ----------
        width : int
            Pixels.
        height : int
            Pixels.
        fx : float
            Focal length along x, in pixels.
        fy : float
            Focal length along y, in pixels.
        cx : float
            Principal point, x, in pixels.
        cy : float
            Principal point, y, in pixels.
        camera_from_world : (4, 4) array_like, optional
            Rigid motion from the world's frame to the camera's, as a homogeneous matrix; without one
            the camera's own frame is the world.

        Returns
        -------
        Pinhole
        """
        ...
    @staticmethod
    def with_pixel_centres_at_integers(width: int, height: int, fx: float, fy: float, cx: float, cy: float, camera_from_world: Optional[ArrayLike] = None) -> Pinhole:
        """A camera whose numbers come from a calibration (OpenCV, ROS `CameraInfo`), in which the centre
        of pixel (0, 0) is at (0, 0): half a pixel is added to its principal point.

        Parameters
        ----------
        width : int
            Pixels.
        height : int
            Pixels.
        fx : float
            Focal length along x, in pixels.
        fy : float
            Focal length along y, in pixels.
        cx : float
            Principal point, x, in pixels.
        cy : float
            Principal point, y, in pixels.
        camera_from_world : (4, 4) array_like, optional
            Rigid motion from the world's frame to the camera's, as a homogeneous matrix; without one
            the camera's own frame is the world.

        Returns
        -------
        Pinhole
        """
        ...

class PointMap:
    """A map target → source: ``source_of[j]`` is the source vertex matched to target vertex ``j``.

    Functions and regions therefore travel source → target, by being looked up.

    Parameters
    ----------
    source_of : (n_target,) array_like
        Vertex ids of the source.
    n_source : int
        Number of source vertices.

    Examples
    --------
    >>> import semfm
    >>> to_source = semfm.PointMap([2, 0, 2], n_source=3)
    >>> to_source.pull_back([10.0, 20.0, 30.0]).tolist()
    [30.0, 10.0, 30.0]
    """
    def __init__(self, source_of: ArrayLike, n_source: int) -> None: ...
    def __eq__(self, other: object) -> bool: ...
    def __len__(self) -> int: ...
    @staticmethod
    def from_npz(path: _Path) -> PointMap:
        """Reads what `to_npz` wrote.

        Parameters
        ----------
        path : path

        Returns
        -------
        PointMap
        """
        ...
    @property
    def n_source(self) -> int:
        """int: number of source vertices."""
        ...
    @property
    def n_target(self) -> int:
        """int: number of target vertices."""
        ...
    def pull_back(self, function: ArrayLike) -> NDArray[Any]:
        """A function on the source, looked up from the target: ``function[source_of]``.

        Parameters
        ----------
        function : (n_source, ...) array_like
            Of any dtype, one entry (or row) per source vertex.

        Returns
        -------
        (n_target, ...) array
        """
        ...
    @staticmethod
    def read(path: _Path) -> PointMap:
        """Reads the `point_map.json` of a transfer's folder.

        Parameters
        ----------
        path : path

        Returns
        -------
        PointMap

        See Also
        --------
        read_transfer : the whole folder.
        """
        ...
    @property
    def source_of(self) -> NDArray[numpy.uint32]:
        """(n_target,) uint32 array: the source vertex of each target vertex, a read-only view."""
        ...
    def to_npz(self, path: _Path) -> None:
        """Writes `source_of` and `n_source` to an .npz file.

        Parameters
        ----------
        path : path
        """
        ...

class PreciseMap:
    """A map target → source that sends each target vertex to a point on a source triangle.

    Ezuz & Ben-Chen, "Deblurring and Denoising of Maps between Shapes", 2017. Made by
    `FunctionalMap.to_precise_map`.

    Parameters
    ----------
    face_of : (n_target,) array_like
        Source triangle of each target vertex.
    corners : (n_target, 3) array_like
        The source vertices of those triangles.
    barycentric : (n_target, 3) array_like
        Coordinates on those vertices: at least 0, sum 1.
    n_source : int
        Number of source vertices.

    See Also
    --------
    PointMap : the map of vertices to vertices.
    """
    def __init__(self, face_of: ArrayLike, corners: ArrayLike, barycentric: ArrayLike, n_source: int) -> None: ...
    def __eq__(self, other: object) -> bool: ...
    def __len__(self) -> int: ...
    @property
    def barycentric(self) -> NDArray[numpy.float64]:
        """(n_target, 3) float64 array: barycentric coordinates on those vertices, a read-only view."""
        ...
    @property
    def corners(self) -> NDArray[numpy.uint32]:
        """(n_target, 3) uint32 array: the source vertices of those triangles, a read-only view."""
        ...
    @property
    def face_of(self) -> NDArray[numpy.uint32]:
        """(n_target,) uint32 array: the source triangle of each target vertex, a read-only view."""
        ...
    @property
    def n_source(self) -> int:
        """int: number of source vertices."""
        ...
    @property
    def n_target(self) -> int:
        """int: number of target vertices."""
        ...
    def pull_back(self, function: ArrayLike) -> NDArray[numpy.float64]:
        """A function on the source that is linear on its triangles, as the target's vertices find it.

        Parameters
        ----------
        function : (n_source,) array_like

        Returns
        -------
        (n_target,) float64 array
        """
        ...
    def to_csr(self) -> tuple[NDArray[numpy.float64], NDArray[numpy.uint32], NDArray[numpy.uint32]]:
        """The map as a matrix (n_target × n_source) by rows, for
        ``scipy.sparse.csr_matrix((data, indices, indptr), shape)``.

        Returns
        -------
        data : (n,) float64 array
        indices : (n,) uint32 array
        indptr : (n_target + 1,) uint32 array
        """
        ...
    def to_point_map(self) -> PointMap:
        """The map of vertices that takes the corner of largest weight.

        Returns
        -------
        PointMap
        """
        ...

class PreparedObject:
    """An object ready to be matched: its shape and its semantic cloud.

    Made by `prepare`. Semantic parts are cut at the first matching and kept.
    """
    @property
    def cloud(self) -> SemanticCloud:
        """SemanticCloud: surface points with features."""
        ...
    @property
    def encoder(self) -> Optional[dict[str, Any]]:
        """dict, optional: name, version, rolls and number of views of the encoder behind the features; None where it is not known."""
        ...
    @property
    def from_cache(self) -> bool:
        """bool: whether the shape was read from the cache."""
        ...
    @property
    def mesh(self) -> Mesh:
        """Mesh: the mesh as given."""
        ...
    @property
    def shape(self) -> Shape:
        """Shape: working mesh and eigenbasis."""
        ...
    @property
    def stages_ms(self) -> dict[str, Any]:
        """dict: milliseconds by stage."""
        ...

class Region:
    """A region (an affordance): a weight in [0, 1] for each vertex of a mesh.

    A vertex counts where its weight is at least one half. The vertex ids are those of the mesh as
    read.

    Parameters
    ----------
    weights : (n,) array_like

    Examples
    --------
    >>> import semfm
    >>> grip = semfm.Region.from_vertices(5, [3, 1])
    >>> grip.vertices.tolist()
    [1, 3]
    >>> grip.mask.tolist()
    [False, True, False, True, False]
    """
    def __init__(self, weights: ArrayLike) -> None: ...
    def __eq__(self, other: object) -> bool: ...
    def __len__(self) -> int: ...
    @staticmethod
    def from_mask(inside: ArrayLike) -> Region:
        """A region of full weight where a mask is true.

        Parameters
        ----------
        inside : (n,) array_like
            Of dtype bool.

        Returns
        -------
        Region
        """
        ...
    @staticmethod
    def from_vertices(n_vertices: int, vertices: ArrayLike) -> Region:
        """A region of full weight on some vertices.

        Parameters
        ----------
        n_vertices : int
            Vertices of the mesh.
        vertices : (v,) array_like
            Ids, which may repeat.

        Returns
        -------
        Region
        """
        ...
    def grown(self, mesh: _MeshLike, *, camera: Optional[Pinhole] = None) -> Region:
        """The part that the region belongs to, where one camera saw it: the hidden side is added.

        A region that is known all around stays as it is. What was seen keeps its weight, what is added
        has weight 1.

        Parameters
        ----------
        mesh : mesh_like
            The mesh it belongs to.
        camera : Pinhole, optional
            The camera that saw it: what it sees beside the region is outside of the part. Without one,
            the camera is looked for.

        Returns
        -------
        Region

        Examples
        --------
        >>> import numpy as np, semfm, semfm.zoo
        >>> torus = semfm.zoo.torus(40, 20)
        >>> half = semfm.Region.from_mask(torus.vertices[:, 0] > 0)
        >>> half.is_one_sided(torus), half.grown(torus) == half
        (False, True)
        """
        ...
    def iou(self, truth: Region, areas: Optional[ArrayLike] = None) -> float:
        """Intersection over union with the true region, in vertices or in areas.

        Parameters
        ----------
        truth : Region
            Of the same mesh.
        areas : (n,) array_like, optional
            Area of each vertex (`Mesh.vertex_areas`); vertices are counted where none are given.

        Returns
        -------
        float
            0 where both are empty.
        """
        ...
    @property
    def is_empty(self) -> bool:
        """bool: whether no vertex counts."""
        ...
    def is_one_sided(self, mesh: _MeshLike) -> bool:
        """Whether the region is what one camera sees of a part, which `grown` would complete.

        Parameters
        ----------
        mesh : mesh_like
            The mesh it belongs to.

        Returns
        -------
        bool
        """
        ...
    @property
    def mask(self) -> NDArray[numpy.bool_]:
        """(n,) bool array: whether each vertex counts."""
        ...
    @staticmethod
    def masked(mesh: _MeshLike, camera: Pinhole, mask: ArrayLike) -> Region:
        """All vertices that a camera sees inside a mask.

        Parameters
        ----------
        mesh : mesh_like
        camera : Pinhole
        mask : (height, width) array_like
            Of dtype bool, of the camera's size.

        Returns
        -------
        Region
        """
        ...
    @property
    def n_vertices(self) -> int:
        """int: vertices of the mesh, inside or not."""
        ...
    @staticmethod
    def near(mesh: _MeshLike, contact: ArrayLike, radius: float) -> Region:
        """All vertices within a geodesic radius of the surface point nearest to a contact.

        Parameters
        ----------
        mesh : mesh_like
        contact : (3,) array_like
            In the mesh's frame and units; refused where it is farther from the surface than 0.3 of
            the bounding box's diagonal.
        radius : float
            In the mesh's units.

        Returns
        -------
        Region

        Examples
        --------
        >>> import semfm, semfm.zoo
        >>> cap = semfm.Region.near(semfm.zoo.icosphere(3), [0, 0, 2], radius=0.5)
        >>> 30 < len(cap.vertices) < 50
        True
        """
        ...
    @staticmethod
    def painted(file: MeshFile, paint: Optional[tuple[int, int, int]] = None) -> Region:
        """All vertices painted red, or in the paint given.

        Parameters
        ----------
        file : MeshFile
            A mesh with vertex colours, from `read_mesh`.
        paint : tuple of int, int, int, optional
            sRGB, each 0 to 255.

        Returns
        -------
        Region
        """
        ...
    @staticmethod
    def read(path: _Path, mesh: _MeshLike) -> Region:
        """Reads a region file of a mesh.

        Parameters
        ----------
        path : path
            JSON: ``{"vertices": […], "weights": […]}``, bare or under ``"region"``.
        mesh : mesh_like
            The mesh it belongs to; where the file names another one, that is an error.

        Returns
        -------
        Region
        """
        ...
    def to_json(self, mesh: _MeshLike) -> str:
        """The region file's content as text.

        Parameters
        ----------
        mesh : mesh_like
            The mesh it belongs to.

        Returns
        -------
        str
        """
        ...
    @property
    def vertices(self) -> NDArray[numpy.uint32]:
        """(v,) uint32 array: ids of the vertices that count, ascending."""
        ...
    @property
    def weights(self) -> NDArray[numpy.float64]:
        """(n,) float64 array: weight of each vertex, a read-only view."""
        ...
    def write(self, path: _Path, mesh: _MeshLike) -> None:
        """Writes a region file, whole or not at all.

        Parameters
        ----------
        path : path
        mesh : mesh_like
            The mesh it belongs to.
        """
        ...

class Robot:
    """An arm: the joints of a robot between a base and a tip. Joint values are arrays of n numbers, base to tip,
    radians or metres; poses are (4, 4) matrices in the base link's frame, metres.

    Made by `Robot.from_urdf`.

    Examples
    --------
    >>> import math, pathlib, semfm, tempfile
    >>> link = '<link name="{}"/>'
    >>> joint = '''<joint name="{0}{1}" type="revolute"><parent link="{0}"/><child link="{1}"/>
    ... <origin xyz="{2} 0 0"/><axis xyz="0 0 1"/><limit lower="-3" upper="3" velocity="1" effort="1"/></joint>'''
    >>> hand = '<joint name="h" type="fixed"><parent link="c"/><child link="d"/><origin xyz=".5 0 0"/></joint>'
    >>> parts = [*map(link.format, "abcd"), joint.format("a", "b", 0), joint.format("b", "c", 0.5), hand]
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "planar.urdf"
    >>> _ = path.write_text(f'<robot name="planar">{"".join(parts)}</robot>')
    >>> robot = semfm.Robot.from_urdf(path, tip="d")
    >>> robot.joint_names
    ['ab', 'bc']
    >>> pose = robot.forward([math.pi / 6, math.pi / 3])
    >>> pose[:3, 3].round(3).tolist()
    [0.433, 0.75, 0.0]
    >>> robot.solve_ik(pose)["solutions"].round(3).tolist()
    [[0.524, 1.047]]
    """
    @property
    def acceleration_limits(self) -> NDArray[numpy.float64]:
        """(n,) float64 array: greatest acceleration of each joint, per second squared."""
        ...
    @property
    def base(self) -> str:
        """str: the link in whose frame poses are told."""
        ...
    def forward(self, q: ArrayLike) -> NDArray[numpy.float64]:
        """The pose of the tip (forward kinematics). Limits are not asked for.

        Parameters
        ----------
        q : (n,) array_like
            Joint values.

        Returns
        -------
        (4, 4) float64 array
        """
        ...
    @staticmethod
    def from_urdf(urdf: _Path, *, srdf: Optional[_Path] = None, limits: Optional[_Path] = None, base: Optional[str] = None, tip: Optional[str] = None, fixed: Optional[Mapping[str, Any]] = None, packages: Optional[Mapping[str, Any]] = None) -> Robot:
        """Reads an arm from its files.

        Parameters
        ----------
        urdf : path
            Links and joints.
        srdf : path, optional
            The chain that is meant as the arm, and named states.
        limits : path, optional
            Joint limits as MoveIt writes them (``joint_limits.yaml``).
        base : str, optional
            The link in whose frame poses are told; by default the SRDF's, or the root.
        tip : str, optional
            The link that the arm moves; by default the SRDF's, or the end of the one chain of joints.
        fixed : dict, optional
            Positions of joints outside the chain by name, such as fingers.
        packages : dict, optional
            Folders by the names of packages in ``package://NAME/…``; for `plan`, which needs every collision mesh.

        Returns
        -------
        Robot
        """
        ...
    def jacobian(self, q: ArrayLike) -> NDArray[numpy.float64]:
        """How fast the tip moves for each joint.

        Parameters
        ----------
        q : (n,) array_like
            Joint values.

        Returns
        -------
        (6, n) float64 array
            Linear above angular velocity of the tip's frame, in the base's frame.
        """
        ...
    @property
    def joint_names(self) -> list[str]:
        """list of str: names of the joints, base to tip."""
        ...
    @property
    def limits(self) -> NDArray[numpy.float64]:
        """(n, 2) float64 array: lowest and highest position of each joint; infinite where there is no limit."""
        ...
    def link_poses(self, q: ArrayLike) -> dict[str, Any]:
        """The pose of every link. Joints outside the chain stand where they were fixed, mimics follow.

        Parameters
        ----------
        q : (n,) array_like
            Joint values.

        Returns
        -------
        dict
            (4, 4) float64 arrays by the names of the links.
        """
        ...
    def manipulability(self, q: ArrayLike) -> float:
        """How easily the tip moves in every direction (Yoshikawa's measure); zero at a singular position.

        Parameters
        ----------
        q : (n,) array_like
            Joint values.

        Returns
        -------
        float
        """
        ...
    @property
    def n_joints(self) -> int:
        """int: number of joints."""
        ...
    @property
    def name(self) -> str:
        """str: as in the URDF."""
        ...
    @property
    def notes(self) -> list[str]:
        """list of str: what was found, assumed or passed over when the files were read."""
        ...
    def solve_ik(self, pose: ArrayLike, *, near: Optional[Union[ArrayLike, str]] = None, solutions: int = 8, restarts: int = 50, seed: int = 0, preference: str = 'none') -> dict[str, Any]:
        """Joint values that bring the tip to a pose (inverse kinematics). Each solution was checked by forward kinematics.

        Parameters
        ----------
        pose : (4, 4) array_like
            Where the tip shall be, in the base's frame.
        near : (n,) array_like or str, optional
            Where the search begins, or a state of the SRDF; by default zero, or the limit next to it.
        solutions : int, default 8
            Distinct solutions to look for: more than .1 rad apart, whole turns aside.
        restarts : int, default 50
            Random starts in a row without a new solution after which the search ends.
        seed : int, default 0
            Of the random starts.
        preference : str, default "none"
            What an arm with more joints than it needs does with them: ``"none"``, ``"near"`` (to where the search
            began), ``"limits"`` (away from them) or ``"manipulability"``.

        Returns
        -------
        dict
            ``solutions`` (k, n), the nearest to `near` first, with ``position_errors`` (k,), metres, and
            ``rotation_errors`` (k,), radians; where none was found, ``closest`` is a dict of ``positions`` (n,),
            ``position_error`` and ``rotation_error`` of the best try, else None; ``tries``, how often the search began.
        """
        ...
    def state(self, name: str) -> NDArray[numpy.float64]:
        """Joint values of a state that the SRDF names.

        Parameters
        ----------
        name : str
            Of the state.

        Returns
        -------
        (n,) float64 array
        """
        ...
    @property
    def tip(self) -> str:
        """str: the link that the arm moves."""
        ...
    @property
    def velocity_limits(self) -> NDArray[numpy.float64]:
        """(n,) float64 array: greatest speed of each joint, per second."""
        ...

class RunResult:
    """How a run from pictures to grasps went, stage by stage: see `run`."""
    def file(self, stage: str, name: str) -> str:
        """The path of a file of a stage, such as ``file("target-pose", "aligned.json")`` or ``file("grasp", "grasps.json")``.

        Parameters
        ----------
        stage : str
            Its name as `stages` has it, such as ``"region"`` or ``"grasp"``.
        name : str
            One of the stage's ``files``.

        Returns
        -------
        str
        """
        ...
    @property
    def folder(self) -> str:
        """str: the folder."""
        ...
    @property
    def grasps(self) -> Optional[dict[str, Any]]:
        """dict, optional: the grasps, as `grasps.json` has them; None where none were asked for, or the run did not come so
        far. Its file (`file`) is what `plan` takes.
        """
        ...
    @property
    def no_answer(self) -> Optional[dict[str, Any]]:
        """dict, optional: why there is no answer: ``reason``, and what to do ``next``; None where there is one."""
        ...
    @property
    def page(self) -> str:
        """str: the page that shows how it went, in the folder."""
        ...
    @property
    def region(self) -> Optional[Region]:
        """Region, optional: the region on the target; None where the run did not come so far."""
        ...
    @property
    def stages(self) -> list[dict[str, Any]]:
        """list of dict: the stages in their order, up to the first without an answer: ``stage``, its ``state``, ``seconds``
        when it was done, ``summary`` in words, and the names of its ``files``.
        """
        ...
    @property
    def states(self) -> dict[str, Any]:
        """dict: by stage, ``"done"`` where this run did it, ``"kept"`` where its inputs and settings were those of an earlier run."""
        ...
    def to_dict(self) -> dict[str, Any]:
        """The content of `run.json`.

        Returns
        -------
        dict
        """
        ...
    @property
    def transfer(self) -> Optional[StoredTransfer]:
        """StoredTransfer, optional: both objects, the region on each and how sure that is; None where the run did not come
        so far.
        """
        ...

class Scene:
    """What stands around an arm, in the frame of the arm's base, metres: each thing with a name of its own. A scene does not
    change; ``with_…`` gives a new one.

    Examples
    --------
    >>> import semfm
    >>> scene = semfm.Scene().with_table("table", point=[0, 0, 0]).with_box("shelf", size=[0.6, 0.3, 0.02])
    >>> scene.names
    ['table', 'shelf']
    """
    def __init__(self) -> None: ...
    def __len__(self) -> int: ...
    @property
    def names(self) -> list[str]:
        """list of str: names of what stands there."""
        ...
    @staticmethod
    def read(paths: Union[_Path, Iterable[_Path]]) -> Scene:
        """Reads `scene.json`, meshes (metres) and point clouds; meshes and clouds are named after their files.

        Parameters
        ----------
        paths : path or list of path
            At most one of them is a `scene.json`.

        Returns
        -------
        Scene
        """
        ...
    def with_box(self, name: str, *, size: ArrayLike, pose: Optional[ArrayLike] = None) -> Scene:
        """With a box around its own origin.

        Parameters
        ----------
        name : str
        size : (3,) array_like
            Lengths along x, y and z.
        pose : (4, 4) array_like, optional
            Where its centre stands, and how it is turned.

        Returns
        -------
        Scene
        """
        ...
    def with_cloud(self, name: str, points: ArrayLike, *, margin: float = 0.005, pose: Optional[ArrayLike] = None) -> Scene:
        """With observed points.

        Parameters
        ----------
        name : str
        points : (p, 3) array_like
        margin : float, default 0.005
            Distance that is kept from each point.
        pose : (4, 4) array_like, optional
            Of the frame in which the points are told, such as the camera's.

        Returns
        -------
        Scene
        """
        ...
    def with_cylinder(self, name: str, *, radius: float, length: float, pose: Optional[ArrayLike] = None) -> Scene:
        """With a cylinder around its own origin, along its z.

        Parameters
        ----------
        name : str
        radius : float
        length : float
        pose : (4, 4) array_like, optional
            Where its centre stands, and how it is turned.

        Returns
        -------
        Scene
        """
        ...
    def with_mesh(self, name: str, mesh: _MeshLike, *, scale: float = 1.0, pose: Optional[ArrayLike] = None) -> Scene:
        """With a mesh; where it is watertight, its inside is solid.

        Parameters
        ----------
        name : str
        mesh : mesh_like
        scale : float, default 1
            Metres per unit of the mesh.
        pose : (4, 4) array_like, optional
            Where its origin stands, and how it is turned.

        Returns
        -------
        Scene
        """
        ...
    def with_sphere(self, name: str, *, radius: float, position: ArrayLike) -> Scene:
        """With a ball.

        Parameters
        ----------
        name : str
        radius : float
        position : (3,) array_like
            Its centre.

        Returns
        -------
        Scene
        """
        ...
    def with_table(self, name: str, *, point: ArrayLike, normal: Optional[ArrayLike] = None) -> Scene:
        """With a table: everything below a plane is solid.

        Parameters
        ----------
        name : str
        point : (3,) array_like
            A point of the plane.
        normal : (3,) array_like, optional
            Away from the table, at any length; upwards by default.

        Returns
        -------
        Scene
        """
        ...

class Segment:
    """A part of a motion with one purpose. Between two points each joint follows the cubic polynomial that their positions
    and velocities determine.
    """
    def __len__(self) -> int: ...
    @property
    def accelerations(self) -> NDArray[numpy.float64]:
        """(p, n) float64 array: per second squared."""
        ...
    @property
    def kind(self) -> str:
        """str: ``"to_pre_grasp"``, ``"approach"``, ``"close"`` or ``"lift"``."""
        ...
    @property
    def openings(self) -> NDArray[numpy.float64]:
        """(p,) float64 array: distance between the pads, metres."""
        ...
    @property
    def positions(self) -> NDArray[numpy.float64]:
        """(p, n) float64 array: joint values, radians or metres."""
        ...
    @property
    def times(self) -> NDArray[numpy.float64]:
        """(p,) float64 array: seconds since the motion began, rising."""
        ...
    @property
    def velocities(self) -> NDArray[numpy.float64]:
        """(p, n) float64 array: per second."""
        ...

class SemanticCloud:
    """Points on an object's surface, each with a feature vector.

    Parameters
    ----------
    points : (m, 3) array_like
        In the frame and units of the mesh as read.
    features : (m, d) array_like
        From any network; kept as float32.
    n_views : (m,) array_like, optional
        How many views saw each point; 1 where none are given.

    Examples
    --------
    >>> import semfm
    >>> cloud = semfm.SemanticCloud([[0, 0, 0], [1, 0, 0]], [[1, 0, 0], [0, 1, 0]])
    >>> cloud
    SemanticCloud(2 points, dim 3)
    """
    def __init__(self, points: ArrayLike, features: ArrayLike, n_views: Optional[ArrayLike] = None) -> None: ...
    def __len__(self) -> int: ...
    @property
    def dim(self) -> int:
        """int: feature dimension d."""
        ...
    @property
    def features(self) -> NDArray[numpy.float32]:
        """(m, d) float32 array: features, a read-only view."""
        ...
    @property
    def n_points(self) -> int:
        """int: number of points m."""
        ...
    @property
    def n_views(self) -> NDArray[numpy.uint32]:
        """(m,) uint32 array: how many views saw each point, 0 where a neighbour lent its features; a read-only view."""
        ...
    @property
    def points(self) -> NDArray[numpy.float64]:
        """(m, 3) float64 array: positions, a read-only view."""
        ...

class Shape:
    """A mesh made ready for maps: cleaned, simplified, with its Laplacian and eigenbasis.

    The basis is that of the working mesh scaled to area 1, so eigenvalues and diffusion times are
    relative; positions keep the units of the original.

    Parameters
    ----------
    mesh : mesh_like
    k : int, default 60
        Eigenpairs.
    clip_k : bool, default True
        Whether `k` may be clipped to the number of working vertices; else more is an error.
    working_vertices : int, default 10000
        Simplify above this many vertices; 0 keeps them all.
    dust_share : float, default 1e-6
        Components below this share of the area are dropped; 0 keeps them all.
    laplacian : str, default "tufted"
        ``"tufted"`` or ``"cotan"``.
    bridges : bool, default True
        Whether components are joined by weak edges.
    tolerance : float, default 1e-8
        Largest relative residual of an eigenpair.
    cache : cache, optional
        Where prepared shapes are kept: a folder, or True for the user's own.
    progress : progress, optional

    Examples
    --------
    >>> import semfm, semfm.zoo
    >>> shape = semfm.Shape(semfm.zoo.torus(40, 20), k=20)
    >>> shape
    Shape(800 vertices, 800 working, 20 eigenpairs)
    >>> shape.basis.functions.shape
    (800, 20)
    """
    def __init__(self, mesh: _MeshLike, *, k: int = 60, clip_k: bool = True, working_vertices: int = 10000, dust_share: float = 1e-06, laplacian: str = 'tufted', bridges: bool = True, tolerance: float = 1e-08, cache: Optional[_Cache] = None, progress: Optional[_Progress] = None) -> None: ...
    @property
    def basis(self) -> Eigenbasis:
        """Eigenbasis: that of the working mesh at area 1 (n_working × k)."""
        ...
    @property
    def laplacian(self) -> Laplacian:
        """Laplacian: that of the working mesh at area 1, bridges included."""
        ...
    def onto_original(self, values: ArrayLike) -> NDArray[numpy.float64]:
        """Values on the working vertices, extended to the original's.

        Parameters
        ----------
        values : (n_working,) array_like

        Returns
        -------
        (n,) float64 array
            Exact where a vertex was kept, linear on the nearest working triangle elsewhere.
        """
        ...
    def onto_working(self, values: ArrayLike) -> NDArray[numpy.float64]:
        """Values on the original's vertices, read off at the working ones.

        Parameters
        ----------
        values : (n,) array_like

        Returns
        -------
        (n_working,) float64 array
        """
        ...
    @property
    def original(self) -> Mesh:
        """Mesh: the mesh as given."""
        ...
    @property
    def original_of_working(self) -> NDArray[numpy.uint32]:
        """(n_working,) uint32 array: the original vertex that each working one is, a read-only view."""
        ...
    @property
    def report(self) -> dict[str, Any]:
        """dict: what cleaning, simplification and the solver did, with milliseconds by stage."""
        ...
    def smooth(self, function: ArrayLike, t: float) -> NDArray[numpy.float64]:
        """One implicit step of heat diffusion, ``(M + t L) u = M f``, on the working vertices.

        Parameters
        ----------
        function : (n_working,) array_like
        t : float
            Time at area 1.

        Returns
        -------
        (n_working,) float64 array
        """
        ...
    @property
    def unit(self) -> float:
        """float: √area of the working mesh, the length that becomes 1."""
        ...
    @property
    def working(self) -> Mesh:
        """Mesh: the mesh that maps are computed on, in the units of the original."""
        ...
    @property
    def working_of_original(self) -> NDArray[numpy.uint32]:
        """(n,) uint32 array: the working vertex that stands for each original one, a read-only view."""
        ...

class StoredTransfer:
    """A transfer as its folder has it: what `semfm-cli transfer` and `Transfer.write` leave behind.

    Made by `read_transfer`.
    """
    @property
    def confidence(self) -> float:
        """float: the probability that the region is right."""
        ...
    @property
    def hypotheses(self) -> list[Hypothesis]:
        """list of Hypothesis: where the region may belong, by falling probability."""
        ...
    @property
    def point_map(self) -> PointMap:
        """PointMap: one source vertex for each target vertex."""
        ...
    @property
    def region(self) -> Region:
        """Region: the region on the target, of the vertices that count with their weights."""
        ...
    @property
    def report(self) -> dict[str, Any]:
        """dict: the content of `report.json`."""
        ...
    @property
    def source(self) -> Mesh:
        """Mesh: the demonstrated object."""
        ...
    @property
    def source_region(self) -> Region:
        """Region: the demonstrated region on the source, its weights to four digits."""
        ...
    @property
    def target(self) -> Mesh:
        """Mesh: the one to act on."""
        ...
    @property
    def verdict(self) -> str:
        """str: ``"accept"``, ``"check"`` or ``"refuse"``."""
        ...

class SurfaceIndex:
    """A tree over the triangles of a mesh: built once, asked often.

    Triangles without area are left out. Both sides of a triangle count, whatever its winding.

    Parameters
    ----------
    mesh : mesh_like

    Examples
    --------
    >>> import semfm
    >>> mesh = semfm.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]])
    >>> points, distances, faces, barycentric = semfm.SurfaceIndex(mesh).closest([[0.25, 0.25, 3]])
    >>> float(distances[0]), barycentric.tolist()
    (3.0, [[0.5, 0.25, 0.25]])
    """
    def __init__(self, mesh: _MeshLike) -> None: ...
    def closest(self, queries: ArrayLike) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.uint32], NDArray[numpy.float64]]:
        """The point of the surface nearest to each query.

        Parameters
        ----------
        queries : (q, 3) array_like

        Returns
        -------
        points : (q, 3) float64 array
        distances : (q,) float64 array
        faces : (q,) uint32 array
        barycentric : (q, 3) float64 array
        """
        ...
    def first_hit(self, origins: ArrayLike, directions: ArrayLike) -> tuple[NDArray[numpy.float64], NDArray[numpy.int32]]:
        """The first triangle that each ray meets.

        Parameters
        ----------
        origins : (q, 3) array_like
        directions : (q, 3) array_like
            Of any length but zero.

        Returns
        -------
        t : (q,) float64 array
            The hit is at ``origin + t * direction``; infinite for a miss.
        faces : (q,) int32 array
            Triangle, −1 for a miss.
        """
        ...
    @property
    def mesh(self) -> Mesh:
        """Mesh: the mesh that was indexed."""
        ...

class TouchedRegion:
    """The region that hands touch, and how sure that is: see `find_contact`."""
    @property
    def lines(self) -> list[str]:
        """list of str: the same in words."""
        ...
    def picture(self) -> bytes:
        """A picture of the mesh with the region, which notebooks show by themselves.

        Returns
        -------
        bytes
            PNG.
        """
        ...
    @property
    def region(self) -> Region:
        """Region: the region, with smooth weights."""
        ...
    @property
    def report(self) -> dict[str, Any]:
        """dict: for each of the ``frames`` what was touched, by which finger, and what is doubtful (`semfm.contact/1`)."""
        ...

class TrackedPose:
    """An object in one frame, as a line of ``semfm-cli track`` has it: see `Tracker.update`."""
    def __eq__(self, other: object) -> bool: ...
    @property
    def camera_from_object(self) -> Optional[NDArray[numpy.float64]]:
        """(4, 4) float64 array, optional: from the mesh's frame and units to the camera's frame in metres, the scale is
        included; None while lost.
        """
        ...
    @property
    def covariance(self) -> Optional[NDArray[numpy.float64]]:
        """(6, 6) float64 array, optional: covariance of x, y, z of the mesh's origin (metres) and of the rotation vector
        (radians), along the camera's axes; None while lost.
        """
        ...
    @property
    def evidence(self) -> dict[str, Any]:
        """dict: what the image says of the pose: ``visible_share``, ``hidden_share``, ``through_share``, ``outline_share``,
        ``residual_m`` and ``probability`` by this image alone.
        """
        ...
    @property
    def frame(self) -> int:
        """int: number of the frame among those that the tracker was given, from 0."""
        ...
    @property
    def position_std(self) -> Optional[float]:
        """float, optional: greatest standard deviation of the object's middle, metres."""
        ...
    @property
    def probability(self) -> float:
        """float: probability that the surface stands within a tenth of its diameter of where the pose puts it."""
        ...
    @property
    def region(self) -> Optional[dict[str, Any]]:
        """dict, optional: the region in this frame: ``confidence``, ``visible_share``, ``observed_share``, ``deviation_m``
        and its middle ``centre_m``; None without one.
        """
        ...
    @property
    def rigid(self) -> Optional[NDArray[numpy.float64]]:
        """(4, 4) float64 array, optional: the same once the object is measured in metres, for `find_grasps`."""
        ...
    @property
    def rotation_std(self) -> Optional[float]:
        """float, optional: greatest standard deviation of the rotation, radians; π where nothing seen determines it."""
        ...
    @property
    def scale(self) -> Optional[float]:
        """float, optional: metres per unit of the mesh; None while lost."""
        ...
    @property
    def state(self) -> str:
        """str: ``"new"``, ``"tracking"``, ``"occluded"``, ``"lost"`` or ``"reacquired"``."""
        ...
    @property
    def time_nanos(self) -> Optional[int]:
        """int, optional: the frame's time, nanoseconds."""
        ...
    def to_dict(self) -> dict[str, Any]:
        """The line of ``semfm-cli track`` (`semfm.track/1`).

        Returns
        -------
        dict
        """
        ...
    def to_json(self) -> str:
        """The same as text: to the byte what the command writes, without the line's end.

        Returns
        -------
        str
        """
        ...

class Tracker:
    """Follows an object of known shape through the frames of a depth camera.

    Each `update` takes the next frame and says where the object is, how sure that is, and in which state tracking
    stands; ``semfm-cli track`` does the same to a bag or a BOP scene. `docs/observations.md` tells how it works and
    where it fails.

    Parameters
    ----------
    mesh : mesh_like
        In any frame and unit.
    init : (4, 4) array_like or Alignment or path, optional
        The pose in the first frame (`Alignment.camera_from_object`, scale included); searched where none is given.
    scale : float, optional
        Metres per unit of the mesh, 1 for a mesh in metres; that of `init`, else of the first alignment, where none is
        given.
    region : Region or path, optional
        A region of the mesh, whose confidence is followed, too.
    hypotheses : int, default 96
        Poses that are tried in a frame in which the object is not where it was.
    seed : int, default 0

    Examples
    --------
    >>> import numpy as np
    >>> import semfm, semfm.zoo
    >>> ball = semfm.zoo.icosphere(3)  # of radius 1, here 5 cm
    >>> camera = semfm.Pinhole.with_pixel_centres_at_half(160, 120, 150, 150, 80, 60)
    >>> tracker = semfm.Tracker(ball, scale=0.05)
    >>> for x in (0.02, 0.025, 0.03):
    ...     posed = semfm.Mesh(0.05 * ball.vertices + [x, 0, 0.5], ball.faces)
    ...     depth = semfm.render(posed, [camera])[0].depth
    ...     seen = semfm.Observation(camera, depth=np.where(np.isfinite(depth), depth, 1.0))
    ...     pose = tracker.update(seen)
    >>> pose.state, bool(abs(pose.camera_from_object[0, 3] - 0.03) < 0.003)
    ('tracking', True)
    """
    def __init__(self, mesh: _MeshLike, *, init: Optional[Union[ArrayLike, Alignment, _Path]] = None, scale: Optional[float] = None, region: Optional[Union[Region, _Path]] = None, hypotheses: int = 96, seed: int = 0) -> None: ...
    @property
    def mesh(self) -> Mesh:
        """Mesh: the object."""
        ...
    @property
    def refined_region(self) -> Optional[Region]:
        """Region, optional: the region as the frames so far refined it: each weight times the confidence that surface is
        where the mesh has it; None without a region.
        """
        ...
    def update(self, observation: Observation, *, mask: Optional[Union[str, ArrayLike]] = None) -> TrackedPose:
        """The object in the next frame.

        Where the call is interrupted, the frame counts as one that was seen. Calls of several threads wait for each other;
        one from within another, by a signal's handler, raises `InvalidInput`.

        Parameters
        ----------
        observation : Observation
            With a depth image; later than the one before, where both say when they were.
        mask : str or (height, width) array_like, optional
            The object's mask, which helps to find it: a name, an array of dtype bool, or the only one that there is where
            none is given. That a frame has no mask of the name says that the object is not visible in it.

        Returns
        -------
        TrackedPose
        """
        ...

class Transfer:
    """A transferred region and everything known about it.

    Vertices are those of the meshes as given. Made by `transfer` and `Matching.transfer`.
    """
    @property
    def confidence(self) -> float:
        """float: the probability that the IoU with the true region is at least one half, in [0, 1]."""
        ...
    @property
    def hypotheses(self) -> list[Hypothesis]:
        """list of Hypothesis: where the region may belong, by falling probability."""
        ...
    @property
    def other_rule(self) -> Optional[Region]:
        """Region, optional: the region under the other rule, where the method computes both (``semfm``)."""
        ...
    def picture(self) -> bytes:
        """A picture of both objects with the region, which notebooks show by themselves: `transfer.png` of
        `write`.

        Returns
        -------
        bytes
            PNG.
        """
        ...
    @property
    def point_map(self) -> PointMap:
        """PointMap: one source vertex for each target vertex."""
        ...
    @property
    def region(self) -> Region:
        """Region: the region on the target."""
        ...
    @property
    def report(self) -> dict[str, Any]:
        """dict: how the answer came about: settings, stages, anchors, fit, quality of the map."""
        ...
    @property
    def settings(self) -> TransferSettings:
        """TransferSettings: the settings it was made with, map sizes clipped to the bases."""
        ...
    @property
    def source(self) -> PreparedObject:
        """PreparedObject: the demonstrated object."""
        ...
    @property
    def source_region(self) -> Region:
        """Region: the demonstrated region."""
        ...
    @property
    def target(self) -> PreparedObject:
        """PreparedObject: the one to act on."""
        ...
    @property
    def verdict(self) -> str:
        """str: ``"accept"``, ``"check"`` or ``"refuse"``."""
        ...
    @property
    def weights(self) -> NDArray[numpy.float64]:
        """(n_target,) float64 array: weight of each target vertex, a read-only view."""
        ...
    @property
    def why(self) -> Optional[str]:
        """str, optional: why the answer is not accepted, where more is known than that it is doubtful."""
        ...
    def write(self, folder: _Path, *, about: Optional[Mapping[str, Any]] = None, pictures: bool = True, progress: Optional[_Progress] = None) -> list[str]:
        """Writes every file that `semfm-cli transfer` writes: region, report, point map, painted
        meshes, picture and scene.

        Parameters
        ----------
        folder : path
            Made if it is not there.
        about : dict, optional
            Put into the report as it is.
        pictures : bool, default True
            Also draw ``transfer.png``, ``features.png`` and ``transfer.mcap``.
        progress : progress, optional

        Returns
        -------
        list of str
            The files.
        """
        ...

class TransferSettings:
    """Everything that can be set about a transfer: a method's own constants, and what differs.

    Parameters
    ----------
    method : str, default "fused"
        ``fused``, ``semfm`` (the paper to the letter), ``anchored``, ``sinkhorn``, ``nearest`` or
        ``wks``.
    **changes : object
        Settings by their names in `to_dict`, groups as dicts: ``zoomout={"k_final": 40}``.

    Examples
    --------
    >>> import semfm
    >>> settings = semfm.TransferSettings("fused", zoomout={"k_final": 40}, n_anchors=3)
    >>> settings.zoomout["k_final"], settings.zoomout["step"], settings.n_anchors
    (40, 5, 3)
    """
    def __init__(self, method: str = 'fused', **changes: Any) -> None: ...
    def __eq__(self, other: object) -> bool: ...
    def to_dict(self) -> dict[str, Any]:
        """All settings by name, groups as dicts.

        Returns
        -------
        dict
        """
        ...

class View:
    """One rendered view of an object.

    See Also
    --------
    render, ViewsFile
    """
    @property
    def camera(self) -> Pinhole:
        """Pinhole: the one the picture was taken with."""
        ...
    @property
    def depth(self) -> NDArray[numpy.float32]:
        """(height, width) float32 array: depth along the camera's axis in mesh units, infinite on the background, a read-only view."""
        ...
    @property
    def rgb(self) -> NDArray[numpy.uint8]:
        """(height, width, 3) uint8 array: sRGB, a read-only view."""
        ...
    @property
    def triangles(self) -> NDArray[numpy.int32]:
        """(height, width) int32 array: triangle of each pixel, −1 on the background, a read-only view."""
        ...

class ViewsFile:
    """The rendered views of an object, as a ``NAME.views.mcap`` holds them: for `semfm-embed`, and for
    Foxglove.

    Parameters
    ----------
    mesh : mesh_like
        The mesh that was rendered.
    views : list of View
        At least one, all of one size.
    rig : str, default "given as cameras"
        How the cameras were placed, in words, for the file.
    background : str, default "as rendered"
        What stands behind the object, in words, for the file.

    Examples
    --------
    >>> import pathlib, tempfile
    >>> import semfm, semfm.zoo
    >>> mesh = semfm.zoo.torus(40, 20)
    >>> views = semfm.render(mesh, semfm.rig(mesh, count=3, size=64))
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = pathlib.Path(folder.name, "torus.views.mcap")
    >>> semfm.ViewsFile(mesh, views).write(path)
    >>> file = semfm.ViewsFile.read(path)
    >>> file, file.mesh == mesh, file.metadata["n_views"]
    (ViewsFile(3 views, 64 × 64), True, '3')
    >>> folder.cleanup()
    """
    def __init__(self, mesh: _MeshLike, views: Iterable[View], *, rig: str = 'given as cameras', background: str = 'as rendered') -> None: ...
    def __len__(self) -> int: ...
    @property
    def cameras(self) -> list[Pinhole]:
        """list of Pinhole: one per view."""
        ...
    @property
    def mesh(self) -> Optional[Mesh]:
        """Mesh, optional: the mesh that the views show, vertex by vertex as it was rendered; None where the file has none."""
        ...
    @property
    def mesh_hash(self) -> str:
        """str: hash of the mesh that the views show."""
        ...
    @property
    def metadata(self) -> dict[str, Any]:
        """dict: the file's metadata record ``semfm``, all entries as text."""
        ...
    @property
    def n_views(self) -> int:
        """int: number of views."""
        ...
    @staticmethod
    def read(path: _Path) -> ViewsFile:
        """Reads a ``NAME.views.mcap`` and checks everything in it.

        Parameters
        ----------
        path : path

        Returns
        -------
        ViewsFile
        """
        ...
    @property
    def views(self) -> list[View]:
        """list of View: the views, as numbered."""
        ...
    def write(self, path: _Path) -> None:
        """Writes a ``NAME.views.mcap`` with its mesh, whole or not at all.

        Parameters
        ----------
        path : path
        """
        ...

def align(mesh: _MeshLike, points: Union[ArrayLike, Observation], *, mask: Optional[Union[str, ArrayLike]] = None, viewpoint: Optional[tuple[float, float, float]] = (0.0, 0.0, 0.0), init: Optional[Union[ArrayLike, Alignment, _Path]] = None, scale_range: Optional[tuple[float, float]] = None, n_starts: Optional[int] = 400, seed: Optional[int] = 0, progress: Optional[_Progress] = None) -> Alignment:
    """Finds pose and scale of a mesh in an observed partial cloud (a robust Sim(3)).

    Parameters
    ----------
    mesh : mesh_like
        In any units.
    points : (n, 3) array_like or Observation
        What the camera saw of the object, metres, in the camera's frame; or all that it saw, of which the points beside the
        object tell where it is not.
    mask : str or (height, width) array_like, optional
        The object's mask in an `Observation`: a name, an array of dtype bool, or the only one that there is where none is
        given.
    viewpoint : tuple of float, float, float, optional
        Where the camera of points stands. The origin says that the frame is the camera's own (x right, y down,
        z forward), in which nothing it sees lies behind it. None for a cloud merged from many views, of which nothing can be
        said about what should have been seen.
    init : (4, 4) array_like or Alignment or path, optional
        A guess of `Alignment.camera_from_object`.
    scale_range : tuple of float, float, optional
        Least and greatest scale, metres per unit.
    n_starts : int, optional
        Rotations to start from where there is no guess.
    seed : int, optional
    progress : progress, optional

    Returns
    -------
    Alignment
        A pose that cannot be trusted has the verdict ``"refuse"``; it is no error.
    """
    ...

def camera_towards(mesh: _MeshLike, direction: ArrayLike, up: ArrayLike, *, size: int = 224, fill: float = 0.8) -> Pinhole:
    """One camera that looks along ``-direction`` at the whole object: for pictures of results.

    Parameters
    ----------
    mesh : mesh_like
    direction : (3,) array_like
        From the object towards the camera, in the mesh's frame.
    up : (3,) array_like
        Upwards in the image, in the mesh's frame.
    size : int, default 224
        Side of the square image, in pixels.
    fill : float, default 0.8
        Share of the image's side that the silhouette fills.

    Returns
    -------
    Pinhole
    """
    ...

def check_output(output: _Path, inputs: Iterable[_Path]) -> None:
    """Refuses an output that would replace one of the inputs, or that cannot be written as a file.

    Parameters
    ----------
    output : path
    inputs : list of path
    """
    ...

def cotan_laplacian(mesh: _MeshLike) -> Laplacian:
    """The cotangent Laplacian of the triangles as they are.

    Parameters
    ----------
    mesh : mesh_like

    Returns
    -------
    Laplacian
    """
    ...

def demo_object(category: str = 'containers', seed: int = 0, *, instance: int = 0, n_vertices: int = 3000, holes: int = 0, floaters: int = 0) -> DemoObject:
    """Makes a procedural object of one of the paper's six categories.

    Parameters
    ----------
    category : str, default "containers"
        ``tools``, ``shoes``, ``cutting``, ``containers``, ``controllers`` or ``scissors``.
    seed : int, default 0
        Of the proportions, the damage and the pose.
    instance : int, default 0
        Number within the category; six kinds take turns.
    n_vertices : int, default 3000
        Vertices aimed at, 50 to 1000000; the count reached is close to it.
    holes : int, default 0
        Holes torn into the surface.
    floaters : int, default 0
        Detached blobs near the surface.

    Returns
    -------
    DemoObject

    Examples
    --------
    >>> import semfm
    >>> mug = semfm.demo_object("containers", n_vertices=500)
    >>> mug.kind, mug.part_names
    ('mug', ['body', 'handle'])
    """
    ...

def diffused_indicators(basis: Eigenbasis, labels: ArrayLike, chosen: ArrayLike, *, t: float = 0.005, norm: str = 'surface') -> NDArray[numpy.float64]:
    """Coefficients of the indicator functions of labels, diffused by heat and scaled to unit norm.

    Parameters
    ----------
    basis : Eigenbasis
    labels : (n,) array_like
        A label (an id) per vertex.
    chosen : (c,) array_like
        The labels whose indicators are wanted.
    t : float, default 0.005
        Heat time, relative to area 1.
    norm : str, default "surface"
        ``"surface"`` (∫ f² = 1) or ``"vertices"`` (Σ f² = 1, the letter of the paper).

    Returns
    -------
    (k, c) float64 array
        One column per chosen label; zeros for a label that no vertex bears.
    """
    ...

def eigenbasis(laplacian: Laplacian, k: int, *, tolerance: float = 1e-08, seed: int = 0, progress: Optional[_Progress] = None) -> Eigenbasis:
    """The first k eigenpairs of a Laplacian.

    Residuals, orthonormality and (by an inertia count) completeness are verified before a basis is
    returned. Signs are fixed; the same settings give the same bytes at every thread count.

    Parameters
    ----------
    laplacian : Laplacian
    k : int
        Number of pairs, at most n.
    tolerance : float, default 1e-8
        Largest relative residual accepted.
    seed : int, default 0
        Of the starting block.
    progress : progress, optional

    Returns
    -------
    Eigenbasis

    Examples
    --------
    >>> import semfm, semfm.zoo
    >>> basis = semfm.eigenbasis(semfm.laplacian(semfm.zoo.icosphere(3)), 9)
    >>> basis.values.round(1).tolist()  # l (l + 1) on the unit sphere
    [0.0, 2.0, 2.0, 2.0, 6.0, 6.0, 6.0, 6.0, 6.0]
    """
    ...

def embed(mesh: Union[_MeshLike, MeshFile], *, encoder: str = 'builtin', rolls: Optional[int] = None, colors: bool = False, cache: Optional[_Cache] = None, progress: Optional[_Progress] = None) -> Embeddings:
    """Embeddings of an object's views by an encoder, as `transfer` and `prepare` make them.

    Parameters
    ----------
    mesh : mesh_like or MeshFile
    encoder : str, default "builtin"
        ``builtin``, a ``.net`` file, a Hugging Face name, a local checkpoint, an ONNX encoder's JSON,
        or ``package.module:Class``.
    rolls : int, optional
        Rotations of each view that are averaged, 1, 2 or 4; what the encoder wants where none is
        given.
    colors : bool, default False
        Show the object in its own colours, where the encoder reads colours.
    cache : cache, optional
        Where embeddings are kept: a folder, or True for the user's own.
    progress : progress, optional

    Returns
    -------
    Embeddings

    Examples
    --------
    >>> import semfm
    >>> mug = semfm.demo_object("containers", n_vertices=500).mesh
    >>> embeddings = semfm.embed(mug)
    >>> embeddings.encoder, embeddings.n_views
    ('builtin', 14)
    """
    ...

def farthest_points(points: ArrayLike, n: int) -> NDArray[numpy.uint32]:
    """Ids of points, each the farthest from those before it, starting with point 0.

    Parameters
    ----------
    points : (m, 3) array_like
    n : int
        How many; all of them where there are fewer.

    Returns
    -------
    (n,) uint32 array
    """
    ...

def find_contact(mesh: _MeshLike, hands: Union[Hand, Iterable[Hand]], *, camera_from_object: Optional[Union[_PoseLike, Iterable[_PoseLike]]] = None) -> TouchedRegion:
    """Finds where a hand touches a mesh: ``semfm-cli region --hand``.

    The hand is moved by what makes it rest on the surface, within what it may be off; weights are averaged over the places
    that are likely, and over frames.

    Parameters
    ----------
    mesh : mesh_like
    hands : Hand or list of Hand
        Several are frames of one grasp.
    camera_from_object : pose_like or list of pose_like, optional
        How the mesh stands before the camera, scale included: a (4, 4) matrix, an `Alignment` or the path of its file. The
        hands are then in the camera's frame. One for all frames, or a list with one for each. Without it mesh and hands
        are in one frame, in metres.

    Returns
    -------
    TouchedRegion

    Raises
    ------
    InvalidInput
        A hand that touches nothing, with its distance, and one that cannot be a hand in metres.
    """
    ...

def find_grasps(mesh: _MeshLike, region: Union[Region, _Path], gripper: Union[Gripper, _Path], *, scale: Optional[float] = None, camera_from_object: Optional[ArrayLike] = None, alignment: Optional[Union[Alignment, _Path]] = None, use_refused: Optional[bool] = False, table: Optional[Any] = None, scene_meshes: Optional[Iterable[_MeshLike]] = None, scene_points: Optional[ArrayLike] = None, scene_margin: Optional[float] = 0.005, unseen: Optional[float] = None, seen_from: Optional[ArrayLike] = None, top: Optional[int] = 20, n_samples: Optional[int] = 1000, working_vertices: Optional[int] = None, friction: Optional[float] = 0.5, diversity: Optional[float] = 0.1, mass: Optional[float] = None, grip_force: Optional[float] = 30.0, width_range: Optional[tuple[float, float]] = None, approach: Optional[ArrayLike] = None, approach_cone: Optional[float] = None, demonstrated_approach: Optional[ArrayLike] = None, clearance: Optional[float] = 0.0, pad_in_region: Optional[float] = 0.5, seed: Optional[int] = 0, progress: Optional[_Progress] = None) -> Grasps:
    """Parallel-jaw grasps whose pads close inside a region.

    Every grasp that comes back was checked: the open gripper on its way in and where it closes meets
    neither object nor scene, the contacts are in force closure, and the pads lie in the region.
    Nothing found is an answer: see `Grasps.rejected` and `Grasps.nearest_miss`.

    Parameters
    ----------
    mesh : mesh_like
        The object.
    region : Region or path
        Where the pads shall close; of the mesh.
    gripper : Gripper or path
        A gripper, or what `Gripper` takes.
    scale : float, optional
        Metres per unit of the mesh; 1 for a mesh in metres. Not with `alignment`, needed without.
    alignment : Alignment or path, optional
        Pose and scale before a camera, from `align` or `aligned.json`: in place of `scale` and `camera_from_object`.
        What is uncertain of the pose keeps the gripper away until the pads close.
    use_refused : bool, optional
        Take an alignment whose verdict is `refuse`, which is an error otherwise.
    camera_from_object : (4, 4) array_like, optional
        Rigid pose of the object, scaled to metres, before a camera. Scene, table and directions
        are then given in the camera's frame, else in the object's in metres.
    table : object, optional
        A table top as a pair: a point of it, and its normal, away from the table.
    scene_meshes : list of mesh_like, optional
        What the gripper must not touch, metres.
    scene_points : (p, 3) array_like, optional
        Points that it must keep `scene_margin` away from, metres.
    scene_margin : float, optional
    unseen : float, optional
        The mesh is what one camera saw (`ObservedObject.mesh`): keep out of what it hides, the volume behind it up to so
        many metres or down to the table, of which nothing is known.
    seen_from : (3,) array_like, optional
        Where that camera stood, metres, in the frame of the mesh; its origin where none is given.
    top : int, optional
        Grasps to return.
    n_samples : int, optional
        Points of the region from which candidates are grown.
    working_vertices : int, optional
        Vertices of the surface on which contacts are sought on larger meshes; 0: on the mesh as it is, neither
        simplified nor, where it is noisy, smoothed. Collisions are always with the mesh as it is.
    friction : float, optional
        Coulomb coefficient between pad and object.
    diversity : float, optional
        Share of the score that grasps may give up to differ from each other; 0 returns the best, however near.
    mass : float, optional
        Kilograms: `hold` is then the probability that the grasp holds.
    grip_force : float, optional
        Force with which each pad presses, newtons.
    width_range : tuple of float, float, optional
        Least and largest distance between the closed pads, metres.
    approach : (3,) array_like, optional
        Middle of the allowed directions of approach.
    approach_cone : float, optional
        Half-angle of the allowed directions around `approach`, radians; π/4 by default.
    demonstrated_approach : (3,) array_like, optional
        The direction in which the demonstrator's hand came; agreement raises the score.
    clearance : float, optional
        Least distance of the open gripper to everything, metres.
    pad_in_region : float, optional
        Share of each pad's contact that must lie in the region.
    seed : int, optional
    progress : progress, optional

    Returns
    -------
    Grasps

    Examples
    --------
    >>> import semfm
    >>> import semfm.zoo
    >>> ball = semfm.zoo.icosphere(3)
    >>> everywhere = semfm.Region([1.0] * ball.n_vertices)
    >>> grasps = semfm.find_grasps(ball, everywhere, "franka", scale=0.03, n_samples=100)
    >>> bool(abs(grasps[0].width - 0.06) < 0.002)
    True
    """
    ...

def geodesic_distances(mesh: _MeshLike, sources: Union[int, ArrayLike], *, kind: str = 'tufted', time: float = 1.0) -> NDArray[numpy.float64]:
    """Distance of every vertex from the nearest source: `HeatGeodesics` for a single question.

    Parameters
    ----------
    mesh : mesh_like
    sources : int or (s,) array_like
        Vertex ids.
    kind : str, default "tufted"
        The Laplacian: ``"tufted"`` or ``"cotan"``.
    time : float, default 1.0
        Diffusion time in squared mean edge lengths.

    Returns
    -------
    (n,) float64 array
    """
    ...

def get_num_threads() -> int:
    """The number of worker threads.

    Returns
    -------
    int
    """
    ...

def hks(basis: Eigenbasis, *, n_times: int = 100) -> NDArray[numpy.float64]:
    """Heat kernel signature (Sun, Ovsjanikov & Guibas 2009): heat left at each vertex after each time.

    Parameters
    ----------
    basis : Eigenbasis
    n_times : int, default 100
        Times, spread evenly in logarithm over the range that the basis resolves.

    Returns
    -------
    (n, n_times) float64 array
    """
    ...

def icosphere(subdivisions: int) -> Mesh:
    """A sphere of radius 1, from a subdivided icosahedron.

    Parameters
    ----------
    subdivisions : int
        0 to 7; each multiplies the triangles by four, from 20.

    Returns
    -------
    Mesh
    """
    ...

def laplacian(mesh: _MeshLike, kind: str = 'tufted') -> Laplacian:
    """The Laplacian of a mesh.

    Parameters
    ----------
    mesh : mesh_like
    kind : str, default "tufted"
        ``"tufted"`` (intrinsic Delaunay on the tufted cover, holds on any mesh) or ``"cotan"``.

    Returns
    -------
    Laplacian

    Examples
    --------
    >>> import semfm, semfm.zoo
    >>> laplacian = semfm.laplacian(semfm.zoo.icosphere(2))
    >>> bool(abs(laplacian.stiffness.sum()) < 1e-9)
    True
    """
    ...

def lift(mesh: _MeshLike, embeddings: Union[Embeddings, _Path], *, rule: str = 'pull', n_samples: int = 1200, depth_tolerance: float = 0.01, radius: float = 0.06, seed: int = 0, progress: Optional[_Progress] = None) -> SemanticCloud:
    """Lifts the embeddings of views onto samples of the surface.

    Parameters
    ----------
    mesh : mesh_like
        The mesh that the views show.
    embeddings : Embeddings or path
    rule : str, default "pull"
        ``"pull"`` (samples take their features out of every view that sees them) or ``"unproject"``
        (patch centres are cast onto the surface, the paper's rule).
    n_samples : int, default 1200
        Points of the cloud; the paper's rule was measured with 400.
    depth_tolerance : float, default 0.01
        For ``"pull"``: how far behind the visible surface a sample may lie and still be seen, as a
        share of the bounding-sphere radius.
    radius : float, default 0.06
        For ``"unproject"``: the reach of a sample, as a share of the bounding box's diagonal.
    seed : int, default 0
        Of the samples.
    progress : progress, optional

    Returns
    -------
    SemanticCloud
    """
    ...

def merged_surface(observations: Iterable[Observation], *, mask: Optional[str] = None, smooth_pixels: int = 3, trim_pixels: int = 1) -> ObservedObject:
    """One surface of what several frames saw from known places: ``semfm-cli surface --merge``.

    Parameters
    ----------
    observations : list of Observation
        Their cameras' poses are known (`Observation.camera`), and the object stands still in them.
    mask : str, optional
        Name of the object's mask; the only one of each frame where none is given. Frames that have none, or no depth under
        it, are left out: `ObservedObject.notes` says which.
    smooth_pixels : int, default 3
        Radius of the window in which depth is smoothed, 0 to 20.
    trim_pixels : int, default 1
        Pixels along the mask's outline that are left out, 0 to 100.

    Returns
    -------
    ObservedObject
        In the frame of the cameras' poses, metres.
    """
    ...

def mesh_formats(*, written: bool = False) -> list[str]:
    """The formats of mesh files, by name.

    Parameters
    ----------
    written : bool, default False
        Only those that meshes are written to.

    Returns
    -------
    list of str
        Such as ``"ply"``, which are the extensions, too.

    Examples
    --------
    >>> import semfm
    >>> "gltf" in semfm.mesh_formats(), "gltf" in semfm.mesh_formats(written=True)
    (True, False)
    """
    ...

def plan(robot: Robot, grasps: Union[Grasps, _Path], *, object: Optional[_MeshLike] = None, base_from_object: Optional[ArrayLike] = None, base_from_camera: Optional[ArrayLike] = None, tip_from_tcp: Optional[ArrayLike] = None, start: Optional[Union[ArrayLike, str]] = None, scene: Optional[Union[Scene, _Path]] = None, with_table: bool = True, approach_length: float = 0.1, lift_height: float = 0.1, speed: float = 1.0, line_speed: float = 0.5, iterations: Optional[int] = None, searches: Optional[int] = None, seed: int = 0, progress: Optional[_Progress] = None) -> GraspPlan:
    """The motion of an arm that takes an object by the best of its grasps that can be carried out: reach, approach, close,
    lift. What is answered was checked as it is timed, against the robot, the scene and the object.

    That no grasp can be carried out is an answer: see `GraspPlan.gates`. The same as ``semfm-cli plan`` from the same
    files.

    Parameters
    ----------
    robot : Robot
        The arm; its ``tip`` is the link that the gripper's flange sits on.
    grasps : Grasps or path
        From `find_grasps`, or `grasps.json`.
    object : mesh_like, optional
        The mesh that the grasps belong to; by default that of ``Grasps``. Without it nothing keeps the arm away from the
        object. `trajectory.json` names the file of a path.
    base_from_object : (4, 4) array_like, optional
        Where the object, in metres, stands in the frame of the arm's base.
    base_from_camera : (4, 4) array_like, optional
        The same of the camera that the grasps were found with; one of the two must be given.
    tip_from_tcp : (4, 4) array_like, optional
        The TCP of the closed hand in the frame of ``Robot.tip``, where that is not the gripper's flange.
    start : (n,) array_like or str, optional
        Joint values, or a state of the SRDF; by default its state ``ready``, ``home`` or ``up``.
    scene : Scene or path, optional
        What stands around, in the frame of the arm's base.
    with_table : bool, default True
        Whether the table that the grasps were found with stands there, too.
    approach_length : float, default 0.1
        Length of the straight way to the grasp, metres.
    lift_height : float, default 0.1
        Height of the straight way up with the object, metres along z of the arm's base.
    speed : float, default 1
        Share of the joints' velocity limits that is used; accelerations follow with its square.
    line_speed : float, default 0.5
        The same on the straight ways.
    iterations : int, optional
        Most iterations of each search for a path.
    searches : int, optional
        Grasps for which a path is searched at most.
    seed : int, default 0
    progress : progress, optional

    Returns
    -------
    GraspPlan
    """
    ...

def planned_stages(recipe: _Path, output: _Path) -> list[dict[str, Any]]:
    """What `run` would do with each stage, and why: ``semfm-cli run --dry-run``.

    Parameters
    ----------
    recipe : path
        The recipe (TOML).
    output : path
        The folder of the results.

    Returns
    -------
    list of dict
        ``stage``, and ``why`` it is to be done; None where it is kept.
    """
    ...

def point_cloud_laplacian(points: ArrayLike, *, n_neighbors: int = 30, mollify_factor: float = 1e-05) -> Laplacian:
    """The Laplacian of points sampled from a surface, without triangles (Sharp & Crane 2020).

    Parameters
    ----------
    points : (n, 3) array_like
    n_neighbors : int, default 30
        Neighbours of each point that define its tangent plane and its triangles.
    mollify_factor : float, default 1e-5
        As in `tufted_laplacian`.

    Returns
    -------
    Laplacian
    """
    ...

def prepare(mesh: Union[_MeshLike, MeshFile], *, features: Optional[ArrayLike] = None, embeddings: Optional[Union[Embeddings, _Path]] = None, cloud: Optional[SemanticCloud] = None, encoder: Optional[str] = None, method: Optional[str] = None, settings: Optional[TransferSettings] = None, k: Optional[int] = None, working_vertices: Optional[int] = None, n_samples: Optional[int] = None, seed: Optional[int] = None, cache: Optional[_Cache] = None, progress: Optional[_Progress] = None) -> PreparedObject:
    """Makes an object ready to be matched with any number of others.

    Where neither features, embeddings nor a cloud are given, an encoder makes them.

    Parameters
    ----------
    mesh : mesh_like or MeshFile
    features : (n, d) array_like, optional
        A feature vector per vertex, from any network.
    embeddings : Embeddings or path, optional
        Patch embeddings of rendered views of this very mesh.
    cloud : SemanticCloud, optional
        Surface points with features, made by the caller.
    encoder : str, optional
        Shown rendered views in grey: ``builtin`` (where nothing of all this is given), a ``.net``
        file, a Hugging Face name, a local checkpoint, an ONNX encoder's JSON, or
        ``package.module:Class``.
    method : str, optional
        Lift as this method does (``"wks"`` needs no features): ``"fused"`` where neither this nor `settings` is given.
    settings : TransferSettings, optional
        Lift as the method of these settings does.
    k : int, optional
        Eigenpairs; 60, or what the mesh allows, where none is given.
    working_vertices : int, optional
        Simplify above this many vertices, 0 keeps them all; 10 000 where none is given.
    n_samples : int, optional
        Points of the cloud; the method's own number where none is given.
    seed : int, optional
        Of everything drawn by chance; 0 where none is given.
    cache : cache, optional
        Where prepared shapes and embeddings are kept: a folder, or True for the user's own.
    progress : progress, optional

    Returns
    -------
    PreparedObject

    Examples
    --------
    >>> import semfm
    >>> demo = semfm.demo_object("tools", n_vertices=400)
    >>> prepared = semfm.prepare(demo.mesh, features=demo.part_features(), k=20)
    >>> prepared.cloud.dim == len(demo.part_names)
    True
    """
    ...

def printable(text: str) -> str:
    """The text without what a terminal would obey (escape sequences of others).

    Parameters
    ----------
    text : str

    Returns
    -------
    str
    """
    ...

def read_file(path: _Path) -> bytes:
    """Reads a regular file whole; a device, a pipe, a folder or a stand-in of Git LFS is refused.

    Parameters
    ----------
    path : path

    Returns
    -------
    bytes
    """
    ...

def read_hand(path: _Path, *, vertices: Optional[Union[ArrayLike, _Path]] = None, mirrored: bool = False, observation: Optional[Observation] = None, mask: Optional[Union[str, ArrayLike]] = None, focal: Optional[float] = None) -> Hand:
    """Reads a hand as ``semfm-cli region --hand`` does: a mesh or cloud (HaMeR, WiLoR, SAM 3D Body), or .npz of vertices and
    joints, in metres.

    Parameters
    ----------
    path : path
        OpenGL's axes (y up, z towards the viewer) are seen and turned.
    vertices : (v,) array_like or path, optional
        Ids of the hand's vertices, where the file is a whole body.
    mirrored : bool, default False
        The hand stands in the file as in a mirror: a left one that was not turned back.
    observation : Observation, optional
        What the camera saw: the mask cuts the hand out of a whole body, and a depth image tells how far away it is: each
        point keeps its pixel.
    mask : str or (height, width) array_like, optional
        The hand's mask in it: a name, an array of dtype bool, or the only one that there is where none is given.
    focal : float, optional
        Focal length in pixels that the hand was made with, where it is not the camera's; the observation then has a depth
        image.

    Returns
    -------
    Hand

    Raises
    ------
    InvalidInput
        `mask` without an observation, `focal` without one that has a depth image: nothing would read them.
    """
    ...

def read_mesh(path: _Path, *, texture: Optional[_Path] = None) -> MeshFile:
    """Reads a mesh file with its colours.

    Parameters
    ----------
    path : path
        The file, in any format of ``mesh_formats()``.
    texture : path, optional
        An image for a mesh with texture coordinates (OBJ, PLY).

    Returns
    -------
    MeshFile
    """
    ...

def read_observations(source: _Path, *, every: int = 1, most: Optional[int] = None, color_topic: Optional[str] = None, depth_topic: Optional[str] = None, info_topic: Optional[str] = None, fixed_frame: Optional[str] = None, max_gap: float = 0.03) -> Observations:
    """The frames of a BOP scene or of a bag, as ``semfm-cli frames`` and ``semfm-cli track`` read them.

    Parameters
    ----------
    source : path
        A bag (`.mcap`, or a folder of them) or the folder of a BOP scene.
    every : int, default 1
        Take the first frame and each that is so many further on.
    most : int, optional
        Take at most so many.
    color_topic : str, optional
        Topic of the colour in a bag, where several could be meant.
    depth_topic : str, optional
        Topic of the depth, or of the clouds.
    info_topic : str, optional
        Topic of the camera; ``camera_info`` beside the depth where none is given.
    fixed_frame : str, optional
        Frame in which the camera's poses are given; the camera's own where none is given.
    max_gap : float, default 0.03
        Farthest apart that colour, depth and transforms of one frame may be, seconds.

    Returns
    -------
    Observations
        Reading begins at once and stays up to two frames ahead; what is wrong with the source is raised when the frame
        is asked for that could not be read.

    Examples
    --------
    >>> import numpy as np
    >>> import semfm, tempfile
    >>> k = [[60, 0, 31.5], [0, 60, 23.5], [0, 0, 1]]
    >>> frames = [semfm.Observation(k, depth=np.full((48, 64), z)) for z in (0.5, 0.6, 0.7)]
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     path = semfm.write_observations(folder + "/seen.mcap", frames)
    ...     for seen in semfm.read_observations(path, every=2):
    ...         print(seen, round(float(seen.depth[0, 0]), 3))
    Observation(64 × 48, depth) 0.5
    Observation(64 × 48, depth) 0.7
    """
    ...

def read_transfer(folder: _Path) -> StoredTransfer:
    """Reads the folder of a transfer, and checks that its files belong together.

    Parameters
    ----------
    folder : path
        As `semfm-cli transfer -o` and `Transfer.write` make it.

    Returns
    -------
    StoredTransfer

    Examples
    --------
    >>> import tempfile
    >>> import semfm
    >>> mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=400) for i in (0, 1))
    >>> result = semfm.transfer(
    ...     mug.mesh, kettle.mesh, mug.region,
    ...     source_features=mug.shared_features(), target_features=kettle.shared_features())
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     _ = result.write(folder)
    ...     again = semfm.read_transfer(folder)
    >>> again.verdict == result.verdict and again.point_map == result.point_map
    True
    """
    ...

def render(mesh: Union[_MeshLike, MeshFile], cameras: Optional[Iterable[Pinhole]] = None, *, colors: Optional[ArrayLike] = None, supersampling: int = 2, background: Optional[ArrayLike] = None, occlusion: float = 0.0, edges: float = 0.0, normals: bool = False, progress: Optional[_Progress] = None) -> list[View]:
    """One picture per camera, with depth and triangle of every pixel.

    Parameters
    ----------
    mesh : mesh_like or MeshFile
        A `MeshFile` is drawn in its own colours.
    cameras : list of Pinhole, optional
        As `rig` makes them where none are given.
    colors : (n, 3) array_like, optional
        sRGB of each vertex, 0 to 1.
    supersampling : int, default 2
        Colour samples along each side of a pixel, 1 to 8.
    background : (3,) array_like, optional
        sRGB, 0 to 1; white where none is given.
    occlusion : float, default 0.0
        How much what is closed in is darkened, 0 to 1.
    edges : float, default 0.0
        How dark silhouettes and creases are drawn, 0 to 1.
    normals : bool, default False
        Draw the surface's directions as colours, instead of light.
    progress : progress, optional

    Returns
    -------
    list of View

    Examples
    --------
    >>> import semfm, semfm.zoo
    >>> mesh = semfm.zoo.torus(40, 20)
    >>> views = semfm.render(mesh, semfm.rig(mesh, count=3, size=64))
    >>> len(views), views[0].rgb.shape
    (3, (64, 64, 3))
    """
    ...

def rig(mesh: _MeshLike, *, count: int = 14, size: int = 224, field_of_view: float = 0.5235987755982988, fill: float = 0.8, max_zoom: float = 1.5, principal_frame: bool = True, close_ups: int = 0) -> list[Pinhole]:
    """Cameras all around an object, each zoomed and centred on its silhouette.

    Parameters
    ----------
    mesh : mesh_like
    count : int, default 14
        Number of views.
    size : int, default 224
        Side of the square images, in pixels.
    field_of_view : float, default 0.5235987755982988
        Full angle that the bounding sphere would fill, in radians.
    fill : float, default 0.8
        Share of the image's side that the silhouette fills.
    max_zoom : float, default 1.5
        Largest zoom beyond the fit of the bounding sphere.
    principal_frame : bool, default True
        Pose the cameras in the object's principal frame, else in the file's with z up.
    close_ups : int, default 0
        Close-ups beside each view, along the silhouette's longer side.

    Returns
    -------
    list of Pinhole
    """
    ...

def run(recipe: _Path, output: _Path, *, cache: bool = True, progress: Optional[_Progress] = None) -> RunResult:
    """Goes from pictures of a demonstration to a grasp by one recipe: pose, region, transfer, grasps and motion.

    The same as ``semfm-cli run``: each stage keeps its files in a folder of its own and is done again only when
    something that it was made from has changed. `docs/observations.md` tells of recipes and stages. Two runs must not write
    one folder at once. Where a run is interrupted, the stage at work replaces nothing.

    Parameters
    ----------
    recipe : path
        The recipe (TOML); ``semfm-cli run --template`` prints one with every key explained.
    output : path
        Folder for the results; made if it is not there.
    cache : bool, default True
        Whether prepared shapes and embeddings are kept between runs, where the recipe does not forbid it.
    progress : progress, optional
        Hears of each stage by its name, 0 of 1 when it begins and 1 of 1 when it is there, and of the steps within.

    Returns
    -------
    RunResult
        That a stage has no answer is no error: see `RunResult.no_answer`.
    """
    ...

def run_cli(arguments: Iterable[str]) -> int:
    """Runs the command line of `semfm-cli`.

    Parameters
    ----------
    arguments : list of str
        Without the program's name.

    Returns
    -------
    int
        The exit code.
    """
    ...

def sample_even(mesh: _MeshLike, n: int, *, seed: int = 0) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.uint32]]:
    """Points as far from each other as they can be, out of six times as many uniform ones.

    Parameters
    ----------
    mesh : mesh_like
    n : int
    seed : int, default 0

    Returns
    -------
    points : (n, 3) float64 array
    normals : (n, 3) float64 array
        Unit normals of the triangles.
    faces : (n,) uint32 array
        Triangle of each point.

    Examples
    --------
    >>> import semfm, semfm.zoo
    >>> points, normals, faces = semfm.sample_even(semfm.zoo.icosphere(2), 50)
    >>> points.shape
    (50, 3)
    """
    ...

def sample_uniform(mesh: _MeshLike, n: int, *, seed: int = 0) -> tuple[NDArray[numpy.float64], NDArray[numpy.float64], NDArray[numpy.uint32]]:
    """Independent points, uniform by area.

    Parameters
    ----------
    mesh : mesh_like
    n : int
    seed : int, default 0

    Returns
    -------
    points : (n, 3) float64 array
    normals : (n, 3) float64 array
        Unit normals of the triangles.
    faces : (n,) uint32 array
        Triangle of each point.
    """
    ...

def set_num_threads(n_threads: int) -> None:
    """Sets the number of worker threads of later calls. Results do not depend on it.

    Parameters
    ----------
    n_threads : int
        Threads; 0 takes one for each core (or `RAYON_NUM_THREADS`).

    Examples
    --------
    >>> import semfm
    >>> semfm.set_num_threads(2)
    >>> semfm.get_num_threads()
    2
    >>> semfm.set_num_threads(0)
    """
    ...

def spectral_clusters(cloud: SemanticCloud, *, n_clusters: int = 5, neighbours: int = 10, starts: int = 10, seed: int = 0, progress: Optional[_Progress] = None) -> Clusters:
    """Cuts a cloud into parts: spectral clustering on its neighbour graph, weighed by features.

    Parameters
    ----------
    cloud : SemanticCloud
    n_clusters : int, default 5
        Parts.
    neighbours : int, default 10
        Neighbours of each point in space.
    starts : int, default 10
        Seedings of k-means, the best of which is kept.
    seed : int, default 0
    progress : progress, optional

    Returns
    -------
    Clusters
    """
    ...

def torus(n_around: int, n_across: int) -> Mesh:
    """A torus.

    Parameters
    ----------
    n_around : int
        Vertices around the axis, 3 to 2000.
    n_across : int
        Vertices around the tube, 3 to 2000.

    Returns
    -------
    Mesh
    """
    ...

def transfer(source: Union[_MeshLike, MeshFile, PreparedObject], target: Union[_MeshLike, MeshFile, PreparedObject], region: Union[Region, _Path], *, source_features: Optional[ArrayLike] = None, target_features: Optional[ArrayLike] = None, source_embeddings: Optional[Union[Embeddings, _Path]] = None, target_embeddings: Optional[Union[Embeddings, _Path]] = None, source_cloud: Optional[SemanticCloud] = None, target_cloud: Optional[SemanticCloud] = None, encoder: Optional[str] = None, method: Optional[str] = None, rule: Optional[str] = None, seed: Optional[int] = None, second_opinion: Optional[bool] = None, settings: Optional[TransferSettings] = None, k: Optional[int] = None, working_vertices: Optional[int] = None, cache: Optional[_Cache] = None, progress: Optional[_Progress] = None) -> Transfer:
    """Transfers a demonstrated region from one object to another.

    Where neither features, embeddings nor clouds are given, an encoder makes them.

    Parameters
    ----------
    source : mesh_like or MeshFile or PreparedObject
        The demonstrated object.
    target : mesh_like or MeshFile or PreparedObject
        The one to act on.
    region : Region or path
        Where the demonstration touched the source.
    source_features : (n_source, d) array_like, optional
        A feature vector per vertex, from any network.
    target_features : (n_target, d) array_like, optional
    source_embeddings : Embeddings or path, optional
        Patch embeddings of rendered views, or of what a camera saw (`ObservedObject.embed`). Where one object alone has
        some, the other is shown to the encoder that made them.
    target_embeddings : Embeddings or path, optional
    source_cloud : SemanticCloud, optional
        Surface points with features, made by the caller.
    target_cloud : SemanticCloud, optional
    encoder : str, optional
        Shown rendered views: ``builtin`` (where nothing of all this is given), a ``.net`` file, a
        Hugging Face name, a local checkpoint, an ONNX encoder's JSON, or ``package.module:Class``.
    method : str, optional
        ``fused`` (where neither this nor `settings` is given), ``semfm`` (the paper to the letter),
        ``anchored``, ``sinkhorn``, ``nearest``, or ``wks``, which needs no features.
    rule : str, optional
        How a map transfers the region: ``preimage`` (where none is given) or ``image``.
    seed : int, optional
        Of everything drawn by chance; 0 where none is given.
    second_opinion : bool, optional
        Whether an independent method judges the result, too; the method's own default where none is
        given: True where its confidence is the agreement of the two.
    settings : TransferSettings, optional
        Everything that can be set, in place of `method` and `rule`.
    k : int, optional
        Eigenpairs of each shape; 60, or what the mesh allows, where none is given.
    working_vertices : int, optional
        Simplify above this many vertices, 0 keeps them all; 10 000 where none is given.
    cache : cache, optional
        Where prepared shapes and embeddings are kept: a folder, or True for the user's own.
    progress : progress, optional

    Returns
    -------
    Transfer
        A region that lands nowhere is no error but the verdict ``"refuse"``.

    Examples
    --------
    >>> import semfm
    >>> mug, kettle = (semfm.demo_object("containers", instance=i, n_vertices=500) for i in (0, 1))
    >>> result = semfm.transfer(
    ...     mug.mesh, kettle.mesh, mug.region,
    ...     source_features=mug.shared_features(), target_features=kettle.shared_features())
    >>> result.region.n_vertices == kettle.mesh.n_vertices
    True
    """
    ...

def tufted_laplacian(mesh: _MeshLike, *, mollify_factor: float = 1e-05) -> Laplacian:
    """The intrinsic Delaunay Laplacian of the tufted cover (Sharp & Crane 2020).

    Parameters
    ----------
    mesh : mesh_like
    mollify_factor : float, default 1e-5
        By how much edges of degenerate triangles are made longer, relative to the mean edge.

    Returns
    -------
    Laplacian
    """
    ...

def wks(basis: Eigenbasis, *, n_energies: int = 100) -> NDArray[numpy.float64]:
    """Wave kernel signature (Aubry, Schlickewei & Cremers 2011), with pyFM's energies and width.

    Parameters
    ----------
    basis : Eigenbasis
    n_energies : int, default 100
        Energies, spread evenly over the logarithms of the eigenvalues.

    Returns
    -------
    (n, n_energies) float64 array

    Examples
    --------
    >>> import semfm, semfm.zoo
    >>> shape = semfm.Shape(semfm.zoo.torus(20, 10), k=15)
    >>> semfm.wks(shape.basis, n_energies=30).shape
    (200, 30)
    """
    ...

def write_file(path: _Path, content: bytes) -> None:
    """Writes bytes to a file, whole or not at all.

    Parameters
    ----------
    path : path
    content : bytes
    """
    ...

def write_observations(path: _Path, observations: Iterable[Observation]) -> str:
    """Writes frames as ``semfm-cli frames`` does.

    Parameters
    ----------
    path : path
        A ROS 2 bag (``NAME.mcap``), or a folder, which becomes a BOP scene.
    observations : list of Observation

    Returns
    -------
    str
        The path.
    """
    ...
