"""One demonstration onto a whole library of objects.

A manifest names the targets, a folder takes the answers::

    import semfm.batch

    summary = semfm.batch.transfer(
        "mug.obj", "grip.json", "library.csv", "answers", workers=8, progress=True)
    print(summary.n_done, "of", summary.n_rows, summary.verdicts)
    for record in semfm.batch.records("answers"):
        if record["verdict"] == "accept":
            region = semfm.batch.region_of(record)

`manifest` reads what is asked, `task` answers one row, `pool` and `ray_runner` spread the rows over
processes and machines, `journal` keeps the answers in `shards`, and `library` joins them. The same
from the shell: ``python -m semfm.batch --help``.
"""

from .journal import records
from .library import Summary, transfer
from .manifest import Row, read_manifest
from .record import region_of
from .task import Demonstration

__all__ = [
    "Demonstration",
    "Row",
    "Summary",
    "read_manifest",
    "records",
    "region_of",
    "transfer",
]
