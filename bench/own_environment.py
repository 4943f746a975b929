"""An environment for a program of this folder that needs packages which the project's own does not hold."""

from __future__ import annotations

import importlib.util
import os
import subprocess
import sys
import venv
from pathlib import Path


def enter(name: str, packages: dict[str, str]) -> None:
    """Goes on where every module of ``packages`` (module: what pip is asked for) can be imported; otherwise
    starts the program again in ``.venv-NAME`` beside this folder (or ``$SEMFM_BENCH_VENV``), which is made and
    filled where it has to be."""
    missing = [module for module in packages if not importlib.util.find_spec(module)]
    if not missing:
        return
    beside = Path(__file__).resolve().parent.parent
    folder = Path(os.environ.get("SEMFM_BENCH_VENV", beside / f".venv-{name}"))
    python = folder / ("Scripts/python.exe" if os.name == "nt" else "bin/python")
    if Path(sys.prefix) == folder:
        raise SystemExit(f"{folder} lacks {', '.join(missing)}: remove the folder and start again")
    if not python.exists():
        print(f"making {folder}", file=sys.stderr)
        venv.create(folder, with_pip=True)
    subprocess.run([python, "-m", "pip", "install", "--quiet", *packages.values()], check=True)
    raise SystemExit(subprocess.run([python, *sys.argv]).returncode)
