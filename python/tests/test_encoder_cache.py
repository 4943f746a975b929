"""Embeddings are kept under the content of everything that makes them: `transfer` and `eval --encoder`.

Each case changes one thing behind an unchanged name, with an unchanged size and modification time.
"""

from __future__ import annotations

import json
import os
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import semfm
from semfm.sidecar.inputs import encoder_inputs
from tiny_onnx import write_encoder

OWN = """\
import numpy as np
from semfm.sidecar import Grid
from own_parts.mixing import mix


class Own:
    name, revision, preprocessing = "own", "1", "{}"
    FILES

    def __init__(self, device, threads):
        self.weights = np.loadtxt("weights.txt")

    def grid(self, height, width):
        return Grid(height // 16, width // 16, (0.0, 0.0, float(width), float(height)))

    def encode(self, pictures):
        n, height, width, _ = pictures.shape
        blocks = pictures.reshape(n, height // 16, 16, width // 16, 16, 3)
        return [mix(blocks.mean((2, 4), dtype=np.float32), self.weights).astype(np.float32)]
"""


class Shell:
    """Two objects, a cache, and the command line; counts what the encoder embeds."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self.log = folder / "calls.txt"
        self.log.touch()
        program = folder / "embed"
        program.write_text(
            f'#!/bin/sh\necho "$@" >> {self.log}\nexec {sys.executable} -m semfm.sidecar "$@"\n'
        )
        program.chmod(0o755)
        self.environment = dict(
            os.environ, SEMFM_EMBED=str(program), SEMFM_CACHE=str(folder / "cache")
        )
        objects = folder / "data" / "containers"
        objects.mkdir(parents=True)
        for i in (0, 1):
            demo = semfm.demo_object("containers", instance=i, n_vertices=250)
            demo.mesh.write(objects / f"o{i}.obj")
            mesh = semfm.Mesh.read(objects / f"o{i}.obj")
            semfm.Region.from_vertices(mesh.n_vertices, demo.region.vertices).write(
                objects / f"o{i}.json", mesh
            )

    def run(self, *words: str) -> subprocess.CompletedProcess:
        command = [sys.executable, "-m", "semfm", *words]
        done = subprocess.run(
            command, capture_output=True, text=True, cwd=self.folder, env=self.environment, timeout=300
        )
        assert done.returncode in (0, 1), done.stderr
        return done

    def transfer(self, model: str, *more: str) -> subprocess.CompletedProcess:
        at = "data/containers"
        words = [f"{at}/o0.obj", f"{at}/o1.obj", "--region", f"{at}/o0.json", "-o", "out", "-k", "12"]
        return self.run(
            "transfer", *words, "--method", "nearest", "--rolls", "1", "--encoder", model, *more
        )

    def eval(self, model: str, output: str) -> None:
        words = ["data", "--methods", "nearest", "-o", output]
        self.run("eval", *words, "--encoder", model, "--quiet")

    def calls(self) -> int:
        """Calls of the encoder since the last time."""
        lines = [line for line in self.log.read_text().splitlines() if "--list-inputs" not in line]
        self.log.write_text("")
        return len(lines)

    def is_made(self, model: str) -> bool:
        """Whether the encoder is run for a transfer."""
        self.transfer(model, "--quiet")
        return self.calls() > 0


@pytest.fixture()
def shell(tmp_path: Path) -> Shell:
    pytest.importorskip("onnxruntime")
    return Shell(tmp_path)


def swap(path: Path, change) -> None:
    """Other bytes of the same number at the same time."""
    about, before = path.stat(), path.read_bytes()
    after = change(before)
    assert after != before
    path.write_bytes(after)
    os.utime(path, ns=(about.st_atime_ns, about.st_mtime_ns))


def other_network(folder: Path) -> bytes:
    """A network of the same size and shape with other weights."""
    onnx = pytest.importorskip("onnx")
    from onnx import numpy_helper

    network = onnx.load(folder / "tiny.onnx")
    weights = network.graph.initializer[0]
    values = numpy_helper.to_array(weights)
    weights.CopyFrom(numpy_helper.from_array(values[::-1].copy(), weights.name))
    return network.SerializeToString()


def test_a_network_that_was_replaced_is_another_encoder(shell):
    model = str(write_encoder(shell.folder))
    assert shell.is_made(model) and not shell.is_made(model)
    swap(shell.folder / "tiny.onnx", lambda _: other_network(shell.folder))
    assert shell.is_made(model) and not shell.is_made(model)
    # The description, too.
    swap(shell.folder / "tiny.json", lambda text: text.replace(b"0.4", b"0.6"))
    assert shell.is_made(model) and not shell.is_made(model)


def test_weights_beside_the_network_belong_to_it(shell):
    onnx = pytest.importorskip("onnx")
    model = write_encoder(shell.folder)
    network = onnx.load(shell.folder / "tiny.onnx")
    onnx.save(
        network,
        shell.folder / "tiny.onnx",
        save_as_external_data=True,
        location="tiny.data",
        size_threshold=0,
    )
    files = encoder_inputs(str(model))["files"]
    assert files["tiny.data"] == str(shell.folder / "tiny.data")
    assert shell.is_made(str(model)) and not shell.is_made(str(model))
    revision = open_revision(model)
    swap(shell.folder / "tiny.data", lambda data: np.frombuffer(data, "f4")[::-1].tobytes())
    assert open_revision(model) != revision
    assert shell.is_made(str(model)) and not shell.is_made(str(model))


def open_revision(model: Path) -> str:
    from semfm.sidecar import open_encoder

    return open_encoder(str(model)).revision


def test_a_folder_is_told_by_what_it_holds_and_not_by_its_name_or_age(shell):
    one, copy, other = (shell.folder / name for name in ("one", "copy", "other"))
    for folder in (one, other):
        folder.mkdir()
        write_encoder(folder)
    swap(other / "tiny.onnx", lambda _: other_network(other))
    shutil.copytree(one, copy)
    for path in (one, copy, other):
        os.utime(path / "tiny.json", ns=(10**18, 10**18))
    assert shell.is_made(str(one / "tiny.json"))
    assert not shell.is_made(str(copy / "tiny.json"))
    assert shell.is_made(str(other / "tiny.json"))
    # The same relative name from elsewhere is another file.
    assert not shell.is_made("other/tiny.json")


def test_a_class_of_ones_own_is_its_code_and_the_files_that_it_lists(shell):
    parts = shell.folder / "own_parts"
    parts.mkdir()
    (parts / "__init__.py").touch()
    (parts / "mixing.py").write_text("def mix(x, w):\n    return x * w\n")
    (shell.folder / "weights.txt").write_text("1.0 2.0 3.0\n")
    (shell.folder / "own.py").write_text(OWN.replace("FILES", 'files = ["weights.txt"]'))
    assert shell.is_made("own:Own") and not shell.is_made("own:Own")
    swap(parts / "mixing.py", lambda code: code.replace(b"x * w", b"x + w"))
    assert shell.is_made("own:Own") and not shell.is_made("own:Own")
    swap(shell.folder / "weights.txt", lambda text: text.replace(b"1.0", b"7.0"))
    assert shell.is_made("own:Own") and not shell.is_made("own:Own")
    swap(shell.folder / "own.py", lambda code: code.replace(b"dtype=np.float32", b"dtype=np.float64"))
    assert shell.is_made("own:Own") and not shell.is_made("own:Own")

    # What a class reads is not known unless it says so: nothing is kept then.
    (shell.folder / "own.py").write_text(OWN.replace("FILES", ""))
    assert shell.is_made("own:Own") and shell.is_made("own:Own")
    assert "does not list its `files`" in shell.transfer("own:Own").stderr


def test_an_evaluation_sees_other_weights_too(shell):
    model = str(write_encoder(shell.folder))
    shell.eval(model, "first")
    assert shell.calls() == 2  # one for each object
    shell.eval(model, "second")
    assert shell.calls() == 0
    swap(shell.folder / "tiny.onnx", lambda _: other_network(shell.folder))
    shell.eval(model, "third")
    assert shell.calls() == 2


def test_nothing_is_kept_where_the_caller_says_so(shell):
    model = str(write_encoder(shell.folder))
    for _ in range(2):
        shell.transfer(model, "--no-cache")
        assert shell.calls() == 1


def test_the_code_of_the_encoders_and_versions_count(tmp_path):
    inputs = encoder_inputs(str(write_encoder(tmp_path)))
    assert "semfm/sidecar/patches.py" in inputs["files"] and inputs["unknown"] is None
    assert inputs["packages"]["semfm"] == semfm.__version__
    assert {"tiny.json", "tiny.onnx"} <= set(inputs["files"])
    json.dumps(inputs)


@pytest.mark.full
def test_a_checkpoint_is_its_configuration_and_weights(shell):
    from test_transformers import save_dinov2

    folder = shell.folder / "checkpoint"
    save_dinov2(folder)
    inputs = encoder_inputs(str(folder))
    assert {"config.json", "preprocessor_config.json", "model.safetensors"} <= set(inputs["files"])
    assert shell.is_made(str(folder)) and not shell.is_made(str(folder))
    swap(folder / "model.safetensors", lambda data: data[:-64] + data[-64:][::-1])
    assert shell.is_made(str(folder)) and not shell.is_made(str(folder))
    swap(folder / "preprocessor_config.json", lambda text: text.replace(b"64", b"72"))
    assert shell.is_made(str(folder))
