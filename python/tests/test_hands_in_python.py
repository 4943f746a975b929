"""`semfm.find_contact`: where a hand touches, as `semfm-cli region --hand` says."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest
import semfm
import semfm.zoo
from observed_frames import CAMERA, WALL, K, in_metres, shell, turned, write_files

#: Where the object stands before the camera, metres.
PLACE = [0.0, 0.0, 0.6]


@pytest.fixture(scope="module")
def scene(tmp_path_factory):
    """A mug before the camera, a fist that rests on its right side, and their files."""
    folder = tmp_path_factory.mktemp("hand")
    mug = semfm.demo_object("containers", n_vertices=2000).mesh
    mug.write(folder / "mug.obj")
    low, high = mug.bounds
    scale = 0.2 / np.linalg.norm(high - low)
    pose = np.diag([scale, scale, scale, 1.0])
    pose[:3, 3] = PLACE - scale * (low + high) / 2
    (folder / "aligned.json").write_text(json.dumps({"camera_from_object": pose.tolist()}))
    before = turned(in_metres(mug, 0.2), PLACE)
    right = before.vertices[np.argmax(before.vertices[:, 0])]
    ball = semfm.zoo.icosphere(4)
    fist = semfm.Mesh(0.04 * ball.vertices + right + [0.039, 0, 0], ball.faces)
    fist.write(folder / "hand.obj")
    views = [semfm.render(mesh, [CAMERA], supersampling=1)[0] for mesh in (before, fist)]
    depths = [np.where(np.isfinite(view.depth), view.depth, WALL) for view in views]
    hand = depths[1] < depths[0]
    seen = semfm.Observation(
        K, color=views[0].rgb, depth=np.round(1e3 * np.minimum(*depths)).astype(np.uint16),
        masks={"object": hand},
    )  # fmt: skip
    return folder, pose, write_files(folder / "seen", seen)


def region_of_shell(folder, name, *words):
    made = shell("region", folder / "mug.obj", "-o", folder / name, "--json", *words)
    assert made.returncode == 0, made.stderr
    return json.loads(made.stdout.splitlines()[0])


def test_a_reconstructed_hand_touches_what_the_shell_says(scene, tmp_path):
    folder, pose, files = scene
    report = region_of_shell(
        folder, "shell.json", "--hand", folder / "hand.obj", "--aligned", folder / "aligned.json",
        "--hand-depth", files["depth"], "--hand-mask", files["mask"], "--hand-intrinsics", files["intrinsics"],
    )  # fmt: skip
    seen = semfm.Observation.read(files["intrinsics"], depth=files["depth"], mask=files["mask"])
    hand = semfm.read_hand(folder / "hand.obj", observation=seen)
    touched = semfm.find_contact(
        folder / "mug.obj", hand, camera_from_object=folder / "aligned.json"
    )
    mug = semfm.Mesh.read(folder / "mug.obj")
    touched.region.write(folder / "python.json", mug)
    assert (folder / "python.json").read_bytes() == (folder / "shell.json").read_bytes()
    assert touched.report == report and touched.report["format"] == "semfm.contact/1"
    assert touched.lines and touched.lines[0].startswith("hand: touches")
    assert set(hand.shift) == {"along_axis", "residual", "scale", "n_measured"}
    # The side of the mug that the fist rests on.
    inside = mug.vertices[touched.region.vertices] @ pose[:3, :3].T + pose[:3, 3]
    assert (inside[:, 0] > 0.03).all()
    again = pickle.loads(pickle.dumps(touched))
    assert again.region == touched.region and again.report == touched.report
    assert touched.picture().startswith(b"\x89PNG") and "TouchedRegion(" in repr(touched)
    # A list of frames; one pose for all, or one for each.
    twice = semfm.find_contact(mug, [hand, hand], camera_from_object=pose)
    assert len(twice.report["frames"]) == 2
    each = semfm.find_contact(mug, [hand, hand], camera_from_object=[pose, pose])
    assert each.region == twice.region
    np.testing.assert_allclose(each.region.weights, touched.region.weights, atol=1e-12)
    aligned = folder / "aligned.json"
    for poses in ((aligned, pose), iter([aligned] * 2), np.stack([pose, pose]), pose.tolist()):
        again = semfm.find_contact(mug, [hand, hand], camera_from_object=poses)
        assert again.region == twice.region


def test_a_mask_with_depth_is_a_hand_as_for_the_shell(scene):
    folder, pose, files = scene
    report = region_of_shell(
        folder, "shell2.json", "--aligned", folder / "aligned.json", "--hand-depth", files["depth"],
        "--hand-mask", files["mask"], "--hand-intrinsics", files["intrinsics"],
    )  # fmt: skip
    seen = semfm.Observation.read(**files)
    touched = semfm.find_contact(
        folder / "mug.obj", semfm.Hand.from_mask(seen), camera_from_object=pose
    )
    assert touched.report == report
    touched.region.write(folder / "python2.json", semfm.Mesh.read(folder / "mug.obj"))
    assert (folder / "python2.json").read_bytes() == (folder / "shell2.json").read_bytes()


def test_a_pickled_hand_touches_the_same(scene):
    folder, pose, files = scene
    seen = semfm.Observation.read(**files)
    joints = np.linspace([-0.1, 0, 0.5], [0.1, 0.1, 0.6], 21)
    file = semfm.read_hand(folder / "hand.obj", observation=seen)
    hands = [file, semfm.Hand.from_mask(seen), semfm.Hand(file.points, file.faces, joints=joints)]
    for hand in hands:
        again = pickle.loads(pickle.dumps(hand))
        assert np.array_equal(again.points, hand.points) and again.shift == hand.shift
        assert np.array_equal(again.faces, hand.faces) and again.parts == hand.parts
        touched = [
            semfm.find_contact(folder / "mug.obj", one, camera_from_object=pose)
            for one in (hand, again)
        ]
        assert touched[0].region == touched[1].region and touched[0].report == touched[1].report


def test_hands_are_arrays(scene):
    folder, _, files = scene
    hand = semfm.read_hand(folder / "hand.obj")
    assert hand.points.shape == (2562, 3) and hand.faces.dtype == np.uint32 and hand.shift is None
    assert repr(hand) == "Hand(2562 points, 5120 triangles)" and len(hand) == 2562
    same = semfm.Hand(hand.points, hand.faces)
    assert np.array_equal(same.points, hand.points) and same.parts is None
    joints = np.linspace(hand.points.min(axis=0), hand.points.max(axis=0), 21)
    assert set(semfm.Hand(hand.points, joints=joints).parts) <= {
        "thumb", "index", "middle", "ring", "little", "palm",
    }  # fmt: skip
    mirrored = semfm.read_hand(folder / "hand.obj", mirrored=True)
    np.testing.assert_allclose(mirrored.points, hand.points * [-1, 1, 1])
    assert len(semfm.read_hand(folder / "hand.obj", vertices=np.arange(100))) == 100
    mug = semfm.Mesh.read(folder / "mug.obj")
    colours = semfm.Observation.read(files["intrinsics"], color=files["color"], mask=files["mask"])
    wrong = [
        (lambda: semfm.find_contact(mug, semfm.Hand(hand.points + [5, 0, 0])), "hand"),
        (lambda: semfm.find_contact(mug, semfm.Hand(1000 * hand.points)), "millimetres"),
        (lambda: semfm.find_contact(mug, []), "at least one|none"),
        (lambda: semfm.find_contact(mug, [hand] * 3, camera_from_object=[np.eye(4)] * 2), "one for each hand"),
        (lambda: semfm.Hand([[0, 0, 0]]), "at least 3 points"),
        (lambda: semfm.read_hand(folder / "hand.obj", vertices=[10**6]), "ids below"),
        (lambda: semfm.read_hand(folder / "hand.obj", mask="object"), "an observation beside"),
        (lambda: semfm.read_hand(folder / "hand.obj", focal=500.0), "a depth image beside"),
        (lambda: semfm.read_hand(folder / "hand.obj", focal=500.0, observation=colours), "a depth image beside"),
        (lambda: semfm.Hand.from_mask(semfm.Observation.read(files["intrinsics"], depth=files["depth"])), "hand"),
    ]  # fmt: skip
    for call, words in wrong:
        with pytest.raises(semfm.InvalidInput, match=words):
            call()
    with pytest.raises(semfm.InvalidType, match="a Hand"):
        semfm.find_contact(mug, mug)
