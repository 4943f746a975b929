"""One local worker: the child process, and the parent's handle of it.

Pickles of 8-byte length and body run over the child's standard input and output. The child is
started as a program of its own, so that nothing of the parent is imported again: scripts need no
``if __name__ == "__main__"``, and notebooks work.
"""

from __future__ import annotations

import os
import pickle
import signal
import subprocess
import sys
import threading
from contextlib import suppress
from typing import IO, Any, Optional

from ..errors import SemfmError
from .manifest import Row
from .record import Record

_START = "import sys; sys.path[:] = {path!r}; from semfm.batch.worker import serve; serve()"


class WorkerDied(Exception):
    """The child is gone without an answer."""


class Worker:
    """A child process that answers one row at a time.

    Parameters
    ----------
    demonstration : bytes
        A pickled `Demonstration`.
    threads : int
        Threads of its own.

    Raises
    ------
    SemfmError
        It does not come up (code ``"worker-start"``).
    """

    def __init__(self, demonstration: bytes, threads: int) -> None:
        # A group of its own: Ctrl-C reaches the parent only, which then ends its workers.
        own_group: dict[str, Any] = (
            {"creationflags": subprocess.CREATE_NEW_PROCESS_GROUP}  # type: ignore[attr-defined]
            if sys.platform == "win32"
            else {"start_new_session": True}
        )
        path = [os.getcwd() if entry == "" else entry for entry in sys.path]
        self._process = subprocess.Popen(
            [sys.executable, "-c", _START.format(path=path)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            **own_group,
        )
        self.timed_out = False
        try:
            self._send(threads)
            self._send_bytes(demonstration)
            ready = self._receive()
        except WorkerDied as error:
            self.kill()
            raise SemfmError(f"a worker did not start: {error}", code="worker-start") from error
        if ready != "ready":
            self.kill()
            raise SemfmError(f"a worker did not start: {ready}", code="worker-start")

    @property
    def pid(self) -> int:
        """The child's process id."""
        return self._process.pid

    def ask(self, row: Row, timeout_s: Optional[float] = None) -> Record:
        """The record of a row; after `timeout_s` the child is killed and `timed_out` is true.

        Raises
        ------
        WorkerDied
        """
        if timeout_s is None:
            self._send(row)
            return self._receive()
        watch = threading.Timer(timeout_s, self._time_out)
        watch.daemon = True
        watch.start()
        try:
            self._send(row)
            return self._receive()
        finally:
            watch.cancel()

    def kill(self) -> None:
        """Ends the child at once; a call that waits on it in another thread then fails."""
        with suppress(OSError):
            self._process.kill()

    def close(self) -> None:
        """Ends the child and waits until it is gone."""
        self.kill()
        self._process.wait()
        for pipe in (self._process.stdin, self._process.stdout):
            with suppress(OSError):
                if pipe is not None:
                    pipe.close()

    def _time_out(self) -> None:
        self.timed_out = True
        self.kill()

    def _send(self, message: Any) -> None:
        self._send_bytes(pickle.dumps(message))

    def _send_bytes(self, body: bytes) -> None:
        assert self._process.stdin is not None
        try:
            _put(self._process.stdin, body)
        except OSError as error:
            raise WorkerDied(self._end()) from error

    def _receive(self) -> Any:
        assert self._process.stdout is not None
        try:
            return pickle.loads(_take(self._process.stdout))
        except (EOFError, OSError, ValueError) as error:
            raise WorkerDied(self._end()) from error

    def _end(self) -> str:
        self.kill()
        status = self._process.wait()
        if status >= 0:
            return f"it ended with status {status}"
        try:
            return f"it was ended by {signal.Signals(-status).name}"
        except ValueError:
            return f"it was ended by signal {-status}"


def serve() -> None:
    """The child: answers rows until its input ends."""
    # What libraries print must not get between the answers.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    rows = sys.stdin.buffer
    try:
        threads = pickle.loads(_take(rows))
        body = _take(rows)
        from .. import set_num_threads

        set_num_threads(threads)
        demonstration = pickle.loads(body)
    except EOFError:
        return
    except Exception as error:
        _put(answers, pickle.dumps(f"{type(error).__name__}: {error}"))
        return
    # The parent may end at any time; nothing reads the answer then.
    with suppress(EOFError, BrokenPipeError):
        _put(answers, pickle.dumps("ready"))
        while True:
            row = pickle.loads(_take(rows))
            _put(answers, pickle.dumps(demonstration.transfer(row)))


def _put(pipe: IO[bytes], body: bytes) -> None:
    pipe.write(len(body).to_bytes(8, "little"))
    pipe.write(body)
    pipe.flush()


def _take(pipe: IO[bytes]) -> bytes:
    size = _exactly(pipe, 8)
    return _exactly(pipe, int.from_bytes(size, "little"))


def _exactly(pipe: IO[bytes], size: int) -> bytes:
    body = pipe.read(size)
    if len(body) != size:
        raise EOFError
    return body
