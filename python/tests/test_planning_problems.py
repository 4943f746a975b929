"""Twenty planning problems of MotionBenchMaker a robot: what touches, by us and by coal."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from browser import semfm_cli

ROOT = Path(__file__).resolve().parents[2]
sys.path.insert(0, str(ROOT / "bench"))


@pytest.fixture(scope="module")
def folders(shared, tmp_path_factory) -> list[Path]:
    """The folders of both robots, with our answers."""
    pytest.importorskip("yaml")
    import planning_problems

    data = shared / "data" / "planning" / "motion_bench_maker"
    if not data.is_dir():
        pytest.skip(f"no planning problems at {data}")
    checker = Path(semfm_cli()).parent / "examples" / "check_problems"
    if not checker.is_file():
        pytest.skip(f"no {checker}: cargo build -p semfm-eval --example check_problems")
    cache = tmp_path_factory.mktemp("problems")
    planning_problems.unpack(data, cache, every=35)
    for robot in planning_problems.TIPS:
        with (cache / robot / "ours.jsonl").open("w") as lines:
            subprocess.run([checker, cache / robot], check=True, stdout=lines)
    return [cache / robot for robot in planning_problems.TIPS]


def test_problems_begin_and_end_free(folders):
    for folder in folders:
        lines = map(json.loads, (folder / "ours.jsonl").read_text().splitlines())
        states = {(line["problem"], line["state"]): line for line in lines}
        assert len(states) == 3 * 20
        ends = {key: line for key, line in states.items() if key[1] != "middle"}
        assert all(line["free"] for line in ends.values())
        assert all(line["free"] == (not line["contacts"]) for line in states.values())
        middles = [line["free"] for key, line in states.items() if key[1] == "middle"]
        assert any(middles) and not all(middles)


def test_an_independent_checker_agrees(folders):
    pytest.importorskip("pinocchio")
    import planning_problems

    planning_problems.judge(folders)
    for folder in folders:
        ours, theirs = (
            planning_problems.answers(folder / name) for name in ("ours.jsonl", "coal.jsonl")
        )
        different = [key for key in theirs if ours[key]["free"] != theirs[key]["free"]]
        assert not different
