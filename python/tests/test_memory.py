"""`semfm.Memory`: several demonstrations, asked for new objects."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

import semfm


@pytest.fixture(scope="module")
def containers():
    return [semfm.demo_object("containers", instance=i, n_vertices=600) for i in range(4)]


@pytest.fixture(scope="module")
def memory(containers, tmp_path_factory):
    memory = semfm.Memory(tmp_path_factory.mktemp("memory"))
    for name, demo in zip("abc", containers):
        memory.remember(name, demo.mesh, demo.region, kind="container")
    return memory


def test_what_is_remembered_is_listed_and_asked(memory, containers, tmp_path):
    assert memory.names == ["a", "b", "c"] and len(memory) == 3
    assert memory.entries[0]["kind"] == "container"
    assert memory.encoder["name"] == "builtin"
    answer = memory.transfer(containers[3].mesh)
    assert isinstance(answer, semfm.MemoryTransfer)
    assert answer.verdict in ("accept", "check", "refuse")
    assert (answer.why is None) or answer.verdict != "accept"
    assert sum(said["share"] for said in answer.answers) == pytest.approx(1)
    assert {said["name"] for said in answer.answers} == {"a", "b", "c"}
    assert answer.weights.shape == (containers[3].mesh.n_vertices,)
    prepared = semfm.prepare(containers[3].mesh)
    same = memory.transfer(prepared)
    assert np.array_equal(same.weights, answer.weights)
    assert same.confidence == answer.confidence
    files = answer.write(tmp_path / "out")
    assert any(file.endswith("memory.png") for file in files)
    report = json.loads((tmp_path / "out" / "report.json").read_text())
    assert report["format"] == "semfm.memory_report/1"
    assert report["confidence"] == answer.confidence
    assert answer.picture().startswith(b"\x89PNG")
    one = memory.transfer(prepared, shortlist=1)
    assert len(one.answers) == 1


def test_a_memory_opened_again_answers_the_same(memory, containers):
    again = semfm.Memory(memory.folder)
    assert again.names == memory.names
    target = semfm.prepare(containers[3].mesh)
    assert np.array_equal(again.transfer(target).weights, memory.transfer(target).weights)


def test_a_memory_is_asked_while_it_changes(containers, tmp_path):
    memory = semfm.Memory(tmp_path / "memory")
    lengths = []
    first, target = containers[0], containers[3].mesh
    memory.remember("a", first.mesh, first.region, progress=lambda *_: lengths.append(len(memory)))
    assert set(lengths) <= {0}
    with ThreadPoolExecutor() as threads:
        changes = [
            threads.submit(memory.remember, name, demo.mesh, demo.region)
            for name, demo in zip("bc", containers[1:])
        ]
        answers = [threads.submit(memory.transfer, target) for _ in range(3)]
        for change in changes:
            change.result(timeout=300)
        assert all(1 <= len(answer.result(timeout=300).answers) <= 3 for answer in answers)
    assert memory.names == ["a", "b", "c"]


def test_what_does_not_fit_is_refused_with_a_reason(memory, containers, tmp_path):
    with pytest.raises(semfm.SemfmError, match="a name that is not taken"):
        memory.remember("a", containers[3].mesh, containers[3].region)
    with pytest.raises(semfm.SemfmError, match="a kind of"):
        memory.transfer(containers[3].mesh, kind="boot")
    with pytest.raises(semfm.SemfmError, match="unknown encoder"):
        features = containers[3].shared_features()
        memory.transfer(semfm.prepare(containers[3].mesh, features=features))
    with pytest.raises(semfm.SemfmError, match="at least one demonstration"):
        semfm.Memory(tmp_path / "empty").transfer(containers[3].mesh)
    assert not (tmp_path / "empty").exists()
    with pytest.raises(semfm.SemfmError, match="an entry"):
        memory.forget("nothing")
