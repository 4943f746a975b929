"""The notebook is its script's, and runs from top to bottom with all its pictures."""

from __future__ import annotations

import base64
import io
import json
import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((ROOT / "notebooks").glob("*.ipynb"))
sys.path.insert(0, str(ROOT / "tools"))

from notebook import notebook_of, run  # noqa: E402


def pictures(notebook):
    for cell in notebook["cells"]:
        for output in cell.get("outputs", []):
            if "image/png" in output.get("data", {}):
                yield "".join(output["data"]["image/png"])


def drawn(notebook):
    return sum("".join(cell["source"]).count("plt.show()") for cell in notebook["cells"])


def test_notebooks_are_those_of_their_scripts():
    assert NOTEBOOKS
    check = [sys.executable, str(ROOT / "tools/notebook.py"), "--check"]
    result = subprocess.run(check, capture_output=True, text=True)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_kept_pictures_are_whole_and_small(path):
    image = pytest.importorskip("PIL.Image")
    notebook = json.loads(path.read_text(encoding="utf-8"))
    found = list(pictures(notebook))
    assert len(found) == drawn(notebook) > 0
    for picture in found:
        assert min(image.open(io.BytesIO(base64.b64decode(picture))).size) > 100
    assert path.stat().st_size < 1_500_000


@pytest.mark.full
@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_notebooks_run_from_top_to_bottom(path):
    pytest.importorskip("nbclient")
    pytest.importorskip("ipykernel")
    done = run(notebook_of(path.with_suffix(".py").read_text(encoding="utf-8")))
    assert len(list(pictures(done))) == drawn(done)
    told = "".join(
        "".join(output.get("text", ""))
        for cell in done["cells"]
        for output in cell.get("outputs", [])
    )
    overlap = float(told.split("(IoU): ")[1].split()[0])
    assert overlap > 0.5, told
