"""What is written, and what is read: no input replaced, nothing special read, every command's end."""

from __future__ import annotations

import json
import os
import pickle
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from batch_library import library, settings

import semfm
import semfm.batch
from semfm.sidecar.onnx_encoder import read_description

LFS = b"version https://git-lfs.github.com/spec/v1\noid sha256:00\nsize 9\n"
needs_pipes = pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="a system without mkfifo")


@pytest.fixture
def mesh_file(tmp_path) -> Path:
    semfm.zoo.icosphere(2).write(tmp_path / "ball.ply")
    # Written by another program, as far as this process knows.
    (tmp_path / "theirs.ply").write_bytes((tmp_path / "ball.ply").read_bytes())
    return tmp_path / "theirs.ply"


def test_what_was_read_is_not_replaced(tmp_path, mesh_file):
    mesh = semfm.Mesh.read(mesh_file)
    before = mesh_file.read_bytes()
    region = semfm.Region.from_vertices(mesh.n_vertices, [0, 1])
    hard = tmp_path / "hard.json"
    os.link(mesh_file, hard)
    for path in (mesh_file, hard, tmp_path / ".." / tmp_path.name / mesh_file.name):
        with pytest.raises(semfm.SemfmError, match="input"):
            region.write(path, mesh)
    with pytest.raises(semfm.SemfmError, match=r"theirs\.ply"):
        mesh.write(mesh_file)
    assert mesh_file.read_bytes() == before
    # Our own files may be written again, also after they were read.
    for _ in range(2):
        region.write(tmp_path / "deep" / "r.json", mesh)
        assert semfm.Region.read(tmp_path / "deep" / "r.json", mesh) == region


def test_a_transfer_does_not_replace_its_inputs_and_comes_whole(tmp_path):
    folder = tmp_path / "here"
    folder.mkdir()
    demo = semfm.demo_object("containers", n_vertices=150)
    demo.mesh.write(tmp_path / "own.ply")
    (folder / "source.ply").write_bytes((tmp_path / "own.ply").read_bytes())
    source = semfm.prepare(folder / "source.ply", features=demo.shared_features(), k=12)
    region = demo.region
    transfer = semfm.Matching(source, source, method="nearest").transfer(region)
    before = (folder / "source.ply").read_bytes()
    with pytest.raises(semfm.SemfmError, match=r"source\.ply"):
        transfer.write(folder)
    assert [path.name for path in folder.iterdir()] == ["source.ply"]
    assert (folder / "source.ply").read_bytes() == before
    files = transfer.write(tmp_path / "out")
    assert {Path(path).parent for path in files} == {tmp_path / "out"}
    assert sorted(Path(path).name for path in files) == sorted(os.listdir(tmp_path / "out"))


@needs_pipes
def test_pipes_and_devices_are_refused_by_every_reader(tmp_path):
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    ball = semfm.zoo.icosphere(1)
    readers = [
        semfm.Mesh.read,
        semfm.read_mesh,
        lambda path: semfm.Region.read(path, ball),
        semfm.ViewsFile.read,
        semfm.Embeddings.read,
        semfm.PointMap.read,
        semfm.Gripper,
        read_description,
        semfm.batch.read_manifest,
    ]
    names = {semfm.batch.read_manifest: "rows.csv", semfm.Gripper: "hand.urdf"}
    for read in readers:
        for special in (pipe, Path("/dev/zero"), tmp_path):
            path = tmp_path / names.get(read, "link")
            path.unlink(missing_ok=True)
            path.symlink_to(special)
            start = time.monotonic()
            with pytest.raises(semfm.SemfmError):
                read(path)
            assert time.monotonic() - start < 5
            path.unlink()


def test_stand_ins_are_named_and_a_byte_order_mark_is_none(tmp_path):
    ball = semfm.zoo.icosphere(1)
    for name, read in [
        ("a.ply", semfm.Mesh.read),
        ("a.json", lambda path: semfm.Region.read(path, ball)),
        ("a.mcap", semfm.ViewsFile.read),
        ("a.npz", semfm.PointMap.read),
        ("e.json", read_description),
        ("rows.jsonl", semfm.batch.read_manifest),
    ]:
        path = tmp_path / name
        path.write_bytes(LFS)
        with pytest.raises(semfm.SemfmError, match="git lfs pull"):
            read(path)
    region = tmp_path / "a.json"
    region.write_text(json.dumps({"vertices": [3]}), "utf-8-sig")
    assert semfm.Region.read(region, ball).vertices.tolist() == [3]


def test_messages_hold_nothing_that_a_terminal_obeys(tmp_path):
    path = tmp_path / "r.json"
    path.write_text(json.dumps({"mesh": {"hash": "\x1b]0;owned\x07"}, "vertices": [1]}))
    with pytest.raises(semfm.FormatError) as caught:
        semfm.Region.read(path, semfm.zoo.icosphere(1))
    assert "\\u001b" in str(caught.value) and "\x1b" not in str(caught.value)


GOOD = {
    "format": "semfm.encoder/1",
    "onnx": "network.onnx",
    "input": "image",
    "layout": "NCHW",
    "mean": [0.5, 0.5, 0.5],
    "std": [0.5, 0.5, 0.5],
    "size_multiple": 32,
    "outputs": ["s16"],
    "output_layout": "NCHW",
    "patch": 16,
}


@pytest.mark.parametrize(
    ("field", "value"),
    [
        ("onnx", "../network.onnx"),
        ("onnx", "/etc/passwd"),
        ("onnx", "sub/../../network.onnx"),
        ("onnx", "linked.onnx"),
        ("onnx", "a\0b"),
        ("onnx", ["a"]),
        ("mean", [10**400, 0, 0]),
        ("mean", [True, 0, 0]),
        ("std", [0, 1, 1]),
        ("std", [1e-300, 1, 1]),
        ("size_multiple", 10**30),
        ("patch", -1),
        ("outputs", [[]]),
        ("input", {}),
        ("layout", []),
    ],
)
def test_an_encoder_json_that_is_wrong_is_one_clear_error(tmp_path, field, value):
    folder = tmp_path / "encoder"
    folder.mkdir()
    (tmp_path / "network.onnx").write_bytes(b"x")
    (folder / "linked.onnx").symlink_to("../network.onnx")
    path = folder / "e.json"
    path.write_text(json.dumps({**GOOD, field: value}))
    with pytest.raises(semfm.SemfmError, match=field):
        read_description(path)
    run = _command("semfm.sidecar", "v.views.mcap", "-o", tmp_path / "e.mcap", "--model", path)
    assert run.returncode == 2 and "Traceback" not in run.stderr


@pytest.mark.parametrize("text", ["[" * 100_000, "{", "\ufeff[]", "nonsense", '{"format": NaN}', ""])
def test_an_encoder_json_that_is_no_json_is_one_clear_error(tmp_path, text):
    path = tmp_path / "e.json"
    path.write_text(text)
    with pytest.raises(semfm.SemfmError, match=r"e\.json"):
        read_description(path)


def _command(module, *words, **options):
    words = [sys.executable, "-m", module, *map(str, words)]
    # argparse says nothing of an unbuffered stdout that cannot be written.
    options["env"] = {name: value for name, value in os.environ.items() if name != "PYTHONUNBUFFERED"}
    return subprocess.run(words, text=True, stderr=subprocess.PIPE, check=False, **options)


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a system without /dev/full")
@pytest.mark.parametrize("module", ["semfm.sidecar", "semfm.vlm", "semfm.reconstruct", "semfm.dataset", "semfm.batch", "semfm"])
def test_every_command_says_that_stdout_is_full(module):
    with open("/dev/full", "w") as full:
        run = _command(module, "--help", stdout=full)
    assert run.returncode == 2, run.stderr
    assert "stdout" in run.stderr and "Traceback" not in run.stderr


@pytest.mark.skipif(not hasattr(signal, "SIGKILL"), reason="a system without SIGKILL")
def test_a_killed_batch_goes_on_and_leaves_whole_shards(tmp_path):
    small = library(tmp_path, 6)
    program = (
        "import pickle, sys, semfm.batch\n"
        "source, region, settings = pickle.load(open(sys.argv[1], 'rb'))\n"
        "semfm.batch.transfer(source, region, sys.argv[2], sys.argv[3], settings=settings, k=12,\n"
        "    workers=1, shard_size=1, format='jsonl')\n"
    )
    given = tmp_path / "given.pickle"
    given.write_bytes(pickle.dumps((small.source, small.region, settings())))
    words = [sys.executable, "-c", program, given, small.manifest, tmp_path / "answers"]
    start = time.monotonic()
    subprocess.run(words, check=True, stderr=subprocess.DEVNULL)
    whole = time.monotonic() - start
    rounds = 50 if os.environ.get("SEMFM_FULL") else 3
    out = tmp_path / "killed"
    words[-1] = out
    for round in range(rounds):
        child = subprocess.Popen(words, stderr=subprocess.DEVNULL, start_new_session=True)
        time.sleep(whole * (0.3 + 0.6 * (round + 1) / rounds))
        os.killpg(child.pid, signal.SIGKILL)
        child.wait()
        if (out / "records").is_dir():
            for shard in (out / "records").glob("part-*.jsonl"):
                for line in shard.read_text("utf-8").splitlines():
                    assert json.loads(line)["name"]
    subprocess.run(words, check=True, stderr=subprocess.DEVNULL)
    names = [record["name"] for record in semfm.batch.records(out)]
    assert sorted(names) == sorted(row["name"] for row in small.rows)
    assert not list(out.rglob(".semfm-*"))
