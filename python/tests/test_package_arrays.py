"""Arrays in: every dtype, order and stride, or an error that names the argument and both shapes."""

from __future__ import annotations

import numpy as np
import pytest

import semfm
import semfm.zoo

VERTICES = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=np.float64)
FACES = np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]], dtype=np.int64)


def strided(array):
    wide = np.zeros((2 * array.shape[0], 3 * array.shape[1]), dtype=array.dtype)
    wide[::2, ::3] = array
    return wide[::2, ::3]


def read_only(array):
    array = array.copy()
    array.flags.writeable = False
    return array


LAYOUTS = {
    "C": np.ascontiguousarray,
    "Fortran": np.asfortranarray,
    "strided": strided,
    "reversed": lambda a: a[::-1].copy()[::-1],
    "read-only": read_only,
    "big-endian": lambda a: a.astype(a.dtype.newbyteorder(">")),
    "list": lambda a: a.tolist(),
}


@pytest.mark.parametrize("layout", LAYOUTS)
@pytest.mark.parametrize("ids", ["int8", "uint8", "int32", "uint32", "int64", "uint64"])
@pytest.mark.parametrize("real", ["float32", "float64", "int32", "int64"])
def test_every_dtype_and_layout_gives_the_same_mesh(layout, ids, real):
    change = LAYOUTS[layout]
    mesh = semfm.Mesh(change(VERTICES.astype(real)), change(FACES.astype(ids)))
    assert mesh == semfm.Mesh(VERTICES, FACES)
    assert mesh.vertices.dtype == np.float64 and mesh.faces.dtype == np.uint32


@pytest.mark.parametrize(
    ("vertices", "faces", "error", "words"),
    [
        (VERTICES.astype(complex), FACES, TypeError, ["vertices", "(n, 3)", "complex128"]),
        (VERTICES.astype(object), FACES, TypeError, ["vertices", "object"]),
        (VERTICES > 0, FACES, TypeError, ["vertices", "bool"]),
        ("a mesh", FACES, TypeError, ["vertices", "real numbers"]),
        ([[0, 0], [1]], FACES, TypeError, ["vertices", "list"]),
        (VERTICES[:, :2], FACES, ValueError, ["vertices", "(n, 3)", "(4, 2)"]),
        (VERTICES.ravel(), FACES, ValueError, ["vertices", "(n, 3)", "(12,)"]),
        (VERTICES, FACES.astype(float), TypeError, ["faces", "integers", "float64"]),
        (VERTICES, FACES[:, :2], ValueError, ["faces", "(m, 3)", "(4, 2)"]),
        (VERTICES, FACES - 1, ValueError, ["faces", "-1"]),
        (VERTICES, FACES + 2**40, ValueError, ["faces", str(2**40)]),
        (VERTICES, FACES + 1, ValueError, ["vertex 4", "4 vertices"]),
        (np.where(VERTICES > 0, np.nan, VERTICES), FACES, ValueError, ["vertex 1", "NaN"]),
        (VERTICES[:0], FACES, ValueError, ["0 vertices"]),
    ],
)
def test_what_is_no_mesh_is_refused_by_name(vertices, faces, error, words):
    with pytest.raises(error) as caught:
        semfm.Mesh(vertices, faces)
    assert all(word in str(caught.value) for word in words), str(caught.value)
    assert isinstance(caught.value, semfm.SemfmError)


def test_our_errors_have_a_code_and_a_place_and_go_through_pickle(tmp_path):
    import pickle

    with pytest.raises(semfm.SemfmError) as caught:
        semfm.Mesh(np.full((3, 3), np.inf), [[0, 1, 2]])
    assert (caught.value.code, caught.value.place) == ("non-finite", "vertex 0")
    again = pickle.loads(pickle.dumps(caught.value))
    assert (type(again), str(again), again.code) == (
        semfm.InvalidInput,
        str(caught.value),
        "non-finite",
    )
    with pytest.raises(OSError) as caught:
        semfm.Mesh.read(tmp_path / "nothing.obj")
    assert isinstance(caught.value, semfm.FileError) and caught.value.code == "io"
    broken = tmp_path / "broken.off"
    broken.write_text("OFF\n3 1 0\n0 0 0\n1 0 0\n0 1 x\n3 0 1 2\n")
    with pytest.raises(semfm.FormatError) as caught:
        semfm.Mesh.read(broken)
    assert caught.value.code == "format" and "line 5" in caught.value.place


def test_numbers_that_are_not_finite_are_named_where_they_stand():
    shape = semfm.Shape(semfm.Mesh(VERTICES, FACES), k=3)
    features = np.zeros((4, 2))
    features[2, 1] = np.nan
    for call in (
        lambda: shape.basis.project(features),
        lambda: semfm.prepare(shape.original, features=features),
        lambda: semfm.SemanticCloud(VERTICES, features),
    ):
        with pytest.raises(semfm.InvalidInput, match="nan"):
            call()


@pytest.mark.parametrize("huge", [10**6, 10**12, 2**63])
def test_a_count_that_no_machine_holds_is_an_error_and_not_the_end(huge):
    mesh = semfm.demo_object("tools", n_vertices=300).mesh
    basis = semfm.Shape(mesh, k=5).basis
    with pytest.raises(semfm.InvalidInput):
        semfm.Shape(mesh, k=huge, clip_k=False)
    with pytest.raises(semfm.InvalidInput):
        semfm.eigenbasis(semfm.laplacian(mesh), huge)
    if huge > 10**6:
        for call in (
            lambda: semfm.sample_even(mesh, huge),
            lambda: semfm.wks(basis, n_energies=huge),
            lambda: semfm.Region.from_vertices(huge, [0]),
            lambda: semfm.rig(mesh, count=huge),
        ):
            with pytest.raises((ValueError, OverflowError)):
                call()
    assert semfm.point_cloud_laplacian(mesh.vertices, n_neighbors=10**18).n_vertices > 0
    with pytest.raises(semfm.InvalidInput, match="100000"):
        semfm.TransferSettings(clusters={"neighbours": huge})


def test_other_arguments_are_refused_by_name():
    mesh = semfm.Mesh(VERTICES, FACES)
    basis = semfm.Shape(mesh, k=3).basis
    for call, error, words in [
        (lambda: semfm.Shape(42), TypeError, ["mesh", "path", "int"]),
        (lambda: semfm.Shape(mesh, laplacian="round"), ValueError, ["laplacian", "'tufted'"]),
        (lambda: semfm.Shape(mesh, cache=1.5), TypeError, ["cache"]),
        (lambda: semfm.Shape(mesh, progress="loud"), TypeError, ["progress"]),
        (lambda: basis.project(np.zeros(5)), ValueError, ["functions", "(4,)", "(5,)"]),
        (lambda: basis.reconstruct(np.zeros(5)), ValueError, ["coefficients", "at most 3"]),
        (lambda: semfm.Region([0.5, 1.5]), ValueError, ["vertex 1"]),
        (lambda: semfm.Region.from_mask([0, 1]), TypeError, ["inside", "bool"]),
        (lambda: semfm.Region.from_vertices(3, [0.5]), TypeError, ["vertices", "float64"]),
        (lambda: semfm.PointMap([0, 3], 3), ValueError, ["target vertex 1"]),
        (lambda: semfm.PointMap([0], 3).pull_back([1, 2]), ValueError, ["3 rows", "2"]),
        (lambda: semfm.FunctionalMap(np.eye(9)).to_point_map(basis, basis), ValueError, ["source"]),
        (lambda: semfm.HeatGeodesics(mesh).distances([7]), ValueError, ["source vertex", "7"]),
        (lambda: semfm.TransferSettings("best"), ValueError, ["method", "fused"]),
        (lambda: semfm.TransferSettings(zoomout={"k": 3}), TypeError, ["zoomout.k", "k_final"]),
        (lambda: semfm.prepare(mesh, encoder=""), ValueError, ["encoder", "builtin"]),
        (lambda: semfm.prepare(mesh, features=np.zeros((3, 2))), ValueError, ["(4, d)", "(3, 2)"]),
        (lambda: semfm.Pinhole.with_pixel_centres_at_half(4, 4, 1, 1, 0, 0, -np.eye(4)), ValueError, ["last row"]),
        (
            lambda: semfm.transfer(mesh, mesh, "grip", encoder="builtin", source_features=[[1]]),
            ValueError,
            ["encoder", "several"],
        ),
    ]:
        with pytest.raises(error) as caught:
            call()
        assert all(word in str(caught.value) for word in words), str(caught.value)
        assert isinstance(caught.value, semfm.SemfmError) and caught.value.code


def test_an_orientation_needs_two_meshes_with_two_sides():
    # A torus and its mirror image; the surface of the second is wound outward again.
    torus = semfm.zoo.torus(30, 15)
    vertices = np.array(torus.vertices)
    lumpy = vertices * (1 + 0.2 * np.sin(2 * vertices[:, :1]) + 0.1 * vertices[:, 1:2])
    source = semfm.Mesh(lumpy, torus.faces)
    target = semfm.Mesh(lumpy * [1, 1, -1], torus.faces[:, ::-1])
    basis = semfm.Shape(source, k=15, bridges=False).basis
    bases = (basis, semfm.Eigenbasis(basis.values, basis.functions, basis.mass))
    signature = semfm.wks(basis)

    def fit(**settings):
        return semfm.FunctionalMap.fit(*bases, signature, signature, laplacian=0.01, **settings)

    both = dict(source_mesh=source, target_mesh=target)
    # The target's vertices are those of the source mirrored: what reverses is the identity.
    reversed_map = fit(descriptors=1, orientation=1, reversing=True, **both).matrix
    kept = fit(descriptors=1, orientation=1, **both).matrix
    assert np.linalg.norm(reversed_map - np.eye(15)) < 0.1 * np.sqrt(15)
    assert np.linalg.norm(kept - np.eye(15)) > 0.3 * np.sqrt(15)
    with pytest.raises(semfm.InvalidInput, match="source_mesh, target_mesh"):
        fit(orientation=1, source_mesh=source)
    half = np.vstack([torus.faces[:400], torus.faces[400:, ::-1]])
    with pytest.raises(semfm.InvalidInput, match="wound consistently"):
        fit(orientation=1, source_mesh=source, target_mesh=semfm.Mesh(vertices, half))
    inside_out = semfm.Mesh(vertices, torus.faces[:, ::-1])
    with pytest.raises(semfm.InvalidInput, match="outside"):
        fit(orientation=1, source_mesh=source, target_mesh=inside_out)
