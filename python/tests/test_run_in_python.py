"""`semfm.run`: a recipe carried out as the shell does, with the same stages kept."""

from __future__ import annotations

import json
import pickle

import numpy as np
import pytest
import semfm
from observed_frames import in_metres, seen, shell, turned, write_files

STAGES = ["region", "transfer", "target-pose", "grasp"]
RECIPE = """
[demonstration]
mesh = 'mug.obj'
near = {near}
radius = {radius}

[target]
mesh = 'other.obj'

[target.frame]
color = 'target/c.png'
depth = 'target/d.png'
intrinsics = 'target/K.json'
mask = 'target/object.png'

[transfer]
cache = false

[grasp]
gripper = 'franka'
samples = {samples}
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A mug with a contact on its handle, and a camera's picture of the same mug, smaller."""
    folder = tmp_path_factory.mktemp("run")
    mug = semfm.demo_object("containers", n_vertices=1500)
    mug.mesh.write(folder / "mug.obj")
    mug.mesh.write(folder / "other.obj")
    write_files(folder / "target", seen(turned(in_metres(mug.mesh, 0.2), [0.0, 0.0, 0.6], 40.0)))
    write_recipe(folder, mug)
    return folder


def write_recipe(folder, mug, name="demo.toml", samples=100):
    grip = mug.mesh.vertices[mug.region.vertices]
    near = [float(x) for x in grip[np.argmin(np.linalg.norm(grip - grip.mean(axis=0), axis=1))]]
    (folder / name).write_text(RECIPE.format(near=near, radius=0.15, samples=samples))


@pytest.fixture(scope="module")
def result(folder):
    steps = []
    result = semfm.run(
        folder / "demo.toml",
        folder / "python",
        cache=False,
        progress=lambda *step: steps.append(step),
    )
    return result, steps


@pytest.fixture(scope="module")
def of_shell(folder):
    """The same recipe carried out at the shell."""
    done = shell("run", folder / "demo.toml", "-o", folder / "shell", "--no-cache", "--quiet")
    assert done.returncode == 0, done.stderr
    return folder / "shell"


def test_stages_and_answers_are_those_of_the_shell(folder, result, of_shell):
    found, steps = result
    assert list(found.states) == STAGES and found.no_answer is None
    for stage in found.stages:
        for name in stage["files"]:
            shells, ours = (
                (side / stage["stage"] / name).read_bytes()
                for side in (of_shell, folder / "python")
            )
            if name == "aligned.json":
                shells, ours = ({**json.loads(text), "stages_ms": None} for text in (shells, ours))
            if not name.endswith((".mcap", "report.json")):  # these say how long it took
                assert shells == ours, f"{stage['stage']}/{name}"
    assert set(found.states.values()) == {"done"}
    for stage in found.states:
        told = [(done, total) for name, done, total in steps if name == stage]
        assert told[0] == (0, 1) and (1, 1) in told, stage
    assert (folder / "python/index.html").samefile(found.page)


def test_what_came_out_is_at_hand(folder, result):
    found, _ = result
    assert found.folder == str(folder / "python")
    other = semfm.Mesh.read(folder / "other.obj")
    written = semfm.Region.read(folder / "python/transfer/region.json", other)
    assert found.region == written and 0 < len(written.vertices) < other.n_vertices
    assert found.to_dict()["format"] == "semfm.run/1"
    assert "transfer done" in repr(found) and "<td>transfer</td>" in found._repr_html_()
    again = pickle.loads(pickle.dumps(found))
    assert again.stages == found.stages and again.page == found.page
    with pytest.raises(semfm.InvalidInput, match="a file of a stage of this run"):
        found.file("plan", "plan.json")
    assert found.grasps["format"] == "semfm.grasps/1" and found.grasps["grasps"]
    assert found.file("grasp", "grasps.json").endswith("grasps.json")


def test_only_what_changed_is_done_again_whoever_did_it(folder, result, of_shell):
    found, _ = result
    again = semfm.run(folder / "demo.toml", folder / "python", cache=False)
    assert set(again.states.values()) == {"kept"} and again.no_answer == found.no_answer
    # The shell keeps what Python did, and Python what the shell did.
    dry = shell("run", folder / "demo.toml", "-o", folder / "python", "--dry-run")
    assert dry.stdout.count("keep") == len(found.stages), dry.stdout
    planned = semfm.planned_stages(folder / "demo.toml", of_shell)
    assert [stage["stage"] for stage in planned] == STAGES
    assert all(stage["why"] is None for stage in planned)
    mug = semfm.demo_object("containers", n_vertices=1500)
    write_recipe(folder, mug, "more.toml", samples=101)
    planned = semfm.planned_stages(folder / "more.toml", folder / "python")
    assert [stage["stage"] for stage in planned if stage["why"] is not None] == ["grasp"]


def test_what_is_wrong_is_said(folder, tmp_path):
    with pytest.raises(semfm.FileError, match="nothing.toml"):
        semfm.run(tmp_path / "nothing.toml", tmp_path / "out")
    (tmp_path / "odd.toml").write_text("[demonstration]\nmesh = 'no.obj'\nneer = [0, 0, 0]\n")
    with pytest.raises(semfm.FormatError, match="neer"):
        semfm.run(tmp_path / "odd.toml", tmp_path / "out")
    (tmp_path / "no.toml").write_text(
        "[demonstration]\nmesh = 'no.obj'\nnear = [0, 0, 0]\nradius = 1.0\n[target]\nmesh = 'no.obj'\n"
    )
    with pytest.raises(semfm.SemfmError, match="no.obj"):
        semfm.run(tmp_path / "no.toml", tmp_path / "out")
