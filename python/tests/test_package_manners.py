"""What every class does: views that keep their owner, a free interpreter, Ctrl-C, progress, pickles, panics."""

from __future__ import annotations

import copy
import gc
import json
import os
import pickle
import signal
import subprocess
import sys
import threading
import time

import numpy as np
import pytest

import semfm
import semfm.zoo
from semfm import _semfm

# ---- views


def test_views_share_memory_and_keep_their_owner_alive():
    mesh = semfm.zoo.icosphere(2)
    vertices, expected = mesh.vertices, mesh.vertices.copy()
    assert np.shares_memory(vertices, mesh.vertices) and not vertices.flags.owndata
    shape = semfm.Shape(mesh, k=12)
    functions, values = shape.basis.functions, shape.basis.values
    assert np.shares_memory(functions, shape.basis.functions)
    assert np.shares_memory(shape.original.vertices, shape.original.vertices)
    kept = functions.copy(), values.copy()
    del mesh, shape
    gc.collect()
    noise = [np.random.default_rng(i).random((162, 12)) for i in range(50)]
    assert np.array_equal(vertices, expected) and len(noise) == 50
    assert np.array_equal(functions, kept[0]) and np.array_equal(values, kept[1])


def test_views_cannot_be_written_to():
    mesh = semfm.zoo.icosphere(1)
    for view in (mesh.vertices, mesh.faces, semfm.Shape(mesh, k=4).basis.functions):
        with pytest.raises(ValueError, match="read-only"):
            view[0, 0] = 1
        with pytest.raises(ValueError, match="WRITEABLE"):
            view.flags.writeable = True


def test_input_arrays_are_left_as_they_were():
    points = np.asfortranarray(semfm.zoo.icosphere(1).vertices)
    before = points.copy()
    mesh = semfm.Mesh(points, semfm.zoo.icosphere(1).faces)
    points[:] = 0
    assert np.array_equal(mesh.vertices, before)


# ---- work


def test_the_interpreter_is_free_while_we_work():
    worked = threading.Event()

    def work():
        _semfm._work_for_tests("sleep", 0.4)
        worked.set()

    thread = threading.Thread(target=work)
    thread.start()
    turns = 0
    while not worked.is_set():
        time.sleep(0.002)
        turns += 1
    thread.join()
    # A held interpreter would have let this loop turn once or twice.
    assert turns > 20, turns


def test_threads_share_one_object():
    shape = semfm.Shape(semfm.zoo.torus(30, 15), k=10)
    alone = semfm.wks(shape.basis)
    found = [None] * 6

    def work(i):
        found[i] = semfm.wks(shape.basis)

    threads = [threading.Thread(target=work, args=(i,)) for i in range(6)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(np.array_equal(each, alone) for each in found)


INTERRUPTED = """
import signal, sys, threading, os, time
import semfm
from semfm import _semfm

def interrupt():
    time.sleep(0.3)
    global sent
    sent = time.monotonic()
    os.kill(os.getpid(), signal.SIGINT)

threading.Thread(target=interrupt, daemon=True).start()
try:
    {call}
except KeyboardInterrupt:
    print("interrupted", time.monotonic() - sent)
else:
    print("not interrupted")
"""


@pytest.mark.skipif(sys.platform == "win32", reason="POSIX signals")
@pytest.mark.parametrize(
    "call",
    [
        "_semfm._work_for_tests('sleep', 20.0)",
        "_semfm._work_for_tests('deaf', 20.0)",
        "semfm.Shape(semfm.demo_object('tools', n_vertices=60000).mesh, k=300, working_vertices=0)",
    ],
    ids=["work that checks", "work that does not", "a large basis"],
)
def test_ctrl_c_is_answered_within_half_a_second(call):
    code = INTERRUPTED.format(call=call)
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    words = run.stdout.split()
    assert words[:1] == ["interrupted"], run.stdout + run.stderr
    assert float(words[1]) < 0.5


def test_progress_is_told_on_the_calling_thread_and_may_stop_the_work():
    told = []
    semfm.Shape(
        semfm.zoo.icosphere(3),
        k=20,
        progress=lambda *step: told.append((threading.get_ident(), *step)),
    )
    assert {thread for thread, *_ in told} == {threading.get_ident()}
    assert {"working mesh", "laplacian", "eigenbasis"} <= {stage for _, stage, _, _ in told}
    assert all(0 <= done <= total for _, _, done, total in told)

    def enough(stage, done, total):
        raise RuntimeError(f"enough at {done}")

    start = time.monotonic()
    with pytest.raises(RuntimeError, match="enough at 1"):
        _semfm._work_for_tests("sleep", 10.0, enough)
    assert time.monotonic() - start < 1.0


def test_progress_true_draws_a_bar(capsys):
    _semfm._work_for_tests("sleep", 0.2, True)
    assert "sleep" in capsys.readouterr().err
    _semfm._work_for_tests("sleep", 0.05, False)
    assert capsys.readouterr().err == ""


@pytest.mark.parametrize("what", ["panic", "panic here"])
def test_a_panic_is_an_exception_and_silent(what, capfd):
    with pytest.raises(semfm.InternalError, match="on purpose") as caught:
        _semfm._work_for_tests(what)
    assert isinstance(caught.value, Exception) and caught.value.code == "internal"
    assert "interruptible.rs:" in str(caught.value)
    assert capfd.readouterr().err == ""
    assert semfm.zoo.icosphere(1).n_vertices == 42  # life goes on


@pytest.mark.skipif(not hasattr(os, "fork"), reason="needs fork")
def test_a_forked_child_works_too():
    mesh = semfm.zoo.icosphere(3)
    semfm.Shape(mesh, k=5)  # the parent's threads are up
    code = """
import os, semfm, semfm.zoo
mesh = semfm.zoo.icosphere(3)
before = semfm.Shape(mesh, k=5).basis.values
child = os.fork()
if child == 0:
    os._exit(0 if (semfm.Shape(mesh, k=5).basis.values == before).all() else 1)
print(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))
"""
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
    assert run.stdout.strip() == "0", run.stderr


def test_results_do_not_depend_on_the_number_of_threads(result):
    mug, kettle = result.source, result.target
    answers = []
    try:
        for n_threads in (1, 3):
            semfm.set_num_threads(n_threads)
            assert semfm.get_num_threads() == n_threads
            shape = semfm.Shape(mug.mesh, k=30)
            again = semfm.transfer(
                semfm.prepare(mug.mesh, cloud=mug.cloud),
                semfm.prepare(kettle.mesh, cloud=kettle.cloud),
                result.source_region,
            )
            answers.append((shape.basis.functions.tobytes(), again.weights.tobytes()))
    finally:
        semfm.set_num_threads(0)
    assert answers[0] == answers[1]
    assert answers[0][1] == result.weights.tobytes()


# ---- pickles and copies


@pytest.fixture(scope="module")
def result():
    mug, kettle = (
        semfm.demo_object("containers", instance=i, n_vertices=500) for i in (0, 1)
    )
    return semfm.transfer(
        mug.mesh,
        kettle.mesh,
        mug.region,
        source_embeddings=mug.embeddings(),
        target_embeddings=kettle.embeddings(),
    )


def values_of(result):
    """One value of every class that can be pickled, and what makes two of them equal."""
    mesh, matching = result.source.mesh, semfm.Matching(result.source, result.target)
    shape, camera = result.source.shape, semfm.rig(mesh, count=2)[0]
    view = semfm.render(mesh, [camera])[0]
    patches = semfm.PatchEmbeddings(
        np.arange(24, dtype=float).reshape(2, 3, 4), [0, 0, 48, 32], valid=np.eye(2, 3) > 0
    )
    embeddings = semfm.Embeddings(mesh, [camera], [patches], encoder="mine")
    return {
        "Mesh": (mesh, lambda m: (m.hash,)),
        "Shape": (shape, lambda s: (s.original.hash, s.basis.functions, s.report["k"])),
        "Laplacian": (shape.laplacian, lambda x: (x.stiffness.toarray(), x.mass)),
        "Eigenbasis": (shape.basis, lambda b: (b.values, b.functions, b.mass, b.residuals)),
        "Pinhole": (camera, lambda c: (c.camera_from_world, c.fx, c.cx, c.width)),
        "View": (view, lambda v: (v.rgb, v.depth, v.triangles)),
        "PatchEmbeddings": (patches, lambda p: (p.data, p.rect, p.coverage, p.valid)),
        "Embeddings": (embeddings, lambda e: (e.encoder, e.mesh_hash, e.patches[0].data)),
        "SemanticCloud": (result.source.cloud, lambda c: (c.points, c.features, c.n_views)),
        "Clusters": (semfm.Clusters([3, 1, 3]), lambda c: (c.labels,)),
        "Anchors": (matching.anchors, lambda a: (a.pairs, a.scores, a.margins, a.cosines)),
        "FunctionalMap": (matching.functional_map, lambda f: (f.matrix,)),
        "PointMap": (result.point_map, lambda p: (p.source_of, p.n_source)),
        "Region": (result.region, lambda r: (r.weights,)),
        "TransferSettings": (result.settings, lambda s: (s.to_dict(),)),
        "PreparedObject": (
            result.source,
            lambda p: (p.cloud.features, p.shape.basis.values, p.stages_ms),
        ),
        "Transfer": (
            result,
            lambda t: (t.weights, t.confidence, t.verdict, t.point_map.source_of, t.report),
        ),
    }


def test_everything_can_be_pickled_and_copied(result):
    for name, (value, facts) in values_of(result).items():
        for again in (
            pickle.loads(pickle.dumps(value, protocol=5)),
            copy.copy(value),
            copy.deepcopy(value),
        ):
            assert type(again) is type(value), name
            for fact, same in zip(facts(value), facts(again)):
                assert np.array_equal(fact, same) if isinstance(fact, np.ndarray) else fact == same
            assert repr(again) == repr(value)


def test_a_pickled_transfer_writes_the_same_files(result, tmp_path):
    again = pickle.loads(pickle.dumps(result))
    for name, each in (("first", result), ("again", again)):
        each.write(tmp_path / name)
    for file in ("region.json", "point_map.json", "target.ply"):
        first, second = ((tmp_path / name / file).read_bytes() for name in ("first", "again"))
        assert first == second, file
    reports = [json.loads((tmp_path / name / "report.json").read_text()) for name in ("first", "again")]
    for report in reports:
        # How long writing took is of this writing.
        assert report["stages_ms"].pop("write") >= 0
    assert reports[0] == reports[1]


def test_npz_files_give_maps_and_bases_back(result, tmp_path):
    basis, target = result.source.shape.basis, result.target.shape.basis
    basis.to_npz(tmp_path / "basis.npz")
    again = semfm.Eigenbasis.from_npz(tmp_path / "basis.npz")
    assert np.array_equal(again.functions, basis.functions)
    result.point_map.to_npz(tmp_path / "map.npz")
    assert semfm.PointMap.from_npz(tmp_path / "map.npz") == result.point_map
    fitted = semfm.FunctionalMap.fit(basis, target, semfm.wks(basis), semfm.wks(target), k=20)
    fitted.to_npz(tmp_path / "fitted.npz")
    assert semfm.FunctionalMap.from_npz(tmp_path / "fitted.npz") == fitted
    with pytest.raises(semfm.FormatError, match="matrix"):
        semfm.FunctionalMap.from_npz(tmp_path / "basis.npz")


def test_importing_brings_nothing_large_and_leaves_signals_alone():
    code = "import sys, semfm; print('scipy' in sys.modules, 'google' in sys.modules)"
    run = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "False"]
    assert signal.getsignal(signal.SIGINT) is signal.default_int_handler
