"""Figures drawn by processes of their own, while the run stores and measures.

Drawing takes as long as all else after the integration, and holds Python's lock throughout, so a
thread would not do. One process is begun at once, loads what drawing needs, and forks for each
thing that it is told to draw; it is a fresh one, as jax's threads do not survive a fork.
"""

from __future__ import annotations

import multiprocessing
import os
import pickle
import signal
import subprocess
import sys
import traceback
from collections.abc import Sequence
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from types import TracebackType
from typing import TYPE_CHECKING, Any

from wavesim.simulation.field import WHOLE, Field

if TYPE_CHECKING:  # what they need takes half a second to import
    from wavesim.readings.bar.reading import Reading
    from wavesim.verdict.endless import Held

_PROGRAM = (
    "import sys; sys.path[:] = sys.argv[1:]; from wavesim.figures.process import serve; serve()"
)


class FigureProcess:
    """A process that has drawn what it is told to; it ends where the ``with`` block does."""

    def __init__(self) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", _PROGRAM, *sys.path],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            start_new_session=True,  # an interrupt from the keyboard is the run's to deal with
        )

    def __enter__(self) -> FigureProcess:
        return self

    def __exit__(
        self, kind: type | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(ProcessLookupError):  # waited for before
            os.killpg(self._process.pid, signal.SIGKILL)  # it and those that draw
        self._process.communicate()

    def draw(
        self,
        folder: Path,
        field: Field,
        held: Sequence[Held] | Reading | None = None,
        share: slice = WHOLE,
    ) -> None:
        """Have drawn what shows the field, or else what shows the measurement.

        Args:
            folder: where to; made if need be.
            field: one whose arrays are read from a file when they are asked for.
            held: what was measured, beside the theory, of an endless bar or of one with layers or
                ends; None for the field's own figures.
            share: which of the figures, in their order.
        """
        self._send((folder, field, held, share))

    def wait(self) -> list[Path]:
        """Wait until all that was asked for is written; nothing can be asked for any more.

        Returns:
            The files.

        Raises:
            OSError: a file can't be written.
            MemoryError: the system ended the process.
            Exception: whatever else went wrong in the drawing.
        """
        assert self._process.stdout is not None
        self._send(None)
        try:
            answer = pickle.load(self._process.stdout)
        except EOFError:
            code = self._process.wait()
            kind = MemoryError if code == -signal.SIGKILL else RuntimeError
            raise kind(f"the process that draws figures ended with code {code}") from None
        if isinstance(answer, Exception):
            raise answer
        return list(answer)

    def _send(self, message: Any) -> None:
        assert self._process.stdin is not None
        try:
            pickle.dump(message, self._process.stdin, pickle.HIGHEST_PROTOCOL)
            self._process.stdin.flush()
        except BrokenPipeError:
            pass  # why it ended is told when its answer is read


def serve() -> None:
    """What the process does: load, have drawn, answer with the files or with what went wrong."""
    receive, answer = sys.stdin.buffer, sys.stdout.buffer
    sys.stdout = sys.stderr
    from wavesim.figures import field  # noqa: F401  those that draw find it loaded

    begun = []
    try:
        while (message := pickle.load(receive)) is not None:
            begun.append(_begin(message))
    except EOFError:
        return  # the run ended before
    made = [_end(process, theirs) for process, theirs in begun]
    wrong = [part for part in made if isinstance(part, Exception)]
    pickle.dump(wrong[0] if wrong else [path for part in made for path in part], answer)
    answer.flush()


def _begin(message: Any) -> tuple[Any, Connection]:
    """A process that draws what a message asks for, and the end of a pipe with its answer."""
    forking = multiprocessing.get_context("fork")
    ours, theirs = forking.Pipe(duplex=False)
    process = forking.Process(target=_answer, args=(message, theirs))
    process.start()
    theirs.close()
    return process, ours


def _end(process: Any, answer: Connection) -> Any:
    """The files that such a process has written, or what went wrong."""
    made = None
    with answer, suppress(EOFError):
        made = answer.recv()
    process.join()
    if made is None:
        kind = MemoryError if process.exitcode == -signal.SIGKILL else RuntimeError
        return kind(f"a process that draws figures ended with code {process.exitcode}")
    return made


def _answer(message: Any, answer: Connection) -> None:
    try:
        answer.send(_drawn(*message))
    except Exception as error:
        error.add_note(traceback.format_exc())
        answer.send(error)


def _drawn(folder: Path, field: Field, held: Any, share: slice) -> list[Path]:
    from wavesim.figures.style import write

    if held is None:
        from wavesim.figures.field import of_field

        drawings = of_field(field)
    elif isinstance(held, list):
        from wavesim.figures.endless import of_measurement

        drawings = of_measurement(field, held)
    else:
        from wavesim.figures.bar import of_reading

        drawings = of_reading(field, held)
    return write(dict(list(drawings.items())[share]), folder)
