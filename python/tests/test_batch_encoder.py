"""Libraries whose objects bring no features: an encoder makes them."""

from __future__ import annotations

import json
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from batch_library import library

import semfm
import semfm.batch
from semfm.batch import ray_runner
from semfm.batch.manifest import rows_of
from semfm.batch.task import Demonstration

SETTINGS = semfm.TransferSettings("fused", zoomout={"k_final": 12})
OPTIONS = {"settings": SETTINGS, "k": 12, "workers": 2}


@pytest.fixture
def bare(tmp_path):
    """A library of three objects without features, and the mesh that was demonstrated."""
    made = library(tmp_path, 3)
    for row in made.rows:
        row.pop("features")
    made.write()
    return made


def transferred(bare, out="answers", source=None, **options):
    source = bare.source.mesh if source is None else source
    return semfm.batch.transfer(
        source, bare.region, bare.manifest, bare.folder / out, **{**OPTIONS, **options}
    )


def by_name(bare, out="answers"):
    return {record["name"]: record for record in semfm.batch.records(bare.folder / out)}


def test_answers_are_those_of_a_single_transfer(bare):
    summary = transferred(bare)
    assert (summary.n_done, summary.n_failed) == (3, 0)
    for name, record in by_name(bare).items():
        alone = semfm.transfer(
            bare.source.mesh,
            semfm.Mesh.read(bare.folder / f"{name}.ply"),
            bare.region,
            settings=SETTINGS,
            k=12,
        )
        assert semfm.batch.region_of(record) == alone.region
        assert record["confidence"] == alone.confidence
    identity = json.loads((bare.folder / "answers" / "batch.json").read_text())["identity"]
    assert identity["encoder"]["name"] == "builtin" and identity["encoder"]["version"]
    kept = list((bare.folder / "answers" / "shapes" / "embeddings").glob("*.emb.mcap"))
    assert len(kept) == 4, "the source and three targets"
    assert transferred(bare).n_skipped == 3


def test_objects_with_features_and_without_stand_in_one_manifest(bare):
    mesh = semfm.Mesh.read(bare.folder / "object-001.ply")
    semfm.embed(mesh).write(bare.folder / "one.emb.mcap")
    bare.rows[1]["embeddings"] = "one.emb.mcap"
    bare.write()
    assert transferred(bare).n_done == 3
    # Half precision in the file: the answer is another one by a little at most.
    mixed = by_name(bare)
    bare.rows[1].pop("embeddings")
    bare.write()
    transferred(bare, out="encoded")
    encoded = by_name(bare, "encoded")
    assert mixed["object-000"]["vertices"] == encoded["object-000"]["vertices"]
    assert mixed["object-001"]["verdict"] == encoded["object-001"]["verdict"]


def test_a_source_with_its_own_features_names_the_encoder(bare):
    with pytest.raises(semfm.InvalidInput, match="object-000: expected one of embeddings"):
        transferred(bare, source=bare.source)
    assert not (bare.folder / "answers").exists()
    # Prepared by the built-in encoder: that one is meant.
    prepared = semfm.prepare(bare.source.mesh, settings=SETTINGS, k=12)
    assert transferred(bare, source=prepared).n_done == 3
    # A method without features needs no encoder.
    wks = semfm.TransferSettings("wks")
    geometry = semfm.prepare(bare.source.mesh, settings=wks, k=12)
    assert transferred(bare, "wks", geometry, settings=wks).n_done == 3


def test_two_encoders_do_not_meet(bare):
    mesh = bare.source.mesh
    views = semfm.ViewsFile(mesh, semfm.render(mesh))
    patches = semfm.embed(mesh).patches
    renamed = semfm.Embeddings.of_views(views, patches, encoder="builtin", revision="0")
    summary = transferred(bare, source_embeddings=renamed, encoder="builtin")
    assert summary.errors == {"invalid": 3}
    assert "builtin 0" in by_name(bare)["object-000"]["error"]


def test_an_encoder_s_file_is_found_from_anywhere(bare, monkeypatch, tmp_path):
    weights = Path(__file__).parents[2] / "crates/semfm-encoder/weights/builtin.net"
    shutil.copy(weights, bare.folder / "own.net")
    monkeypatch.chdir(bare.folder)
    assert transferred(bare, encoder="own.net", workers=1).n_done == 3
    with pytest.raises(semfm.SemfmError, match=r"missing\.net"):
        transferred(bare, "other", encoder="missing.net")


def test_the_shell_needs_no_embeddings(bare):
    bare.source.mesh.write(bare.folder / "mug.ply")
    bare.region.write(bare.folder / "grip.json", semfm.Mesh.read(bare.folder / "mug.ply"))
    command = [sys.executable, "-m", "semfm.batch", "mug.ply", "grip.json", "library.jsonl"]
    command += ["-o", "out", "--k", "12", "--json", "--workers", "1", "--encoder", "builtin"]
    run = subprocess.run(command, cwd=bare.folder, capture_output=True, text=True, timeout=300)
    assert run.returncode == 0, run.stderr
    assert json.loads(run.stdout)["n_done"] == 3


@pytest.mark.full
def test_ray_encodes_likewise(bare):
    ray = pytest.importorskip("ray")
    pytest.importorskip("ray.data")
    source = semfm.prepare(bare.source.mesh, settings=SETTINGS, k=12)
    demonstration = Demonstration(source, bare.region, SETTINGS, k=12, encoder="builtin")
    rows = rows_of([{**row, "mesh": str(bare.folder / row["mesh"])} for row in bare.rows])
    try:
        found = {r["name"]: r for r in ray_runner.run(demonstration, rows, workers=1)}
    finally:
        ray.shutdown()
    transferred(bare)
    for name, record in by_name(bare).items():
        assert np.array_equal(found[name]["vertices"], record["vertices"])
