"""The same numbers as the libraries people come from, on the same inputs, to stated tolerances.

robust_laplacian and potpourri3d (Sharp), eigsh of SciPy, pyFM (Magnet): `pip install --group peers .`.
"""

from __future__ import annotations

import numpy as np
import pytest

import semfm
import semfm.zoo

scipy_sparse = pytest.importorskip("scipy.sparse.linalg")

# Same matrices, two solvers that both reach machine precision: room for the conditioning only.
EIGENVALUES = 1e-10
# Two codes for one method; they part where potpourri3d's Poisson solve is regularised.
GEODESICS = 1e-3


def objects():
    return {
        "mug": semfm.demo_object("containers", n_vertices=1200).mesh,
        "torus": semfm.zoo.torus(50, 25),
        "scissors": semfm.demo_object("scissors", n_vertices=1200).mesh,
    }


@pytest.fixture(scope="module", params=["mug", "torus", "scissors"])
def mesh(request):
    return objects()[request.param]


def as_arrays(mesh):
    return np.array(mesh.vertices), mesh.faces.astype(np.int64)


def their_values(stiffness, mass, k):
    """Smallest eigenvalues with shift-invert, the shift relative to the area's scale."""
    shift = -0.01 / mass.sum()
    return np.sort(scipy_sparse.eigsh(stiffness, k, mass, sigma=shift, return_eigenvectors=False))


# ---- Laplacians, spectra and geodesics


def test_tufted_laplacian_and_its_spectrum_are_those_of_robust_laplacian(mesh):
    robust = pytest.importorskip("robust_laplacian")
    stiffness, mass = robust.mesh_laplacian(*as_arrays(mesh), mollify_factor=1e-5)
    ours = semfm.tufted_laplacian(mesh, mollify_factor=1e-5)
    assert abs(stiffness - ours.stiffness).max() < 1e-12 * abs(stiffness).max()
    assert np.allclose(mass.diagonal(), ours.mass, rtol=1e-12)
    values = their_values(stiffness, mass, 50)
    assert np.abs(semfm.eigenbasis(ours, 50).values - values).max() < EIGENVALUES * values[-1]


def test_a_broken_mesh_has_the_spectrum_of_robust_laplacian():
    # Holes, a floating blob. Ties between flips of equal weight may fall differently, which moves
    # mass between neighbours and eigenvalues by 1.4e-5.
    robust = pytest.importorskip("robust_laplacian")
    mesh = semfm.demo_object("tools", n_vertices=1500, holes=2, floaters=1).mesh
    stiffness, mass = robust.mesh_laplacian(*as_arrays(mesh))
    ours = semfm.tufted_laplacian(mesh)
    assert abs(stiffness - ours.stiffness).max() < 1e-6 * abs(stiffness).max()
    assert mass.diagonal().sum() == pytest.approx(ours.mass.sum(), rel=1e-10)
    values = their_values(stiffness, mass, 50)
    assert np.abs(semfm.eigenbasis(ours, 50).values - values).max() < 1e-4 * values[-1]


def test_point_cloud_laplacian_has_the_spectrum_of_robust_laplacian():
    robust = pytest.importorskip("robust_laplacian")
    points = np.array(semfm.zoo.torus(50, 25).vertices)
    values = their_values(*robust.point_cloud_laplacian(points), 40)
    ours = semfm.eigenbasis(semfm.point_cloud_laplacian(points), 40)
    assert np.abs(ours.values - values).max() < EIGENVALUES * values[-1]


def test_matrices_go_to_scipy_and_come_back(mesh):
    ours = semfm.cotan_laplacian(mesh)
    values = their_values(ours.stiffness, ours.mass_matrix, 30)
    back = semfm.Laplacian(ours.stiffness.tocsr(), ours.mass)
    assert np.abs(semfm.eigenbasis(back, 30).values - values).max() < EIGENVALUES * values[-1]


@pytest.mark.parametrize("source", [0, 500])
def test_geodesics_are_those_of_potpourri3d(mesh, source):
    potpourri = pytest.importorskip("potpourri3d")
    solver = potpourri.MeshHeatMethodDistanceSolver(*as_arrays(mesh), t_coef=1.0, use_robust=True)
    ours = semfm.HeatGeodesics(mesh).distances(source)
    theirs = solver.compute_distance(source)
    reached = np.isfinite(ours)
    assert reached.all()
    assert np.abs(ours - theirs).max() < GEODESICS * mesh.diagonal


def test_bases_and_maps_survive_npz(tmp_path, mesh):
    basis = semfm.Shape(mesh, k=12).basis
    basis.to_npz(tmp_path / "basis.npz")
    read = np.load(tmp_path / "basis.npz")
    assert sorted(read.files) == ["functions", "mass", "residuals", "values"]
    assert np.array_equal(read["functions"], basis.functions)
    # Files that somebody else wrote with NumPy, compressed.
    np.savez_compressed(tmp_path / "theirs.npz", **{name: read[name] for name in read.files})
    again = semfm.Eigenbasis.from_npz(tmp_path / "theirs.npz")
    assert np.array_equal(again.values, basis.values) and np.array_equal(again.mass, basis.mass)
    matrix = np.random.default_rng(0).normal(size=(5, 4))
    np.savez(tmp_path / "map.npz", matrix=matrix)
    assert np.array_equal(semfm.FunctionalMap.from_npz(tmp_path / "map.npz").matrix, matrix)
    np.savez(tmp_path / "points.npz", source_of=[2, 0, 1, 1], n_source=3)
    read = semfm.PointMap.from_npz(tmp_path / "points.npz")
    assert read.source_of.tolist() == [2, 0, 1, 1] and read.n_source == 3


# ---- functional maps, beside pyFM

K, K_FINAL, STEP = 20, 60, 5


@pytest.fixture(scope="module")
def sides():
    """pyFM's two meshes with its spectra, and the same spectra as our bases."""
    trimesh = pytest.importorskip("pyFM.mesh").TriMesh
    theirs = []
    for instance in (0, 1):
        mesh = semfm.demo_object("containers", instance=instance, n_vertices=1000).mesh
        theirs.append(trimesh(*as_arrays(mesh), area_normalize=True).process(k=K_FINAL))
    ours = [
        semfm.Eigenbasis(each.eigenvalues.clip(0), each.eigenvectors, each.A.diagonal())
        for each in theirs
    ]
    return theirs, ours


@pytest.fixture(scope="module")
def functions(sides):
    """Forty smooth functions on either side that a turn of the coefficients relates, with noise."""
    rng = np.random.default_rng(1)
    turn = np.linalg.qr(np.eye(K) + 0.2 * rng.normal(size=(K, K)))[0]
    source = rng.normal(size=(K, 40))
    target = turn @ source + 0.1 * rng.normal(size=(K, 40))
    return [basis.reconstruct(each) for basis, each in zip(sides[1], (source, target))]


@pytest.fixture(scope="module")
def rough_map():
    return semfm.FunctionalMap(np.eye(K) + 0.1 * np.random.default_rng(2).normal(size=(K, K)))


def test_our_eigenbasis_of_cotangents_is_pyfms(sides):
    for theirs in sides[0]:
        mesh = semfm.Mesh(theirs.vertices, theirs.faces)
        values = semfm.eigenbasis(semfm.cotan_laplacian(mesh), K_FINAL).values
        assert np.abs(values - theirs.eigenvalues).max() < EIGENVALUES * values[-1]


def test_signatures_are_pyfms(sides):
    signatures = pytest.importorskip("pyFM.signatures")
    for theirs, ours in zip(*sides):
        wave = signatures.mesh_WKS(theirs, 50)
        assert np.allclose(semfm.wks(ours, n_energies=50), wave, rtol=1e-9, atol=1e-12)
        heat = signatures.mesh_HKS(theirs, 50)
        assert np.allclose(semfm.hks(ours, n_times=50), heat, rtol=1e-9, atol=1e-12)


# Weight of the constant among our descriptors: large enough to pin the first column of C to about
# 1e-5, as pyFM does exactly; ten times more and the floor of our normal equations would show.
PIN = 1e3


def pyfm_fit(sides, functions, w_lap, w_dcomm, w_orient, reversing):
    """pyFM's map, solved as tightly as L-BFGS can, and ours for the same energy."""
    model = pytest.importorskip("pyFM.functional").FunctionalMapping(*sides[0])
    weights = pytest.importorskip("pyFM.optimize.weights")
    model.add_descriptors(*functions, normalize=False)
    model.fit(
        K=(K, K),
        w_descr=1,
        w_lap=w_lap,
        w_dcomm=w_dcomm,
        w_orient=w_orient,
        orient_reversing=reversing,
        use_resolvent_laplacian=False,
        factr=1.0,
        pgtol=1e-12,
    )
    source, target = (basis.truncated(K).project(each) for basis, each in zip(sides[1], functions))
    gap = (sides[1][1].values[:K, None] - sides[1][0].values[None, :K]) ** 2
    operators = model._compute_descr_op()
    turns = model._compute_orientation_op(reversing)
    scales = weights.canonical_taus(source, target, operators, turns, gap)
    # docs/coming-from-pyfm.md, "Weights": pyFM divides each term by its own scale, we by another,
    # in which the constant that pins the first column counts as a descriptor.
    pinned = [np.hstack([each, np.full((len(each), 1), PIN)]) for each in functions]
    unit = (np.trace(source @ source.T) + PIN**2) / K
    size, turned = (
        sum((each**2).sum() for side in family for each in side) / (2 * K)
        for family in (operators, turns)
    )
    meshes = [semfm.Mesh(each.vertices, each.faces) for each in sides[0]]
    ours = semfm.FunctionalMap.fit(
        *sides[1],
        *pinned,
        k=K,
        laplacian=w_lap * scales[0] / scales[1] * gap.max() / unit,
        descriptors=w_dcomm * scales[0] / scales[2] * (size + PIN**2) / unit,
        orientation=w_orient * scales[0] / scales[3] * turned / unit,
        reversing=reversing,
        source_mesh=meshes[0],
        target_mesh=meshes[1],
    )
    return model.FM_12, ours.matrix


@pytest.mark.parametrize(
    ("w_lap", "w_dcomm", "w_orient", "reversing"),
    [
        (0, 0, 0, False),
        (0.01, 0, 0, False),
        (1, 0, 0, False),
        (0.01, 0.1, 0, False),
        (0.1, 1, 0, False),
        (0.01, 0, 0.1, False),
        (0.1, 1, 1, False),
        (0.1, 1, 1, True),
    ],
)
def test_a_fit_is_pyfms(sides, functions, w_lap, w_dcomm, w_orient, reversing):
    theirs, ours = pyfm_fit(sides, functions, w_lap, w_dcomm, w_orient, reversing)
    # The first column is pinned to 1e-5, and L-BFGS stops at a gradient.
    assert np.linalg.norm(ours - theirs) < 1e-4 * np.linalg.norm(theirs)


def test_zoomout_is_pyfms(sides, rough_map):
    refine = pytest.importorskip("pyFM.refine")
    theirs, indices = refine.zoomout_refine(
        rough_map.matrix,
        *(each.eigenvectors for each in sides[0]),
        nit=(K_FINAL - K) // STEP,
        step=STEP,
        A2=sides[0][1].A,
        return_p2p=True,
    )
    ours = rough_map.zoomout(*sides[1], k_final=K_FINAL, step=STEP)
    assert np.linalg.norm(ours.matrix - theirs) < 1e-10 * np.linalg.norm(theirs)
    assert np.array_equal(ours.to_point_map(*sides[1]).source_of, indices)


@pytest.mark.parametrize("adjoint", [False, True])
def test_point_maps_are_pyfms(sides, rough_map, adjoint):
    spectral = pytest.importorskip("pyFM.spectral")
    vectors = [each.eigenvectors for each in sides[0]]
    theirs = spectral.FM_to_p2p(rough_map.matrix, *vectors, use_adj=adjoint)
    ours = rough_map.to_point_map(*sides[1], adjoint=adjoint)
    assert np.array_equal(ours.source_of, theirs) and len(ours) == len(vectors[1])
    back = spectral.p2p_to_FM(theirs, *vectors, A2=sides[0][1].A)
    again = semfm.FunctionalMap.from_point_map(ours, *sides[1], k=K_FINAL)
    assert np.abs(again.matrix - back).max() < 1e-12


def test_functions_travel_as_in_pyfm(sides, rough_map):
    functional = pytest.importorskip("pyFM.functional")
    model = functional.FunctionalMapping(*sides[0])
    model.FM_12 = rough_map.matrix
    height = np.array(sides[0][0].vertices[:, 2])
    source, target = sides[1]
    ours = target.reconstruct(rough_map.matrix @ source.truncated(K).project(height))
    assert np.abs(ours - model.transfer(height)).max() < 1e-12


def test_a_precise_map_lies_as_near_as_pyfms(sides, rough_map):
    utils = pytest.importorskip("pyFM.spectral.projection_utils")
    sparse = pytest.importorskip("scipy.sparse")
    theirs, ours = sides
    faces = theirs[0].faces
    found = rough_map.to_precise_map(*ours, semfm.Mesh(theirs[0].vertices, faces))
    corners = ours[0].functions[:, :K] @ rough_map.matrix.T
    queries = np.ascontiguousarray(ours[1].functions[:, :K])

    def distances(face_of, barycentric):
        points = np.einsum("ij,ijk->ik", barycentric, corners[faces[face_of]])
        return np.linalg.norm(points - queries, axis=1)

    their_faces, weights = utils.nn_query_precise_np(corners, faces, queries, n_jobs=1)
    here, there = distances(found.face_of, found.barycentric), distances(their_faces, weights)
    assert (here <= there + 1e-9 * there.max()).all()
    assert np.allclose(here, there, rtol=1e-6, atol=1e-6 * there.max())
    data, indices, indptr = found.to_csr()
    matrix = sparse.csr_matrix((data, indices, indptr), shape=(found.n_target, found.n_source))
    function = ours[0].functions[:, 3]
    assert np.allclose(matrix @ function, found.pull_back(function), rtol=1e-12, atol=1e-12)
    assert np.array_equal(found.corners, faces[found.face_of])


def test_zoomout_among_samples_of_both_sides_is_pyfms(sides, rough_map):
    refine = pytest.importorskip("pyFM.refine")
    theirs, ours = sides
    rng = np.random.default_rng(4)
    samples = [rng.permutation(each.n_vertices)[:600] for each in ours]
    # One turn: matches are the same then, and what is left is our ridge of 1e-4 a sample.
    grown = rough_map.zoomout(
        *ours, k_final=K + STEP, step=STEP, source_samples=samples[0], target_samples=samples[1]
    )
    vectors = [each.eigenvectors for each in theirs]
    expected = refine.zoomout_refine(
        rough_map.matrix, *vectors, nit=1, step=STEP, subsample=samples, n_jobs=1
    )
    assert np.linalg.norm(grown.matrix - expected) < 0.002 * np.linalg.norm(expected)
    with pytest.raises(semfm.InvalidInput, match="source_samples"):
        rough_map.zoomout(*ours, source_samples=[ours[0].n_vertices])
