"""A library over a local Ray of two workers, some of which die."""

from __future__ import annotations

import os
import signal

import pytest
from batch_library import Deadly, library, settings

import semfm.batch
from semfm.batch import ray_runner
from semfm.batch.manifest import rows_of

pytestmark = pytest.mark.full
COUNT = 240


@pytest.fixture(scope="module")
def many(tmp_path_factory):
    pytest.importorskip("ray.data")
    return library(tmp_path_factory.mktemp("library"), COUNT)


@pytest.fixture(scope="module", autouse=True)
def cluster(many):
    ray = pytest.importorskip("ray")
    here = os.path.dirname(__file__)
    path = os.pathsep.join([here, os.environ.get("PYTHONPATH", "")])
    ray.init(
        num_cpus=2,
        include_dashboard=False,
        log_to_driver=False,
        object_store_memory=200 * 2**20,
        runtime_env={"env_vars": {"PYTHONPATH": path}},
    )
    yield
    ray.shutdown()


def test_a_worker_killed_in_the_middle_costs_no_answer(many):
    killed = []

    def kill(stage, done, total):
        if done in (60, 120) and len(killed) < 2:
            record = last(many.folder / "ray")
            if record is not None and _alive(record):
                os.kill(record, signal.SIGKILL)
                killed.append(record)

    options = {"settings": settings(), "k": 12, "workers": 2}
    here = (many.source, many.region, many.manifest)
    summary = semfm.batch.transfer(
        *here, many.folder / "ray", runner="ray", shard_size=20, progress=kill, **options
    )
    assert killed, "no worker could be killed"
    assert (summary.n_done, summary.n_failed) == (COUNT, 0)
    local = semfm.batch.transfer(*here, many.folder / "local", **options)
    assert local.verdicts == summary.verdicts
    kept = ("name", "verdict", "confidence", "vertices", "weights", "mesh_hash", "hypotheses")
    both = [
        sorted(
            (
                {key: record[key] for key in kept}
                for record in semfm.batch.records(many.folder / out)
            ),
            key=lambda record: record["name"],
        )
        for out in ("ray", "local")
    ]
    assert both[0] == both[1]
    again = semfm.batch.transfer(*here, many.folder / "ray", runner="ray", **options)
    assert again.n_skipped == COUNT


def test_a_row_that_always_kills_is_recorded(many, tmp_path):
    os.chdir(many.folder)
    deadly = Deadly(
        many.source,
        many.region,
        settings(),
        k=12,
        once=("object-005",),
        always=("object-011",),
        marks=str(tmp_path),
    )
    rows = rows_of(many.rows[:30])
    found = {r["name"]: r for r in ray_runner.run(deadly, rows, workers=2)}
    assert len(found) == 30
    assert [r["name"] for r in found.values() if r["status"] == "failed"] == ["object-011"]
    assert found["object-011"]["error_code"] == "worker-died"
    assert (tmp_path / "object-005").exists()


def last(folder):
    """Process id of the worker of the last record on disk."""
    found = list(semfm.batch.records(folder))
    return int(found[-1]["worker"].rsplit(":", 1)[1]) if found else None


def _alive(pid):
    try:
        os.kill(pid, 0)
    except OSError:
        return False
    return True
