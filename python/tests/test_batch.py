"""One demonstration onto a library: answers, failures, resuming, workers that hang or die."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from batch_library import Deadly, Hanging, library, settings

import semfm
import semfm.batch
import semfm.zoo
from semfm.batch import pool, shards
from semfm.batch.manifest import rows_of

TESTS = Path(__file__).resolve().parent


@pytest.fixture
def small(tmp_path):
    return library(tmp_path, 6)


def transferred(small, out="answers", **options):
    return semfm.batch.transfer(
        small.source,
        small.region,
        small.manifest,
        small.folder / out,
        **{"settings": settings(), "k": 12, "workers": 2, **options},
    )


def by_name(small, out="answers"):
    found = list(semfm.batch.records(small.folder / out))
    assert len({record["name"] for record in found}) == len(found)
    return {record["name"]: record for record in found}


# ---- answers


@pytest.mark.parametrize("format", ["parquet", "jsonl"])
def test_answers_are_those_of_a_single_transfer(small, format):
    if format == "parquet":
        pytest.importorskip("pyarrow")
    told = []
    summary = transferred(
        small, format=format, point_maps=True, progress=lambda *step: told.append(step)
    )
    assert (summary.n_rows, summary.n_done, summary.n_failed, summary.n_skipped) == (6, 6, 0, 0)
    assert sum(summary.verdicts.values()) == 6
    assert told == [("objects", done, 6) for done in range(7)]
    found = by_name(small)
    for row in small.rows:
        record = found[row["name"]]
        mesh = semfm.Mesh.read(small.folder / row["mesh"])
        target = semfm.prepare(
            mesh, features=np.load(small.folder / row["features"]), settings=settings(), k=12
        )
        alone = semfm.Matching(small.source, target, settings=settings()).transfer(small.region)
        assert semfm.batch.region_of(record) == alone.region
        assert record["verdict"] == alone.verdict and record["confidence"] == alone.confidence
        assert record["mesh_hash"] == mesh.hash
        assert record["point_map"] == alone.point_map.source_of.tolist()
        assert [h["probability"] for h in record["hypotheses"]] == [
            h.probability for h in alone.hypotheses
        ]
        assert json.loads(record["report"])["settings"]["method"] == "fused"
    workers = {record["worker"] for record in found.values()}
    assert f":{os.getpid()}" not in "".join(workers)


def test_parquet_is_one_table_for_others(small):
    pq = pytest.importorskip("pyarrow.parquet")
    transferred(small, shard_size=4)
    table = pq.read_table(small.folder / "answers" / "records")
    assert table.num_rows == 6 and table.schema.equals(shards.schema())
    assert len(list((small.folder / "answers" / "records").iterdir())) == 2


def test_embeddings_and_clouds_and_the_shell(tmp_path):
    mug, other = (semfm.demo_object("containers", instance=i, n_vertices=300) for i in (0, 1))
    ours = mug.write(tmp_path)
    mug.region.write(tmp_path / "grip.json", mug.mesh)
    theirs = other.write(tmp_path)
    cloud = semfm.lift(other.mesh, theirs["embeddings"], n_samples=300)
    np.savez(tmp_path / "cloud.npz", points=cloud.points, features=cloud.features)
    mesh = os.path.basename(theirs["mesh"])
    (tmp_path / "m.csv").write_text(
        "name,mesh,embeddings,cloud,shelf\n"
        f"views,{mesh},{os.path.basename(theirs['embeddings'])},,7\n"
        f"points,{mesh},,cloud.npz,8\n"
    )
    command = [sys.executable, "-m", "semfm.batch", ours["mesh"], str(tmp_path / "grip.json")]
    command += [str(tmp_path / "m.csv"), "-o", str(tmp_path / "out"), "--k", "20"]
    command += ["--source-embeddings", ours["embeddings"], "--json", "--format", "jsonl"]
    run = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["n_done"] == 2
    found = {r["name"]: r for r in semfm.batch.records(tmp_path / "out")}
    one = semfm.transfer(
        mug.mesh,
        other.mesh,
        mug.region,
        source_embeddings=ours["embeddings"],
        target_embeddings=theirs["embeddings"],
        k=20,
    )
    assert semfm.batch.region_of(found["views"]) == one.region
    assert found["points"]["status"] == "done"
    again = subprocess.run(command, capture_output=True, text=True, timeout=300)
    assert json.loads(again.stdout)["n_skipped"] == 2


def test_a_script_needs_no_main_guard(small):
    script = small.folder / "script.py"
    script.write_text(
        "import sys, semfm.batch\n"
        "sys.path.insert(0, sys.argv[1])\n"
        "from pathlib import Path\n"
        "import batch_library\n"
        "made = batch_library.library(Path('.'), 2)\n"
        "print(semfm.batch.transfer(made.source, made.region, made.manifest, 'out',\n"
        "      settings=batch_library.settings(), k=12, workers=1).n_done)\n"
    )
    run = subprocess.run(
        [sys.executable, str(script), str(TESTS)],
        cwd=small.folder,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert run.stdout.split() == ["2"], run.stderr


# ---- failures


def test_failures_are_recorded_and_retried(small):
    bad = small.folder / "bad.npy"
    bad.write_bytes(b"not numpy")
    np.save(small.folder / "short.npy", np.ones((3, 21), np.float32))
    small.rows += [
        {"name": "no mesh", "mesh": "nowhere.ply", "features": "bad.npy"},
        {"name": "no numpy", "mesh": "object-000.ply", "features": "bad.npy"},
        {"name": "short", "mesh": "object-000.ply", "features": "short.npy"},
    ]
    small.write()
    summary = transferred(small)
    assert (summary.n_done, summary.n_failed) == (6, 3)
    found = by_name(small)
    assert (
        found["no mesh"]["error_type"] == "FileError" and "nowhere.ply" in found["no mesh"]["error"]
    )
    assert found["no numpy"]["error_type"] == "FormatError"
    assert found["short"]["error_type"] == "InvalidInput" and "(3, 21)" in found["short"]["error"]
    assert found["short"]["vertices"] is None
    with pytest.raises(ValueError, match="short has no region"):
        semfm.batch.region_of(found["short"])
    # As they were, they stay failed; on request they are tried; a mended file is tried by itself.
    assert transferred(small).n_skipped == 9
    again = transferred(small, retry_failed=True)
    assert (again.n_skipped, again.n_failed) == (6, 3)
    np.save(bad, np.load(small.folder / "object-000.npy"))
    mended = transferred(small)
    # "no mesh" names the mended file too, and still has no mesh.
    assert (mended.n_done, mended.n_failed, mended.n_skipped) == (1, 1, 7)
    assert by_name(small)["no numpy"]["status"] == "done"


@pytest.mark.skipif(sys.platform == "win32", reason="signals and named pipes")
def test_a_killed_worker_costs_no_row_but_one_that_always_kills(small):
    marks = small.folder / "marks"
    marks.mkdir()
    deadly = Deadly(
        small.source,
        small.region,
        settings(),
        k=12,
        once=("object-002", "object-003"),
        always=("object-004",),
        marks=str(marks),
    )
    os.chdir(small.folder)
    found = {r["name"]: r for r in pool.run(deadly, rows_of(small.rows), workers=2)}
    assert len(found) == 6
    failed = [r for r in found.values() if r["status"] == "failed"]
    assert [r["name"] for r in failed] == ["object-004"]
    assert failed[0]["error_code"] == "worker-died" and "SIGKILL" in failed[0]["error"]
    assert {r["name"]: r["attempts"] for r in found.values()} == {
        f"object-{i:03}": 2 if i in (2, 3, 4) else 1 for i in range(6)
    }


@pytest.mark.skipif(sys.platform == "win32", reason="signals and named pipes")
def test_a_hanging_object_is_given_up(small, monkeypatch):
    monkeypatch.setattr(pool, "GRACE_S", 0.2)
    monkeypatch.setattr("semfm.batch.library.Demonstration", Hanging)
    small.rows.insert(0, {**small.rows[0], "name": "hangs"})
    small.write()
    summary = transferred(small, timeout_s=1.5)
    assert summary.errors == {"timeout": 1} and summary.n_done == 6
    assert "killed" in by_name(small)["hangs"]["error"]


# ---- resuming


def test_what_is_done_is_not_done_again(small):
    def enough(stage, done, total):
        if done == 3:
            raise RuntimeError("enough")

    with pytest.raises(RuntimeError, match="enough"):
        transferred(small, progress=enough)
    first = by_name(small)
    assert 3 <= len(first) < 6
    second = transferred(small)
    assert (second.n_skipped, second.n_done) == (len(first), 6 - len(first))
    found = by_name(small)
    assert len(found) == 6 and all(found[name] == first[name] for name in first)
    # A target that changed is done again, alone.
    semfm.zoo.icosphere(2).write(small.folder / "object-001.ply")
    np.save(small.folder / "object-001.npy", np.eye(162, 21, dtype=np.float32))
    third = transferred(small)
    assert (third.n_skipped, third.n_done) == (5, 1)
    assert by_name(small)["object-001"]["n_vertices"] == 162


@pytest.mark.parametrize("format", ["parquet", "jsonl"])
def test_half_written_shards_are_discarded(small, format):
    if format == "parquet":
        pytest.importorskip("pyarrow")
    transferred(small, format=format, shard_size=2)
    inner = small.folder / "answers" / "records"
    first = sorted(inner.iterdir())[0]
    first.write_bytes(first.read_bytes()[:-20])
    (inner / ".semfm-part-of-a-shard").write_bytes(b"half")
    again = transferred(small, format=format)
    assert (again.n_discarded, again.n_done, again.n_skipped) == (2, 2, 4)
    assert len(by_name(small)) == 6 and not list(inner.glob(".semfm-*"))


def test_a_folder_belongs_to_one_question_and_one_writer(small):
    transferred(small)
    with pytest.raises(semfm.InvalidInput, match="settings differ") as caught:
        transferred(small, settings=semfm.TransferSettings("nearest"))
    assert caught.value.code == "other-batch"

    def second(stage, done, total):
        with pytest.raises(semfm.FileError, match="another batch"):
            transferred(small, out="other")

    transferred(small, out="other", progress=second)


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
def test_ctrl_c_keeps_what_is_done_and_leaves_no_worker(small):
    many = library(small.folder, 40)
    code = (
        "import sys; sys.path.insert(0, sys.argv[1])\n"
        "import batch_library, semfm.batch.library; from pathlib import Path\n"
        "semfm.batch.library.Demonstration = batch_library.Hanging\n"
        "made = batch_library.library(Path('.'), 1)\n"
        "semfm.batch.transfer(made.source, made.region, sys.argv[2], 'answers', k=12,\n"
        "    settings=batch_library.settings(), workers=2,\n"
        "    progress=lambda s, done, n: print(done, flush=True))\n"
    )
    rows = small.folder / "rows.jsonl"
    rows.write_text("".join(json.dumps(row) + "\n" for row in many.rows))
    with rows.open("a") as file:
        for i in range(2):
            file.write(json.dumps({**many.rows[0], "name": f"hangs-{i}"}) + "\n")
    run = subprocess.Popen(
        [sys.executable, "-c", code, str(TESTS), str(rows)],
        cwd=small.folder,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    # Both workers end in rows that never do.
    while run.stdout.readline().strip() != "40":
        assert run.poll() is None, run.stderr.read()
    children = Path(f"/proc/{run.pid}/task/{run.pid}/children")
    start = time.monotonic()
    workers = children.read_text().split() if children.exists() else []
    run.send_signal(signal.SIGINT)
    _, errors = run.communicate(timeout=20)
    assert time.monotonic() - start < 5 and "KeyboardInterrupt" in errors
    assert len(list(semfm.batch.records(small.folder / "answers"))) == 40
    assert not [pid for pid in workers if Path(f"/proc/{pid}").exists()]


# ---- bad input


@pytest.mark.parametrize(
    ("name", "text", "message"),
    [
        ("m.csv", "mesh,features\na.ply,a.npy\na.ply,b.npy\n", "line 3: .* 'a.ply' at line 2"),
        ("m.csv", "mesh,embedding\na.ply,a.mcap\n", "line 2: .*embeddings.* column 'embedding'"),
        ("m.csv", "file\na.ply\n", r"line 2: expected a mesh, found the columns \['file'\]"),
        ("m.csv", "mesh,features\n", "at least one row"),
        ("m.jsonl", '{"mesh": "a.ply", "features": "f"}\n{', "line 2: expected JSON"),
        ("m.jsonl", "[1]\n", "line 1: expected an object, found list"),
        ("m.jsonl", '{"mesh":"a","features":"f","cloud":"c"}', "found features and cloud"),
        ("m.txt", "a", "expected .csv, .jsonl or .parquet"),
    ],
)
def test_manifests_that_are_wrong_say_where(tmp_path, name, text, message):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(ValueError, match=message):
        semfm.batch.read_manifest(path)


def test_manifests_of_every_format_agree(tmp_path):
    rows = [{"mesh": f"{i}.ply", "features": f"{i}.npy", "shelf": i} for i in range(3)]
    (tmp_path / "m.jsonl").write_text("".join(json.dumps(row) + "\n" for row in rows))
    (tmp_path / "m.csv").write_text(
        "shelf,mesh,features\n" + "".join(f"{i},{i}.ply,{i}.npy\n" for i in range(3))
    )
    found = semfm.batch.read_manifest(tmp_path / "m.jsonl")
    assert found == semfm.batch.read_manifest(tmp_path / "m.csv")
    assert found[1].name == "1.ply" and found[1].mesh == str(tmp_path / "1.ply")
    pa = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    parquet.write_table(pa.Table.from_pylist(rows), tmp_path / "m.parquet")
    assert semfm.batch.read_manifest(tmp_path / "m.parquet") == found
    (tmp_path / "cut.parquet").write_bytes((tmp_path / "m.parquet").read_bytes()[:-9])
    with pytest.raises(semfm.FormatError, match="cut.parquet"):
        semfm.batch.read_manifest(tmp_path / "cut.parquet")
    with pytest.raises(semfm.FileError):
        semfm.batch.read_manifest(tmp_path / "none.csv")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"runner": "slurm"}, "runner: expected local or ray"),
        ({"workers": 0}, "workers: expected at least 1"),
        ({"timeout_s": -1.0}, "timeout_s: expected more than 0"),
        ({"address": "auto"}, "address"),
        ({"method": "fused"}, "settings: expected either"),
        ({"format": "xlsx"}, "format: expected one of parquet, jsonl"),
        ({"source_features": np.ones((3, 2))}, "source_features: expected none"),
    ],
)
def test_options_that_are_wrong_are_named(small, options, message):
    with pytest.raises(semfm.InvalidInput, match=message):
        transferred(small, **options)
    assert not (small.folder / "answers").exists()


def test_regions_must_fit_the_source(small):
    for region in (semfm.Region(np.ones(5)), semfm.Region(np.zeros(len(small.region)))):
        with pytest.raises(semfm.InvalidInput, match="region: expected"):
            semfm.batch.transfer(small.source, region, small.manifest, small.folder / "answers")
