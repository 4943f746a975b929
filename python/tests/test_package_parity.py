"""The same call in Python and at the shell gives the same numbers, to the last byte."""

from __future__ import annotations

import json
import subprocess
import sys

import numpy as np
import pytest

import semfm


@pytest.fixture(scope="module")
def pair(tmp_path_factory):
    folder = tmp_path_factory.mktemp("pair")
    objects = [semfm.demo_object("tools", 3, instance=i, n_vertices=700) for i in (0, 1)]
    files = [each.write(folder, "easy") for each in objects]
    for each, name in zip(objects, ("source", "target")):
        np.save(folder / f"{name}.npy", each.shared_features())
    objects[0].region.write(folder / "grip.json", objects[0].mesh)
    return folder, objects, files


def shell(*arguments):
    command = [sys.executable, "-m", "semfm", *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=120)


@pytest.mark.parametrize("method", ["fused", "semfm", "sinkhorn"])
def test_a_transfer_by_features_is_the_same_at_the_shell(pair, method, tmp_path):
    folder, (source, target), files = pair
    run = shell(
        "transfer", files[0]["mesh"], files[1]["mesh"], "--region", folder / "grip.json",
        "--source-features", folder / "source.npy", "--target-features", folder / "target.npy",
        "--method", method, "--seed", 5, "--no-cache", "-o", tmp_path / "shell",
    )  # fmt: skip
    assert run.returncode in (0, 1), run.stderr
    result = semfm.transfer(
        files[0]["mesh"],
        semfm.Mesh.read(files[1]["mesh"]),
        folder / "grip.json",
        source_features=source.shared_features(),
        target_features=target.shared_features().astype(np.float64),
        method=method,
        seed=5,
    )
    result.write(tmp_path / "python")
    same_files(tmp_path)
    report = json.loads((tmp_path / "shell/report.json").read_text())
    assert result.report["map"] == report["map"] and result.verdict == report["verdict"]
    assert run.returncode == (1 if result.verdict == "refuse" else 0)


def test_a_transfer_by_embeddings_is_the_same_at_the_shell(pair, tmp_path):
    folder, (source, target), files = pair
    run = shell(
        "transfer", files[0]["mesh"], files[1]["mesh"], "--region", folder / "grip.json",
        "--source-embeddings", files[0]["embeddings"],
        "--target-embeddings", files[1]["embeddings"], "--no-cache", "-o", tmp_path / "shell",
    )  # fmt: skip
    assert run.returncode in (0, 1), run.stderr
    prepared = [semfm.prepare(f["mesh"], embeddings=f["embeddings"]) for f in files]
    matching = semfm.Matching(*prepared)
    matching.transfer(folder / "grip.json").write(tmp_path / "python")
    same_files(tmp_path)
    # The reusable value gives what the short call gives.
    again = semfm.transfer(*prepared, source.region)
    assert np.array_equal(again.weights, matching.transfer(source.region).weights)


def same_files(folder):
    for name in ("region.json", "point_map.json", "target.ply", "target.glb", "transfer.png"):
        shell, python = ((folder / side / name).read_bytes() for side in ("shell", "python"))
        assert shell == python, name


def test_a_mesh_is_the_same_at_the_shell(pair):
    _, (source, _), files = pair
    run = shell("info", files[0]["mesh"], "--json")
    told = json.loads(run.stdout)
    mesh = semfm.Mesh.read(files[0]["mesh"])
    assert (told["hash"], told["area"]) == (mesh.hash, mesh.area) == (
        source.mesh.hash,
        source.mesh.area,
    )
    assert np.array_equal(told["bounds"], mesh.bounds)
    assert all(told[name] == count for name, count in mesh.report().items())


def test_a_region_by_contact_is_the_same_at_the_shell(pair, tmp_path):
    _, (source, _), files = pair
    contact = source.mesh.vertices[source.region.vertices[0]]
    text = ",".join(repr(float(x)) for x in contact)
    shell("region", files[0]["mesh"], "-o", tmp_path / "a.json", "--near", text, "--radius", "0.1")
    semfm.Region.near(source.mesh, contact, 0.1).write(tmp_path / "b.json", source.mesh)
    assert (tmp_path / "a.json").read_bytes() == (tmp_path / "b.json").read_bytes()


def test_the_command_line_answers_as_the_binary_does(tmp_path):
    assert shell("--version").stdout == f"semfm-cli {semfm.__version__}\n"
    assert shell("transfer").returncode == 2
    refused = shell("info", tmp_path / "nothing.obj")
    assert refused.returncode == 2 and "nothing.obj" in refused.stderr
    # Twice in one process.
    from semfm.__main__ import main

    assert main(["info", str(tmp_path)]) == 2
    assert main(["info", str(tmp_path)]) == 2
