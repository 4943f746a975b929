"""The training code's objects, targets, steps and exported file, in a few seconds."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
import pytest

sys.path.insert(0, str(Path(__file__).resolve().parents[2]))  # `train` is no part of the package

_MISSING = "the training code is not tested: needs `pip install --group train`"
torch = pytest.importorskip("torch", reason=_MISSING)
pytest.importorskip("skimage", reason=_MISSING)
pytest.importorskip("blake3", reason=_MISSING)

from train import dataset, examples, export, net, objects  # noqa: E402
from train import train as training  # noqa: E402
from train.augment import augmented  # noqa: E402
from train.families import FAMILIES, LEFT_OUT  # noqa: E402
from train.teacher import Teacher  # noqa: E402


@pytest.mark.parametrize("family", FAMILIES)
def test_every_family_makes_closed_meshes(family):
    vertices, faces = objects.surface(FAMILIES[family](np.random.default_rng(5)), resolution=48)
    edges = np.sort(np.vstack([faces[:, :2], faces[:, 1:], faces[:, ::2]]), axis=1)
    _, counts = np.unique(edges, axis=0, return_counts=True)
    assert (counts == 2).all(), "every edge has two triangles"
    a, b, c = vertices[faces].transpose(1, 0, 2)
    assert (a * np.cross(b, c)).sum() > 0, "triangles are wound outwards"


def test_an_object_is_the_same_on_every_call():
    first, second = objects.make_object("blade", 3), objects.make_object("blade", 3)
    assert np.array_equal(first.vertices, second.vertices)
    assert not np.array_equal(first.vertices[:50], objects.make_object("blade", 4).vertices[:50])


class _FlatTeacher:
    """Features without a network: the position of each point, sixty-four times over."""

    def fused_field(self, mesh, views):
        import semfm

        points, _, _ = semfm.sample_even(mesh, 300)[:3]
        waves = np.random.default_rng(0).normal(0, 6, (3, 80))
        return semfm.SemanticCloud(points, np.sin(points @ waves).astype(np.float32))


def test_a_teacher_fuses_its_tokens_on_the_surface(tmp_path):
    import semfm
    import tiny_onnx

    pytest.importorskip("onnxruntime", reason=_MISSING)
    drawn = objects.make_object("vessel", 1)
    mesh = semfm.Mesh(drawn.vertices, drawn.faces)
    views = semfm.render(mesh, semfm.rig(mesh, count=4, size=dataset.SIZE))
    field = Teacher(str(tiny_onnx.write_encoder(tmp_path))).fused_field(mesh, views)
    assert field.features.shape == (len(field.points), 7)
    assert np.isfinite(field.features).all() and np.ptp(field.features, axis=0).max() > 0


@pytest.fixture(scope="module")
def data(tmp_path_factory):
    folder = tmp_path_factory.mktemp("data")
    for index, family in enumerate(["vessel", "blade"]):
        drawn = objects.make_object(family, index)
        arrays = dataset.example(drawn, _FlatTeacher())
        dataset.write_example(folder / f"train_{index:05d}.npz", arrays)
    return folder


def test_targets_are_means_of_the_points_seen(data):
    with np.load(data / "train_00000.npz") as arrays:
        sample, features = arrays["sample"], arrays["features"]
        picture, ground = arrays["grey"][0], arrays["sample"][0] < 0
    assert sample.shape[1:] == (56, 56) and picture.shape == (224, 224)
    # the background is white, the object is not; edges are mixed
    looked_at = picture[2::4, 2::4]
    assert np.median(looked_at[ground]) == 255 and (looked_at[~ground] < 255).all()
    assert (looked_at[ground] == 255).mean() > 0.9
    axes = examples.fit_axes(data, "train_*.npz")
    field = axes.project(features)
    targets, weights = examples.patch_targets(sample, field)
    v, r, c = np.argwhere(weights == 255)[0]
    inside = sample[v, 4 * r : 4 * r + 4, 4 * c : 4 * c + 4]
    expected = field[inside[inside >= 0]].mean(0)
    assert np.allclose(targets[v, r, c], expected, atol=2e-3)
    assert (weights[targets.astype(np.float32).any(-1) == 0] == 0).all()


def test_turns_move_pictures_targets_and_weights_alike():
    pictures = torch.full((8, 1, 224, 224), 255, dtype=torch.uint8)
    pictures[:, :, 16:32, 48:64] = 100  # patch (1, 3)
    targets, weights = torch.zeros(8, 14, 14, 64), torch.zeros(8, 14, 14, dtype=torch.uint8)
    targets[:, 1, 3], weights[:, 1, 3] = 1, 255
    turned = augmented(examples.Batch(pictures, targets, weights), torch.Generator().manual_seed(1))
    places = set()
    for picture, target, weight in zip(turned.pictures, turned.targets, turned.weights):
        (place,) = torch.nonzero(weight).tolist()
        places.add(tuple(place))
        assert target[tuple(place)].eq(1).all() and target.sum() == 64
        patches = picture[0].reshape(14, 16, 14, 16).transpose(1, 2).flatten(2)
        assert (patches - patches[0, 0, 0]).abs().amax(-1).gt(0.1).nonzero().tolist() == [place]
    assert len(places) > 3


def test_steps_lower_the_loss(data):
    axes = examples.fit_axes(data, "train_*.npz")
    seen = examples.Examples.empty()
    paths = sorted(data.glob("train_*.npz"))
    assert seen.load_new(paths, axes) == 2
    assert seen.load_new(paths, axes) == 0, "files are loaded once"
    settings = training.Settings(pictures=10**6, batch=8, decay=0)
    trainer = training.Trainer(settings)
    source = training.batches(seen, settings, 0)
    losses = [float(trainer.step(next(source)).loss.detach()) for _ in range(30)]
    assert np.mean(losses[-5:]) < 0.9 * np.mean(losses[:5])


def test_norms_merge_into_convolutions():
    student = export.random_student(3)
    merged = net.without_norms(student).eval()
    picture = torch.rand(2, 1, 224, 224) * 2 - 1
    with torch.no_grad():
        assert torch.allclose(merged(picture), student(picture), atol=1e-3)
    assert not any(isinstance(m, torch.nn.BatchNorm2d) for m in merged.modules())


def test_the_exported_file_reads_back_exactly(tmp_path):
    student = export.random_student(0)
    layers = export.exported_layers(student)
    content = export.net_bytes(layers, {"weights": "random"})
    assert len(content) < 2e6
    description, again = export.read_net(content)
    assert description["size"] == net.SIZE and description["layers"][-1]["out"] == net.DIM + 1
    picture = torch.rand(2, 1, 224, 224) * 2 - 1
    tokens = net.Folded(again)(picture)
    assert torch.equal(tokens, net.Folded(layers)(picture))
    with torch.no_grad():
        trained = student(picture)
    assert tokens[:, -1].eq(export.CONSTANT).all()
    cosine = torch.nn.functional.cosine_similarity(tokens[:, :-1], trained, dim=1)
    assert cosine.min() > 0.9999, "folding and rounding change next to nothing"
    with torch.no_grad():
        again_in_training = net.student_of(again)(picture)
    assert torch.allclose(again_in_training, tokens[:, :-1], atol=1e-4), (
        "it can be trained on"
    )
    with pytest.raises(ValueError, match="damaged"):
        export.read_net(content[:-40] + bytes([content[-40] ^ 1]) + content[-39:])


def test_validation_families_are_not_trained_on():
    drawn = [dataset.recipe(index) for index in range(500)]
    assert {r.family for r in drawn if r.left_out} == set(LEFT_OUT)
    assert not {r.family for r in drawn if not r.left_out} & set(LEFT_OUT)
