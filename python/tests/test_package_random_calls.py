"""The Python surface under random calls: an answer or an error of ours, whatever the arguments.

The calls are made in processes of their own with little memory, by `random_calls.py`: a process that dies
or does not come back tells its last call.
"""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

HERE = Path(__file__).parent
#: Calls in all, and by one process.
CALLS, EACH = int(os.environ.get("SEMFM_RANDOM_CALLS", "2000")), 250
#: Address space of a process: worker threads and OpenBLAS reserve some, and no call needs a gigabyte.
MEMORY = 6 << 30


def limit_memory() -> None:
    import resource

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


@pytest.mark.skipif(sys.platform != "linux", reason="SKIPPED: address space is limited on Linux alone")
@pytest.mark.parametrize("seed", range(CALLS // EACH))
def test_random_calls_give_an_answer_or_one_of_our_errors(seed, tmp_path):
    journal, folder = tmp_path / "journal.txt", tmp_path / "files"
    folder.mkdir()
    run = subprocess.run(
        [sys.executable, str(HERE / "random_calls.py"), str(seed), str(EACH), str(journal), str(folder)],
        capture_output=True,
        text=True,
        timeout=600,
        preexec_fn=limit_memory,
        env=dict(os.environ, OPENBLAS_NUM_THREADS="1", RAYON_NUM_THREADS="2"),
    )
    lines = journal.read_text("utf-8").splitlines() if journal.exists() else []
    assert run.returncode == 0, f"{run.returncode}: {lines[-2:]}\n{run.stderr[-3000:]}"
    answered = int(lines[-1].split()[0])
    assert answered > EACH // 5, f"only {answered} of {EACH} calls were answered: nothing was tried"
