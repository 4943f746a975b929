"""From a plan to labelled meshes: pictures from an endpoint, masks, resuming, refusals."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from io import BytesIO
from pathlib import Path

import numpy as np
import pytest
import semfm
from fake_endpoint import edited, fake_endpoint, hang, raw, status
from PIL import Image
from sam3d_stand_in import Scene, make_scene
from semfm.dataset.cli import main
from semfm.dataset.commands import run_command
from semfm.dataset.image_endpoint import CachedImages, EditEndpoint, image_settings
from semfm.dataset.masks import MaskError, masks_of_change
from semfm.dataset.plan import read_plan
from semfm.dataset.stages import opened
from semfm.errors import SemfmError
from semfm.vlm.client import EndpointError
from vlm_fixtures import KEY

for package in ("openai", "scipy", "trimesh"):
    pytest.importorskip(package)


@pytest.fixture(scope="module")
def scenes(tmp_path_factory) -> list[Scene]:
    """Two containers, each with a hand."""
    folder = tmp_path_factory.mktemp("scenes")
    return [make_scene(folder / f"scene{i}", instance=i) for i in (0, 1)]


TRUTH = Path("checkpoints/hf/truth.json")


@pytest.fixture(scope="module")
def server():
    """An endpoint that puts the scene's hand on its mug, for the whole module."""
    with fake_endpoint() as fake:
        yield fake


@pytest.fixture
def endpoint(server, monkeypatch):
    """The server as a user's environment names it, with the key :data:`KEY`."""
    for name in ("OPENAI_API_KEY", "OPENAI_BASE_URL", "OPENAI_MODEL"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setenv("SEMFM_IMAGE_BASE_URL", server.url)
    monkeypatch.setenv("SEMFM_IMAGE_MODEL", "painter-1")
    monkeypatch.setenv("SEMFM_IMAGE_API_KEY", KEY)
    monkeypatch.setenv("NO_PROXY", "127.0.0.1")
    server.requests.clear()
    server.keys.clear()
    return server


def painter(scenes: list[Scene]):
    """Answers a reference with the same picture and a hand in it."""

    def act(handler) -> None:
        sent = Image.open(BytesIO(handler.fake.requests[-1]["image"])).convert("RGB")
        for scene in scenes:
            if sent == Image.open(scene.reference).convert("RGB"):
                picture = Path(scene.picture).read_bytes()
                return edited(picture, revised_prompt="a hand, please")(handler)
        return status(400, "a picture that nobody knows")(handler)

    return act


def entry(scene: Scene, name: str, **more: object) -> dict:
    return {
        "category": "containers",
        "name": name,
        "object": "a blue mug",
        "region": "the handle",
        "longest_m": 0.11,
        "reference": scene.reference,
        **more,
    }


def write_plan(folder: Path, *objects: dict) -> str:
    folder.mkdir(parents=True, exist_ok=True)
    path = folder / "plan.json"
    path.write_text(json.dumps({"format": "semfm.dataset-plan/1", "objects": objects}))
    return str(path)


def one_checkout(scenes: list[Scene], folder: Path) -> str:
    """A stand-in that knows all scenes: by the picture it is given."""
    shutil.copytree(scenes[0].checkout, folder)
    path = folder / "notebook/inference.py"
    known = {
        str(scene.folder): json.loads((scene.checkout / TRUTH).read_text())["things"]
        for scene in scenes
    }
    (folder / "known.json").write_text(json.dumps(known))
    text = path.read_text().replace(
        "        [thing] = ",
        f"""        from PIL import Image
        for name, things in json.load(open({str(folder / "known.json")!r})).items():
            if (np.asarray(Image.open(name + "/picture.png").convert("RGB")) == image).all():
                self.truth["things"] = things
        [thing] = """,
    )
    path.write_text(text)
    return str(folder)


@pytest.fixture(scope="module")
def made(scenes, server, tmp_path_factory):
    """A dataset of both, and what was asked for."""
    folder = tmp_path_factory.mktemp("made")
    checkout = one_checkout(scenes, folder / "checkout")
    plan = write_plan(folder, *(entry(scene, f"mug{i}") for i, scene in enumerate(scenes)))
    with pytest.MonkeyPatch.context() as patch:
        for name in ("OPENAI_API_KEY", "OPENAI_BASE_URL", "OPENAI_MODEL"):
            patch.delenv(name, raising=False)
        patch.setenv("SEMFM_IMAGE_BASE_URL", server.url)
        patch.setenv("SEMFM_IMAGE_MODEL", "painter-1")
        patch.setenv("SEMFM_IMAGE_API_KEY", KEY)
        server.acts = [painter(scenes)]
        server.requests.clear()
        words = [plan, "-o", str(folder / "data"), "--sam3d", checkout, "--seed", "7"]
        words += ["--set", "size=240x180", "--cache", str(folder / "cache")]
        code = main(words)
    return code, folder, words, list(server.requests)


def read(path: Path) -> dict:
    return json.loads(path.read_text())


def test_every_object_gets_a_label_where_its_hand_is(made, scenes):
    code, folder, _, requests = made
    assert code == 0 and len(requests) == 2
    told = read(folder / "data/dataset.json")
    assert (told["format"], told["done"], told["failed"]) == ("semfm.dataset/1", 2, 0)
    stages = ["picture", "masks", "reconstruction", "region", "label"]
    assert [row["made"] for row in told["objects"]] == [stages, stages]
    for i, scene in enumerate(scenes):
        path = folder / f"data/objects/containers/mug{i}.ply"
        mesh = semfm.Mesh.read(path)
        region = semfm.Region.read(path.with_suffix(".json"), mesh)
        # The stand-in keeps the order of vertices.
        hand = scene.hand.vertices[::4]
        away = np.linalg.norm(scene.mug.vertices[:, None] - hand, axis=2).min(axis=1)
        assert region.mask.any() and not region.mask.all()
        assert away[region.mask].mean() < 0.012 < away[~region.mask].mean()


def test_what_was_asked_is_the_picture_and_the_region_in_words(made, scenes):
    _, _, _, requests = made
    for scene, request in zip(scenes, requests):
        assert Image.open(BytesIO(request["image"])) == Image.open(scene.reference)
        assert (request["model"], request["seed"], request["size"]) == ("painter-1", "7", "240x180")
        assert "grips a blue mug at this region: the handle." in request["prompt"]
        assert "$" not in request["prompt"]


def test_a_label_says_where_it_comes_from(made, scenes):
    _, folder, _, requests = made
    label = read(folder / "data/objects/containers/mug0.json")
    about = label["provenance"]
    picture = about["picture"]
    assert (picture["model"], picture["seed"]) == ("painter-1", 7)
    assert picture["prompt"] == requests[0]["prompt"]
    assert picture["revised_prompt"] == "a hand, please"
    assert picture["reference"]["file"] == scenes[0].reference
    assert about["masks"]["method"] == "change" and about["masks"]["changed_share"] < 0.01
    assert about["reconstruction"]["tool"]["name"] == "SAM 3D Objects"
    assert 0 < about["region"]["confidence"] <= 1
    assert about["longest_m"] == 0.11 and about["program"] == f"semfm {semfm.__version__}"
    assert set(about["files"]) == {"picture.png", "mask.png", "hand_mask.png", "region.json"}
    assert all(value.startswith("sha256:") for value in about["files"].values())


def test_eval_reads_the_folder(made, tmp_path):
    _, folder, _, _ = made
    words = ["eval", folder / "data/objects", "-o", tmp_path / "report", "--methods", "wks"]
    command = [sys.executable, "-m", "semfm", *map(str, words), "--quiet"]
    done = subprocess.run(command, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    rows = read(tmp_path / "report/results.json")["rows"]
    assert sorted((row["source"], row["target"]) for row in rows) == [
        ("mug0", "mug1"),
        ("mug1", "mug0"),
    ]


@pytest.fixture
def again(made, tmp_path):
    """A copy of the dataset to be changed, and the words that made it."""
    _, folder, words, _ = made
    shutil.copytree(folder / "data", tmp_path / "data")
    words = list(words)
    words[words.index("-o") + 1] = str(tmp_path / "data")
    return tmp_path / "data", words


def rows_of(data: Path) -> list[list[str]]:
    return [row["made"] for row in read(data / "dataset.json")["objects"]]


def test_what_is_there_is_not_made_again(again, endpoint, capsys):
    data, words = again
    assert main(words) == 0 and endpoint.requests == []
    assert rows_of(data) == [[], []]
    assert "2 labelled (2 as before), 0 failed" in capsys.readouterr().err
    # A stage whose file is gone or changed is made again, and what follows from it.
    (data / "work/containers/mug1/region.json").write_text("{}")
    (data / "objects/containers/mug0.json").unlink()
    assert main(words) == 0 and endpoint.requests == []
    assert rows_of(data) == [["label"], ["region", "label"]]


def test_a_label_that_the_plan_no_longer_names_is_told(again, endpoint, capsys, scenes):
    data, words = again
    words[0] = write_plan(data.parent, entry(scenes[0], "mug0"))
    assert main(words) == 0
    assert "containers/mug1 is there and not in the plan" in capsys.readouterr().err
    assert (data / "objects/containers/mug1.json").exists()


def test_one_that_fails_stops_no_other_and_is_made_the_next_time(again, endpoint, capsys, scenes):
    data, words = again
    words[words.index("--seed") + 1] = "8"
    paint = painter(scenes)
    endpoint.acts = [status(400, "not this one"), paint]
    assert main(words) == 1
    assert len(endpoint.requests) == 2
    first, second = read(data / "dataset.json")["objects"]
    assert (first["status"], first["stage"], second["status"]) == ("failed", "picture", "done")
    assert "not this one" in first["error"] and endpoint.url in first["error"]
    said = capsys.readouterr()
    assert said.out == f"{data / 'objects'}\n" and "containers/mug0: picture: request" in said.err
    assert not list((data / "objects/containers").glob("mug0*")), "no label of another picture"
    endpoint.acts = [paint]
    assert main([*words, "--json"]) == 0
    assert json.loads(capsys.readouterr().out) == read(data / "dataset.json")
    # The same picture came back, so that nothing that follows from it had to be made but the label.
    assert rows_of(data) == [["picture", "label"], []]
    assert len(endpoint.requests) == 3


def test_without_access_nothing_more_is_asked(again, endpoint, capsys):
    data, words = again
    words[words.index("--seed") + 1] = "9"
    endpoint.acts = [status(401, f"Incorrect API key provided: {KEY}")]
    assert main(words) == 2
    assert len(endpoint.requests) == 1
    assert [row["status"] for row in read(data / "dataset.json")["objects"]] == [
        "failed",
        "waiting",
    ]
    said = capsys.readouterr()
    assert "[key]" in said.err and KEY not in said.err + said.out


def test_the_key_is_written_nowhere(made, again, endpoint, capfd, scenes):
    _, folder, _, _ = made
    data, words = again
    words += ["--timeout", "2", "--retries", "0"]
    picture = Path(scenes[0].picture).read_bytes()
    leaks = [
        edited(picture, revised_prompt=f"with {KEY}"),
        status(400, KEY),
        raw(f"<html>{KEY}</html>", "text/html"),
        raw(json.dumps({"created": 1, "data": [], "hint": KEY})),
    ]
    for seed, leak in enumerate(leaks, 10):
        words[words.index("--seed") + 1] = str(seed)
        endpoint.acts = [leak]
        assert main(words) == 1, "the first is a picture, but none of the second mug"
    said = capfd.readouterr()
    assert "[key]" in said.err and KEY not in said.err + said.out
    assert set(endpoint.keys) == {f"Bearer {KEY}"}, "it was sent"
    files = [path for root in (data, folder) for path in root.rglob("*") if path.is_file()]
    assert len(files) > 30
    assert [path for path in files if KEY.encode() in path.read_bytes()] == []
    replies = [path.read_text() for path in (folder / "cache").iterdir()]
    assert any("with [key]" in reply for reply in replies)


@pytest.mark.parametrize(
    "act, kind, text",
    [
        (raw(json.dumps({"created": 1, "data": [{"url": "https://x/y.png"}]})), "reply", "a URL"),
        (raw(json.dumps({"created": 1, "data": [{"b64_json": "aGVsbG8="}]})), "reply", "none"),
        (raw(json.dumps({"created": 1, "data": [{"b64_json": "!"}]})), "reply", "none"),
        (raw(json.dumps({"created": 1})), "reply", "b64_json"),
        (raw('{"created": '), "reply", "127.0.0.1"),
        (status(400, "no hands here"), "request", "no hands here"),
        (status(404), "access", "HTTP 404"),
        (hang, "timeout", "no reply within 0.3 s"),
    ],
)
def test_what_gives_no_picture_says_why(endpoint, act, kind, text):
    endpoint.acts = [act]
    settings = image_settings(None, None, timeout_s=0.3, max_attempts=1)
    with pytest.raises(EndpointError) as error:
        EditEndpoint(settings).edit(Image.new("RGB", (8, 8)), "a hand")
    assert error.value.kind == kind and text in error.value.text
    assert endpoint.url in error.value.text


def test_a_busy_endpoint_is_asked_again_and_a_picture_is_kept_by_content(endpoint, tmp_path):
    buffer = BytesIO()
    Image.new("RGB", (8, 8), "red").save(buffer, "PNG")
    fine = edited(buffer.getvalue())
    endpoint.acts = [status(429, retry_after_ms="1"), status(500, retry_after_ms="1"), fine]
    cached = CachedImages(EditEndpoint(image_settings(None, None)), tmp_path / "kept")
    white = Image.new("RGB", (8, 8), "white")
    first = cached.edit(white, "a hand")
    assert (first.attempts, first.cached, first.tokens) == (3, False, 1200)
    again = cached.edit(white, "a hand")
    assert again.cached and again.picture == first.picture and len(endpoint.requests) == 3
    cached.edit(Image.new("RGB", (8, 8), "grey"), "a hand")
    cached.edit(white, "two hands")
    more = image_settings(None, None, more={"seed": 2})
    seeded = CachedImages(EditEndpoint(more), tmp_path / "kept")
    assert seeded.edit(white, "a hand").seed == 2
    assert len(endpoint.requests) == 6 and len(list((tmp_path / "kept").iterdir())) == 4
    assert seeded.edit(white, "a hand", attempt=3).seed == 4
    assert endpoint.requests[-1]["seed"] == "4" and "seed" not in endpoint.requests[-3]
    assert cached.edit(white, "a hand", attempt=2).cached is False
    for path in (tmp_path / "kept").iterdir():
        path.write_text("{")
    assert cached.edit(white, "a hand").cached is False


def test_a_transparent_reply_is_put_on_white(endpoint):
    buffer = BytesIO()
    Image.new("RGBA", (8, 8), (0, 0, 0, 0)).save(buffer, "PNG")
    endpoint.acts = [edited(buffer.getvalue())]
    reply = EditEndpoint(image_settings(None, None)).edit(Image.new("RGB", (8, 8)), "a hand")
    assert reply.image().getpixel((0, 0)) == (255, 255, 255)


def truth(scene: Scene) -> list[np.ndarray]:
    return [np.asarray(Image.open(scene.folder / name)) > 0 for name in ("mask.png", "hand.png")]


def iou(a: np.ndarray, b: np.ndarray) -> float:
    return float((a & b).sum() / (a | b).sum())


def as_jpeg(picture: Image.Image) -> Image.Image:
    buffer = BytesIO()
    picture.save(buffer, "JPEG", quality=85)
    return Image.open(BytesIO(buffer.getvalue())).convert("RGB")


def with_shadow(picture: Image.Image, masks: list[np.ndarray]) -> Image.Image:
    """The hand's shadow beside it, on the background."""
    shadow = np.roll(masks[1], (6, -14), axis=(0, 1)) & ~masks[0] & ~masks[1]
    pixels = np.asarray(picture).astype(float)
    pixels[shadow] *= 0.7
    return Image.fromarray(pixels.astype(np.uint8))


@pytest.mark.parametrize("change", ["none", "jpeg", "noise", "larger", "shadow", "alpha"])
def test_masks_are_what_changed(scenes, change):
    for scene in scenes:
        masks = truth(scene)
        without, picture = Image.open(scene.reference), Image.open(scene.picture)
        if change == "jpeg":
            picture = as_jpeg(picture)
        elif change == "noise":
            noise = np.random.default_rng(0).normal(size=(*masks[0].shape, 3)) * 6
            noisy = np.clip(np.asarray(picture) + noise, 0, 255).astype(np.uint8)
            picture = Image.fromarray(noisy)
        elif change == "larger":
            picture = picture.resize((480, 360), Image.Resampling.BICUBIC)
            masks = [mask.repeat(2, axis=0).repeat(2, axis=1) for mask in masks]
        elif change == "shadow":
            picture = with_shadow(picture, masks)
        elif change == "alpha":
            opaque = (np.asarray(without).min(axis=2) < 250) * 255
            alpha = Image.fromarray(opaque.astype(np.uint8))
            without = without.copy()
            without.putalpha(alpha)
        found = masks_of_change(without, picture)
        # What is lost is a pixel along the outlines: the mug is 57 pixels long.
        assert iou(found.object, masks[0]) > 0.89 and iou(found.hand, masks[1]) > 0.87
        assert not (found.object & found.hand).any() and found.changed_share < 0.02


def test_pictures_that_do_not_belong_together_have_no_masks(scenes):
    without, picture = Image.open(scenes[0].reference), Image.open(scenes[0].picture)
    other = Image.open(scenes[1].picture)
    stripes = np.asarray(without).copy()
    stripes[::2] = np.where(stripes[::2] > 250, 90, stripes[::2])
    pixels, masks = np.asarray(picture).copy(), truth(scenes[0])
    # A band around the mug, apart from the hand, in another colour.
    dyed, band = pixels.copy(), np.zeros_like(masks[0])
    last = np.nonzero(masks[0].any(axis=0))[0][-1]
    band[:, last - 12 : last - 2] = True
    dyed[band & masks[0]] = (200, 60, 60)
    far = np.asarray(without).copy()
    far[5:40, 5:40] = (230, 180, 150)
    repainted = np.where(masks[0][..., None], 255 - pixels, pixels)
    for before, after, text in (
        (without, picture.resize((240, 240)), "shape: expected that of the reference"),
        (without, without, "hand: expected a change at the object"),
        (without, Image.fromarray(far), "hand: expected a change at the object"),
        (Image.fromarray(stripes), picture, "a plain background"),
        (Image.new("RGB", without.size, "white"), picture, "an object on the background"),
        (without, Image.fromarray(repainted), "beside what changed"),
        (without, Image.fromarray(np.roll(pixels, 9, axis=1)), "where it is in the reference"),
        (without, other, "where it is in the reference"),
        (without, Image.fromarray(dyed), "leaves free changed"),
    ):
        with pytest.raises(MaskError) as error:
            masks_of_change(before, after)
        assert text in str(error.value), str(error.value)


SEGMENT = """
import sys
from PIL import Image
picture, what, output = sys.argv[1:]
Image.open({folder!r} + ("/hand.png" if what == "hand" else "/mask.png")).save(output)
"""
MESHES = """
import json, shutil, sys
picture, mask, hand_mask, longest, output = sys.argv[1:]
for name in ("mesh.ply", "hand.ply", "camera_from_object.json"):
    shutil.copy({folder!r} + "/" + name, output)
"""


@pytest.fixture
def no_endpoint(monkeypatch):
    for name in ("SEMFM_IMAGE", "OPENAI"):
        for what in ("MODEL", "BASE_URL", "API_KEY"):
            monkeypatch.delenv(f"{name}_{what}", raising=False)


def test_pictures_and_programs_of_ones_own_need_no_endpoint(scenes, tmp_path, no_endpoint):
    scene = scenes[0]
    scene.mug.write(tmp_path / "mesh.ply")
    scene.hand.write(tmp_path / "hand.ply")
    (tmp_path / "camera_from_object.json").write_text(json.dumps(np.eye(4).tolist()))
    for name, text, folder in (
        ("segment.py", SEGMENT, scene.folder),
        ("meshes.py", MESHES, tmp_path),
    ):
        (tmp_path / name).write_text(text.format(folder=str(folder)))
    photo = {"reference": None, "picture": scene.picture}
    given = {"mask": str(scene.folder / "mask.png"), "hand_mask": str(scene.folder / "hand.png")}
    objects = [entry(scene, "given", **photo, **given), entry(scene, "segmented", **photo)]
    plan = write_plan(tmp_path, *({k: v for k, v in o.items() if v} for o in objects))
    python = sys.executable
    segment = f"{python} {tmp_path / 'segment.py'} {{picture}} {{what}} {{output}}"
    places = "{picture} {mask} {hand_mask} {longest} {output}"
    meshes = f"{python} {tmp_path / 'meshes.py'} {places}"
    words = [plan, "-o", str(tmp_path / "data"), "--reconstruct-command", meshes, "--quiet"]
    # Without a way to masks the object that has none fails, and the other does not.
    assert main(words) == 1
    told = read(tmp_path / "data/dataset.json")["objects"]
    assert [row["status"] for row in told] == ["done", "failed"]
    assert "--mask-command" in told[1]["error"]
    assert main([*words, "--mask-command", segment]) == 0
    found = [
        read(tmp_path / f"data/objects/containers/{name}.json") for name in ("given", "segmented")
    ]
    assert found[0]["region"] == found[1]["region"]
    methods = [label["provenance"]["masks"]["method"] for label in found]
    assert methods == ["given", "command"]
    assert found[0]["provenance"]["picture"]["source"] == "given"
    failing = f"{python} -c \"import sys; sys.exit('no GPU')\" {places}"
    words[words.index("--reconstruct-command") + 1] = failing
    assert main([*words, "--mask-command", segment]) == 1
    told = read(tmp_path / "data/dataset.json")["objects"]
    assert {row["stage"] for row in told} == {"reconstruction"}
    assert all("no GPU" in row["error"] for row in told)
    assert not list((tmp_path / "data/objects/containers").iterdir())


def test_settings_that_cannot_be_right_are_told_before_anything_is_done(
    scenes, tmp_path, no_endpoint, capsys
):
    plan = write_plan(tmp_path, entry(scenes[0], "mug"))
    (tmp_path / "words.txt").write_text("A hand.")
    for words, text in (
        ([], "SEMFM_IMAGE_MODEL"),
        (["--model", "painter-1"], "SEMFM_IMAGE_API_KEY"),
        (["--mask-command", "segment {picture}"], "{picture}, {what}, {output}"),
        (["--mask-command", "segment '{picture}"], "a command line"),
        (["--reconstruct-command", "make {picture} {everything}"], "{longest}"),
        (["--set", "size"], "NAME=VALUE"),
        (["--set", "model=other"], "NAME=VALUE"),
        (["--set", "seed=7"], "--seed N"),
        (["--prompt", str(tmp_path / "words.txt")], "$region in it"),
        (["--prompt", str(tmp_path / "none.txt")], "none.txt"),
    ):
        assert main([plan, "-o", str(tmp_path / "data"), *words]) == 2, words
        said = capsys.readouterr()
        assert text in said.err and said.out == "" and "a bug in semfm" not in said.err, said.err
        assert not (tmp_path / "data/dataset.json").exists()


@pytest.mark.parametrize("kind", ["json", "ply"])
def test_a_label_that_no_run_made_is_kept(scenes, tmp_path, no_endpoint, capsys, kind):
    photo = {"picture": scenes[0].picture}
    value = {k: v for k, v in entry(scenes[0], "mug", **photo).items() if k != "reference"}
    label = tmp_path / f"data/objects/containers/mug.{kind}"
    label.parent.mkdir(parents=True)
    label.write_text("by hand")
    assert main([write_plan(tmp_path, value), "-o", str(tmp_path / "data")]) == 2
    assert label.read_text() == "by hand" and str(label) in capsys.readouterr().err
    assert not (tmp_path / "data/work").exists()


def test_inputs_in_the_folders_that_are_written_are_refused(scenes, tmp_path, no_endpoint, capsys):
    inside = tmp_path / "data/work/containers/mug/picture.png"
    inside.parent.mkdir(parents=True)
    shutil.copy(scenes[0].picture, inside)
    before = inside.read_bytes()
    photo = {"picture": str(inside)}
    value = {k: v for k, v in entry(scenes[0], "mug", **photo).items() if k != "reference"}
    assert main([write_plan(tmp_path, value), "-o", str(tmp_path / "data")]) == 2
    assert "a file outside of" in capsys.readouterr().err and inside.read_bytes() == before
    assert not (tmp_path / "data/dataset.json").exists()


@pytest.mark.parametrize(
    "change, text",
    [
        ({"reference": None}, "found neither"),
        ({"picture": "plan.json"}, "found both"),
        ({"mask": "plan.json"}, "`mask` and `hand_mask`, or neither"),
        ({"mask": "plan.json", "hand_mask": "plan.json"}, "`picture`, which it is a mask of"),
        ({"reference": "nothing.png"}, "objects[0].reference: expected a file"),
        ({"longest_m": None}, "objects[0].longest_m"),
        ({"longest_m": 110}, "the longest side in metres"),
        ({"longest_m": True}, "the longest side in metres"),
        ({"region": " "}, "objects[0].region: expected text"),
        ({"name": "a/b"}, "a name that a file can have"),
        ({"category": ".."}, "a name that a file can have"),
        ({"regoin": "the handle"}, "objects[0].regoin"),
        ({"attempt": 0}, "objects[0].attempt: expected a number from 1"),
    ],
)
def test_a_plan_that_is_none_is_refused_with_the_place(scenes, tmp_path, change, text):
    value = {**entry(scenes[0], "mug"), **change}
    plan = write_plan(tmp_path, {k: v for k, v in value.items() if v is not None})
    with pytest.raises(SemfmError) as error:
        read_plan(plan)
    assert text in str(error.value) and "plan.json" in str(error.value)


def test_plans_of_another_form(scenes, tmp_path):
    twice = [entry(scenes[0], "mug"), entry(scenes[0], "mug")]
    for text, found in (
        ("[]", "semfm.dataset-plan/1"),
        ('{"format": "semfm.eval/1"}', "semfm.eval/1"),
        ('{"format": "semfm.dataset-plan/1", "objects": []}', "at least one object"),
        ("{", "JSON"),
        (json.dumps({"format": "semfm.dataset-plan/1", "objects": twice}), "another name"),
    ):
        (tmp_path / "plan.json").write_text(text)
        with pytest.raises(SemfmError, match=r"plan\.json") as error:
            read_plan(tmp_path / "plan.json")
        assert found in str(error.value)


def test_what_a_command_says_is_told_without_keys(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("SEMFM_IMAGE_API_KEY", KEY)
    code = "import os, sys; sys.exit('key ' + os.environ['SEMFM_IMAGE_API_KEY'])"
    with pytest.raises(SemfmError) as failed:
        run_command([sys.executable, "-c", code], "--mask-command")
    assert KEY not in str(failed.value) and "[SEMFM_IMAGE_API_KEY]" in str(failed.value)


def test_a_picture_is_read_as_viewers_show_it(tmp_path: Path) -> None:
    upright = Image.new("RGB", (4, 2), "white")
    upright.putpixel((0, 0), (200, 0, 0))
    exif = Image.Exif()
    exif[0x0112] = 6  # the camera was turned: viewers turn the picture by a quarter
    upright.save(tmp_path / "turned.png", exif=exif)
    read = opened(tmp_path / "turned.png")
    assert read.size == (2, 4) and read.getpixel((1, 0)) == (200, 0, 0)
