"""The command: one pair and many, exit codes, files, going on after an interrupt."""

from __future__ import annotations

import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from fake_endpoint import answer, hang, status
from mesh_views_builder import iou
from semfm.vlm import read_object, read_region
from semfm.vlm.cli import main
from vlm_fixtures import KEY

pytest.importorskip("openai")

EVERYTHING = [[[0, 0], [1000, 0], [1000, 1000], [0, 1000]]]


def says(polygons: list, n_views: int) -> str:
    views = [{"view": f"T{i}", "polygons": polygons} for i in range(1, n_views + 1)]
    return json.dumps({"views": views})


def one(mallets, *more: str) -> list[str]:
    short, long = mallets["short"], mallets["long"]
    return [str(short.views), str(long.views), "--region", str(short.region), *more]


def many(mallets, folder: Path, *more: str) -> list[str]:
    """Both directions; the pairs file lies where an evaluation folder has it."""
    path = mallets["short"].views.parent.parent / "pairs.json"
    path.write_text(json.dumps({"tools": [["short", "long"], ["long", "short"]]}))
    return ["--pairs", str(path), "-o", str(folder / "rows.json"), *more]


def rows_in(folder: Path) -> dict:
    return json.loads((folder / "rows.json").read_text())


@pytest.mark.parametrize("n_views, least", [(1, 0.3), (3, 0.9), (6, 0.93)])
@pytest.mark.parametrize("mode", ["polygons", "marks"])
def test_true_masks_reach_the_ceiling(mallets, tmp_path, n_views, least, mode):
    long = mallets["long"]
    args = one(mallets, "-o", str(tmp_path / "region.json"), "--truth", str(long.region))
    assert main([*args, "--views", str(n_views), "--mode", mode]) == 0
    target = read_object(long.views)
    region = read_region(tmp_path / "region.json", target)
    assert iou(region >= 0.5, long.inside) > least - (0.15 if mode == "marks" else 0)
    written = json.loads((tmp_path / "region.json").read_text())
    assert written["format"] == "semfm.region/1" and written["mesh"] == target.identity
    assert (written["method"], written["real_model"]) == ("vlm", False)


def test_a_model_that_marks_everything_gets_everything(endpoint, mallets, tmp_path, capsys):
    endpoint.acts = [says(EVERYTHING, 3)]
    output = tmp_path / "region.json"
    pictures = tmp_path / "pictures"
    more = ["-o", str(output), "--views", "3", "--pictures", str(pictures), "--json"]
    assert main(one(mallets, *more)) == 0
    captured = capsys.readouterr()
    row = json.loads(captured.out)
    assert row["tokens"] == {"prompt": 100, "completion": 20} and row["failure"] is None
    assert row["model"] == "simulated/fake" and row["inconsistency"] == 0
    assert row["region"]["weights"] == [1.0] * len(row["region"]["vertices"])
    assert set(row["stages_ms"]) == {"choose", "draw", "model", "wait", "lift"}
    assert row["region"]["vertices"] == json.loads(output.read_text())["vertices"]
    (body,) = endpoint.requests
    images = [part for part in body["messages"][1]["content"] if part["type"] == "image_url"]
    assert len(images) == 6
    names = {f"S{i}.png" for i in (1, 2, 3)} | {f"T{i}.png" for i in (1, 2, 3)}
    names |= {f"answer-T{i}.png" for i in (1, 2, 3)} | {"question.md", "reply.txt"}
    assert {path.name for path in pictures.iterdir()} == names


@pytest.mark.parametrize(
    "act, code, kind",
    [
        ("The handle is the long part.", 1, "prose"),
        (answer(None, refusal="I can't help."), 1, "refusal"),
        (says([], 2), 1, "empty"),
        (says(EVERYTHING, 1), 1, "schema"),
        (status(400, "no images here"), 2, "request"),
        (status(401), 2, "access"),
        (hang, 2, "timeout"),
    ],
)
def test_without_a_region_nothing_is_written(endpoint, mallets, tmp_path, capsys, act, code, kind):
    endpoint.acts = [act]
    more = ["-o", str(tmp_path / "r.json"), "--views", "2", "--timeout", "0.3", "--retries", "0"]
    assert main(one(mallets, *more, "--json")) == code
    captured = capsys.readouterr()
    assert kind in captured.err and KEY not in captured.err + captured.out
    failure = json.loads(captured.out)["failure"]
    assert failure["kind"] == kind and failure["of_endpoint"] == (code == 2)
    assert list(tmp_path.iterdir()) == []


def test_rows_of_many_pairs(mallets, tmp_path, capsys):
    more = ["--true-masks", "--views", "1,6", "--jobs", "2", "--json"]
    assert main(many(mallets, tmp_path, *more)) == 0
    totals = json.loads(capsys.readouterr().out)
    assert totals["rows"] == totals["regions"] == 4 and totals["failures"] == {}
    file = rows_in(tmp_path)
    assert file["format"] == "semfm.vlm/1"
    assert file["settings"]["endpoint"] == {"model": "simulated/true-masks"}
    names = [(row["source"], row["target"], row["n_views"]) for row in file["rows"]]
    assert names == [
        ("short", "long", 1),
        ("short", "long", 6),
        ("long", "short", 1),
        ("long", "short", 6),
    ]
    for row in file["rows"]:
        inside = np.zeros(row["mesh"]["n_vertices"], bool)
        inside[row["region"]["vertices"]] = True
        assert iou(inside, mallets[row["target"]].inside) > (0.3 if row["n_views"] == 1 else 0.9)
        assert row["group"] == "tools" and not row["real_model"]
        assert (row["inconsistency"] is None) == (row["n_views"] == 1)
        assert len(row["views"]["target"]) == row["n_views"]


def test_a_run_goes_on_where_it_stopped(endpoint, mallets, tmp_path, capsys):
    """Replies, unusable ones too, are not asked for again; what had no reply is."""
    arguments = many(mallets, tmp_path, "--views", "1,2", "--retries", "0")
    endpoint.acts = [says(EVERYTHING, 1), "prose", status(500), says(EVERYTHING, 2)]
    assert main(arguments) == 2
    assert "1 rows without a reply" in capsys.readouterr().err
    kinds = [(row["failure"] or {}).get("kind") for row in rows_in(tmp_path)["rows"]]
    assert kinds == [None, "prose", "server", None]
    assert rows_in(tmp_path)["rows"][1]["failure"]["text"] == "prose"
    endpoint.acts = [says(EVERYTHING, 1)]
    assert main(arguments) == 0
    assert len(endpoint.requests) == 5
    kinds = [(row["failure"] or {}).get("kind") for row in rows_in(tmp_path)["rows"]]
    assert kinds == [None, "prose", None, None]
    before = (tmp_path / "rows.json").read_bytes()
    assert main(arguments) == 0
    assert len(endpoint.requests) == 5 and (tmp_path / "rows.json").read_bytes() == before
    assert main([*arguments, "--threshold", "0.7"]) == 2
    assert "choose another -o" in capsys.readouterr().err


def test_kept_replies_are_not_paid_for_again(endpoint, mallets, tmp_path, capsys):
    endpoint.acts = [says(EVERYTHING, 1)]
    cache = tmp_path / "replies"
    assert main(many(mallets, tmp_path, "--views", "1", "--cache", str(cache))) == 0
    first = rows_in(tmp_path)["rows"]
    (tmp_path / "rows.json").unlink()
    capsys.readouterr()
    assert main(many(mallets, tmp_path, "--views", "1", "--cache", str(cache), "--json")) == 0
    assert len(endpoint.requests) == 2
    tokens = json.loads(capsys.readouterr().out)["tokens"]
    assert tokens == {"prompt": 0, "completion": 0, "kept": 240}
    for row, again in zip(first, rows_in(tmp_path)["rows"]):
        assert again["cached"] and again["region"] == row["region"]
        assert again["stages_ms"]["model"] == row["stages_ms"]["model"], "time of the real request"


def test_denied_access_ends_the_run_at_once_and_keeps_rows(endpoint, mallets, tmp_path, capsys):
    endpoint.acts = [says(EVERYTHING, 1), status(401, "expired")]
    assert main(many(mallets, tmp_path, "--views", "1,2")) == 2
    assert "expired" in capsys.readouterr().err
    assert len(endpoint.requests) == 2 and len(rows_in(tmp_path)["rows"]) == 1


def test_no_file_holds_the_key(endpoint, mallets, tmp_path, capfd):
    """Through the real program, with the client's own logging at its loudest."""
    endpoint.acts = [f"The key is {KEY}.", status(500, KEY), says(EVERYTHING, 1)]
    environment = {**os.environ, "OPENAI_LOG": "debug"}
    arguments = many(mallets, tmp_path, "--views", "1", "--cache", str(tmp_path / "replies"))
    arguments += ["--pictures", str(tmp_path / "pictures")]
    run = subprocess.run(
        [sys.executable, "-m", "semfm.vlm", *arguments],
        env=environment,
        capture_output=True,
        text=True,
        timeout=120,
    )
    assert run.returncode == 0, run.stderr
    assert "DEBUG" in run.stderr or "openai" in run.stderr, "the client did log"
    assert f"Bearer {KEY}" in endpoint.keys
    files = [path for path in tmp_path.rglob("*") if path.is_file()]
    assert len(files) > 8
    assert not [path for path in files if KEY.encode() in path.read_bytes()]
    assert KEY not in run.stdout + run.stderr


@pytest.mark.parametrize(
    "change, reason",
    [
        (["--views", "9"], "1 to 8 to be chosen, found 9"),
        (["--views", "six"], "--views"),
        (["--views", "1,3"], "one number for one pair"),
        (["--threshold", "0"], "threshold"),
        (["--temperature", "warm"], "--temperature"),
        (["--region", "nowhere.json"], "nowhere.json"),
        (["--base-url", "ftp://x"], "http"),
        (["--retries", "-1"], "attempts"),
    ],
)
def test_bad_input_is_named(endpoint, mallets, tmp_path, capsys, change, reason):
    assert main(one(mallets, "-o", str(tmp_path / "r.json"), *change)) == 2
    assert reason in capsys.readouterr().err
    assert endpoint.requests == []


@pytest.mark.parametrize(
    "pairs, reason",
    [
        ("{}", "at least one"),
        ('{"a": [["short"]]}', "two names"),
        ('{"a": [["../short", "long"]]}', "two names"),
        ('{"a": [["short", "axe"]]}', "axe: expected one label"),
        ('{"a": [["short", "long"], ["short", "long"]]}', "it twice"),
        ('[{"group": "a"}]', "texts under group"),
        (
            '[{"group": "a", "source": "s", "target": "t", "source_views": "x", '
            '"target_views": "x", "region": "x"}]',
            "the file",
        ),
        ("3", "groups of pairs"),
    ],
)
def test_bad_pairs_are_named(mallets, tmp_path, capsys, pairs, reason):
    path = mallets["short"].views.parent.parent / "bad.json"
    path.write_text(pairs)
    assert main(["--pairs", str(path), "-o", str(tmp_path / "r.json"), "--true-masks"]) == 2
    assert reason in capsys.readouterr().err


def test_a_list_of_pairs_names_its_files(mallets, tmp_path):
    short, long = mallets["short"], mallets["long"]
    entry = {
        "group": "g",
        "source": "a",
        "target": "b",
        "source_views": os.path.relpath(short.views, tmp_path),
        "target_views": str(long.views),
        "region": str(short.region),
        "truth": str(long.region),
    }
    (tmp_path / "pairs.json").write_text(json.dumps([entry]))
    arguments = ["--pairs", str(tmp_path / "pairs.json"), "-o", str(tmp_path / "rows.json")]
    assert main([*arguments, "--true-masks", "--views", "2"]) == 0
    (row,) = rows_in(tmp_path)["rows"]
    assert (row["group"], row["source"], row["target"]) == ("g", "a", "b") and row["region"]
