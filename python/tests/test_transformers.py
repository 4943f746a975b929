"""SigLIP, SigLIP 2 NaFlex, DINOv2 and DINOv2 with registers, through the real loading path.

The checkpoints are tiny and random but saved in the real format; the truth is transformers' own
processor and model.
"""

from __future__ import annotations

import json
import shutil

import numpy as np
import pytest
from emb_reader import read_embeddings, tokens
from PIL import Image
from semfm.sidecar import SidecarError, open_encoder
from semfm.sidecar.cli import main
from semfm.sidecar.patches import ROLLS, embed_pictures, unit_tokens
from views_builder import asymmetric_picture, disc, write_views

pytestmark = pytest.mark.full

TINY = dict(hidden_size=32, intermediate_size=64, num_hidden_layers=2, num_attention_heads=4)
TEXT = dict(TINY, vocab_size=64, bos_token_id=1, eos_token_id=2, pad_token_id=0)


def save_siglip(folder, image_size=32, patch=8):
    from transformers import SiglipConfig, SiglipImageProcessor, SiglipModel

    vision = dict(TINY, image_size=image_size, patch_size=patch)
    SiglipModel(SiglipConfig(text_config=TEXT, vision_config=vision)).save_pretrained(folder)
    size = {"height": image_size, "width": image_size}
    SiglipImageProcessor(size=size).save_pretrained(folder)


def save_siglip2(folder):
    from transformers import Siglip2Config, Siglip2ImageProcessor, Siglip2Model

    vision = dict(TINY, num_patches=16, patch_size=8)
    Siglip2Model(Siglip2Config(text_config=TEXT, vision_config=vision)).save_pretrained(folder)
    Siglip2ImageProcessor(patch_size=8, max_num_patches=39).save_pretrained(folder)


def save_dinov2(folder, registers=False):
    import transformers

    suffix = "WithRegisters" if registers else ""
    config = getattr(transformers, f"Dinov2{suffix}Config")
    model = getattr(transformers, f"Dinov2{suffix}Model")
    extra = {"num_register_tokens": 4} if registers else {}
    tiny = {k: v for k, v in TINY.items() if k != "intermediate_size"}
    model(config(**tiny, image_size=56, patch_size=14, **extra)).save_pretrained(folder)
    transformers.BitImageProcessor(
        size={"shortest_edge": 64}, crop_size={"height": 56, "width": 56}
    ).save_pretrained(folder)


FAMILIES = {
    "siglip": (save_siglip, "SiglipVisionModel"),
    "siglip2": (save_siglip2, "Siglip2VisionModel"),
    "dinov2": (save_dinov2, "AutoModel"),
    "dinov2_with_registers": (lambda folder: save_dinov2(folder, True), "AutoModel"),
}


@pytest.fixture(scope="module")
def checkpoints(tmp_path_factory):
    torch = pytest.importorskip("torch")
    pytest.importorskip("transformers")
    root = tmp_path_factory.mktemp("checkpoints")
    for name, (save, _) in FAMILIES.items():
        torch.manual_seed(5)
        save(root / name)
    return root


def reference(folder, class_name, picture):
    """(rows × cols, tokens × d) of one picture by transformers alone."""
    import torch
    import transformers

    processor = transformers.AutoImageProcessor.from_pretrained(folder)
    model = getattr(transformers, class_name).from_pretrained(folder).eval()
    inputs = processor(images=Image.fromarray(picture), return_tensors="pt")
    with torch.no_grad():
        hidden = model(**inputs).last_hidden_state[0].numpy()
    if "spatial_shapes" in inputs:
        grid = tuple(inputs["spatial_shapes"][0].tolist())
        assert inputs["pixel_attention_mask"].sum() == grid[0] * grid[1] < len(hidden)
        return grid, hidden[: grid[0] * grid[1]]
    height, width = inputs["pixel_values"].shape[-2:]
    grid = (height // model.config.patch_size, width // model.config.patch_size)
    return grid, hidden[len(hidden) - grid[0] * grid[1] :]


def cosines(a, b):
    a, b = a.reshape(-1, a.shape[-1]), b.reshape(-1, b.shape[-1])
    return (a * b).sum(1) / np.linalg.norm(a, axis=1) / np.linalg.norm(b, axis=1)


@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("size", [(64, 64), (48, 80)])
def test_tokens_are_those_of_transformers(checkpoints, family, size):
    encoder = open_encoder(str(checkpoints / family), device="cpu", threads=1)
    pictures = np.stack([asymmetric_picture(*size, 16, seed) for seed in (0, 1)])
    (found,) = encoder.encode(pictures)
    grid = encoder.grid(*size)
    for picture, ours in zip(pictures, found):
        shape, theirs = reference(checkpoints / family, FAMILIES[family][1], picture)
        assert ours.shape[:2] == shape == (grid.rows, grid.cols)
        assert cosines(ours, theirs).min() >= 0.999


@pytest.mark.parametrize("family", FAMILIES)
def test_four_rolls_are_the_mean_of_transformers_tokens_rolled_back(checkpoints, family):
    encoder = open_encoder(str(checkpoints / family), device="cpu", threads=1)
    picture = asymmetric_picture(64, 64, 16)
    ours = embed_pictures(encoder, picture[None], ROLLS[4])
    assert ours.valid.all()
    total = 0
    for turn in range(4):
        rolled = np.ascontiguousarray(np.rot90(picture, turn))
        (rows, cols), theirs = reference(checkpoints / family, FAMILIES[family][1], rolled)
        unit, _ = unit_tokens([theirs.reshape(1, rows, cols, -1)])
        total = total + np.rot90(unit[0], -turn)
    assert cosines(ours.data[0], total).min() >= 0.999
    upright = embed_pictures(encoder, picture[None], ROLLS[1]).data[0]
    assert cosines(ours.data[0], upright).min() < 0.999, "rolls must matter, or nothing was tested"


@pytest.mark.parametrize("family", FAMILIES)
def test_grid_order_and_rectangle_point_at_the_patch_that_changed(checkpoints, family):
    """Paint one spot; the token that moves most must be the one whose rectangle holds it."""
    encoder = open_encoder(str(checkpoints / family), device="cpu", threads=1)
    height, width = 64, 96
    grid = encoder.grid(height, width)
    x0, y0, x1, y1 = grid.rect
    plain = np.full((height, width, 3), 128, np.uint8)
    (before,) = encoder.encode(plain[None])
    for row, col in ((0, 0), (0, grid.cols - 1), (grid.rows - 1, 0), (1, 2)):
        x = x0 + (col + 0.5) * (x1 - x0) / grid.cols
        y = y0 + (row + 0.5) * (y1 - y0) / grid.rows
        spot = plain.copy()
        spot[int(y) - 2 : int(y) + 3, int(x) - 2 : int(x) + 3] = (255, 0, 60)
        (after,) = encoder.encode(spot[None])
        change = np.linalg.norm(after - before, axis=-1)[0]
        assert np.unravel_index(change.argmax(), change.shape) == (row, col)


def test_the_command_writes_the_same_embeddings_twice(checkpoints, tmp_path, capsys):
    pictures = [asymmetric_picture(64, 64, 16, seed) for seed in range(3)]
    views = write_views(tmp_path / "v.mcap", pictures, [disc(64, 64)] * 3)
    written = []
    for name in ("a.mcap", "b.mcap"):
        arguments = [str(views), "-o", str(tmp_path / name), "--model", str(checkpoints / "dinov2")]
        assert main([*arguments, "--device", "cpu", "--threads", "1"]) == 0
        written.append((tmp_path / name).read_bytes())
    assert written[0] == written[1]
    assert capsys.readouterr().out == f"{tmp_path / 'a.mcap'}\n{tmp_path / 'b.mcap'}\n"
    topics, metadata = read_embeddings(tmp_path / "a.mcap")
    (message,) = topics["/views/002/embeddings"]
    assert tokens(message).shape == (4, 4, 32)
    assert (message.x0, message.y0, message.x1, message.y1) == (4, 4, 60, 60)
    assert metadata["encoder"] == "dinov2" and metadata["revision"].startswith("sha256:")
    assert json.loads(metadata["preprocessing"])["crop_size"]["height"] == 56


def test_what_cannot_be_opened_says_why(checkpoints, tmp_path, monkeypatch):
    broken = tmp_path / "broken"
    shutil.copytree(checkpoints / "siglip", broken)
    weights = broken / "model.safetensors"
    weights.write_bytes(weights.read_bytes()[:-100])
    with pytest.raises(SidecarError, match="weights"):
        open_encoder(str(broken), device="cpu")
    weights.unlink()
    with pytest.raises(SidecarError, match="weights"):
        open_encoder(str(broken), device="cpu")
    # Weights of another network: transformers would start it with random numbers.
    shutil.copy(checkpoints / "dinov2" / "model.safetensors", weights)
    with pytest.raises(SidecarError, match="missing"):
        open_encoder(str(broken), device="cpu")
    (broken / "config.json").write_text('{"model_type": "bert"}')
    with pytest.raises(SidecarError, match="model_type.*'bert'"):
        open_encoder(str(broken), device="cpu")
    with pytest.raises(SidecarError, match="config.json"):
        open_encoder(str(tmp_path), device="cpu")
    with pytest.raises(SidecarError, match="neither"):
        open_encoder(str(tmp_path / "nowhere"), device="cpu")


def test_an_unreachable_hub_is_one_clear_line(monkeypatch):
    huggingface_hub = pytest.importorskip("huggingface_hub")

    def refuse(*args, **kwargs):
        raise ConnectionError("Name or service not known\nlong trace")

    monkeypatch.setattr(huggingface_hub, "snapshot_download", refuse)
    with pytest.raises(SidecarError, match="no folder of that name.*hub.*not known") as error:
        open_encoder("somebody/some-model", device="cpu")
    assert "\n" not in str(error.value)


def test_a_cached_hub_model_carries_its_commit(checkpoints, tmp_path, monkeypatch):
    huggingface_hub = pytest.importorskip("huggingface_hub")
    commit = "0123456789abcdef0123456789abcdef01234567"
    shutil.copytree(checkpoints / "siglip", tmp_path / "snapshots" / commit)
    snapshot = str(tmp_path / "snapshots" / commit)
    monkeypatch.setattr(huggingface_hub, "snapshot_download", lambda *a, **k: snapshot)
    encoder = open_encoder("somebody/some-model", device="cpu")
    assert (encoder.name, encoder.revision) == ("somebody/some-model", commit)
