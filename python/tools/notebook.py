"""Makes the notebooks of `python/notebooks` from the scripts beside them, and runs them.

    pip install --group notebook .
    python python/tools/notebook.py            # writes each notebook with its pictures
    python python/tools/notebook.py --check    # fails where a notebook is not its script's
    python python/tools/notebook.py --run      # runs each from top to bottom and writes nothing

A script is Python with `# %%` before each cell and `# %% [markdown]` before each text.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from typing import Any

FOLDER = Path(__file__).resolve().parents[1] / "notebooks"
TIMEOUT_S = 600


def cells_of(script: str) -> list[dict[str, Any]]:
    """The cells of a script, as a notebook keeps them."""
    cells = []
    for number, part in enumerate(script.split("# %%")[1:]):
        kind, _, body = part.partition("\n")
        body = body.strip("\n")
        cell: dict[str, Any] = {"id": f"cell-{number}", "metadata": {}}
        if kind.strip() == "[markdown]":
            lines = [line[2:] if line.startswith("# ") else line[1:] for line in body.splitlines()]
            cell.update(cell_type="markdown", source="\n".join(lines))
        else:
            cell.update(cell_type="code", source=body, outputs=[], execution_count=None)
        cells.append(cell)
    return cells


def notebook_of(script: str) -> dict[str, Any]:
    """A notebook without outputs."""
    kernel = {"display_name": "Python 3", "language": "python", "name": "python3"}
    return {
        "cells": cells_of(script),
        "metadata": {"kernelspec": kernel, "language_info": {"name": "python"}},
        "nbformat": 4,
        "nbformat_minor": 5,
    }


def run(notebook: dict[str, Any]) -> Any:
    """The notebook with its outputs, from top to bottom in a kernel of its own."""
    import nbformat
    from nbclient import NotebookClient

    node = nbformat.from_dict(notebook)
    client = NotebookClient(node, timeout=TIMEOUT_S, record_timing=False)
    client.execute(cwd=str(FOLDER))
    return node


def sources(notebook: dict[str, Any]) -> list[tuple[str, str]]:
    """Kind and text of each cell."""
    joined = ("".join(cell["source"]) for cell in notebook["cells"])
    return [(cell["cell_type"], text) for cell, text in zip(notebook["cells"], joined)]


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--check", action="store_true", help="compare only")
    parser.add_argument("--run", action="store_true", help="run, write nothing")
    options = parser.parse_args()
    failed = False
    for path in sorted(FOLDER.glob("*.py")):
        made = notebook_of(path.read_text(encoding="utf-8"))
        file = path.with_suffix(".ipynb")
        if options.check:
            kept = json.loads(file.read_text(encoding="utf-8")) if file.exists() else {"cells": []}
            if sources(kept) != sources(made):
                failed = True
                print(
                    f"{file.name} is not what {path.name} makes: run {sys.argv[0]}", file=sys.stderr
                )
            continue
        done = run(made)
        if not options.run:
            text = json.dumps(done, indent=1, ensure_ascii=False, sort_keys=True)
            file.write_text(text + "\n", encoding="utf-8")
            print(f"wrote {file}")
    return int(failed)


if __name__ == "__main__":
    sys.exit(main())
