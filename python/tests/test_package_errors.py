"""Every error that SemFM raises is a `SemfmError`, and the built-in exception that fits."""

from __future__ import annotations

import pickle
import re
from pathlib import Path

import pytest

import semfm
import semfm.zoo
from semfm import errors
from semfm.adapters._parts import library, mesh_of
from semfm.batch import region_of
from semfm.batch.manifest import rows_of
from semfm.sidecar import SidecarError
from semfm.vlm.answer import UnusableAnswer
from semfm.vlm.client import EndpointError
from semfm.vlm.key import ApiKey

ROOT = Path(__file__).resolve().parents[2]


@pytest.mark.parametrize(
    ("call", "kind", "builtin", "code"),
    [
        (lambda: semfm.TransferSettings().nothing, "UnknownAttribute", AttributeError, "attribute"),
        (lambda: semfm.TransferSettings(zoom=3), "InvalidType", TypeError, "type"),
        (lambda: semfm.Shape(42), "InvalidType", TypeError, "type"),
        (lambda: semfm.Region([2.0]), "InvalidInput", ValueError, "invalid"),
        (lambda: semfm.Mesh.read("nowhere.ply"), "FileError", OSError, "io"),
        (lambda: mesh_of(42), "InvalidType", TypeError, "type"),
        (
            lambda: library("no_such_package", "it"),
            "MissingPackage",
            ImportError,
            "missing-package",
        ),
        (lambda: rows_of([3]), "InvalidType", TypeError, "type"),
        (
            lambda: region_of({"status": "failed", "name": "a", "error": "b"}),
            "InvalidInput",
            ValueError,
            "invalid",
        ),
        (lambda: pickle.dumps(ApiKey("k")), "InvalidType", TypeError, "type"),
    ],
)
def test_what_is_raised_is_ours_and_the_builtin_one(call, kind, builtin, code):
    with pytest.raises(builtin) as caught:
        call()
    assert type(caught.value) is getattr(errors, kind) and caught.value.code == code
    again = pickle.loads(pickle.dumps(caught.value))
    assert (type(again), str(again), again.code) == (type(caught.value), str(caught.value), code)


def test_a_grasp_that_is_not_there_ends_a_loop():
    ball = semfm.zoo.icosphere(2)
    everywhere = semfm.Region([1.0] * ball.n_vertices)
    grasps = semfm.find_grasps(ball, everywhere, "franka", scale=0.03, n_samples=20)
    with pytest.raises(semfm.IndexOutOfRange):
        grasps[len(grasps)]
    assert len(list(grasps)) == len(grasps)


def test_errors_of_the_sidecar_and_of_endpoints_are_ours():
    for error in (SidecarError("a"), EndpointError("timeout", "t"), UnusableAnswer("prose", "p")):
        assert isinstance(error, semfm.SemfmError)
        again = pickle.loads(pickle.dumps(error))
        assert (type(again), str(again), vars(again)) == (type(error), str(error), vars(error))


def test_no_source_raises_a_bare_builtin():
    """But for those that never leave the package: they are caught where they are expected."""
    inner = {"batch/task.py": "TimeoutError", "batch/journal.py": "ValueError"}
    for name in ("vlm/answer.py", "sidecar/onnx_files.py", "sidecar/torch_weights.py"):
        inner[name] = "ValueError"
    bare = re.compile(r"raise (\w+Error)\(")
    ours = {name for name in vars(errors)} | {"SidecarError", "EndpointError", "MaskError"}
    for path in (ROOT / "python" / "semfm").rglob("*.py"):
        name = path.relative_to(ROOT / "python" / "semfm").as_posix()
        found = set(bare.findall(path.read_text("utf-8"))) - ours
        assert found <= {inner.get(name)}, name
    rust = ROOT / "crates" / "semfm-py" / "src"
    if not rust.is_dir():
        pytest.skip("the package's sources are not here")
    for path in rust.glob("*.rs"):
        assert "exceptions::Py" not in path.read_text("utf-8"), path.name
