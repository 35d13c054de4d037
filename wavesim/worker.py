"""A process beside the run, which forks for each thing that it is told to do.

What holds Python's lock throughout, as drawing does, or could be done while this process compiles,
as exact solutions, is done there: a thread would not do. It is a fresh process, as jax's threads
do not survive a fork, and loads once what its forks need. Knows nothing of what it does.
"""

from __future__ import annotations

import gc
import os
import signal
import socket
import subprocess
import sys
import traceback
from collections import deque
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from contextlib import suppress
from functools import partial
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from threading import Thread
from types import TracebackType
from typing import Any

Job = Callable[[], Any]

_PROGRAM = (
    "import sys; sys.path[:] = sys.argv[2:]; from wavesim.worker import serve; "
    "serve(int(sys.argv[1]))"
)


class Worker:
    """Such a process; it and all that it does end where the ``with`` block does."""

    def __init__(self) -> None:
        here, there = socket.socketpair()
        with there:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM, str(there.fileno()), *sys.path],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                pass_fds=[there.fileno()],
                start_new_session=True,  # an interrupt from the keyboard is the run's to deal with
            )
        self._line = Connection(here.detach())
        self._asked: list[Future[Any]] = []
        self._listener = Thread(target=self._listen, daemon=True)
        self._listener.start()

    def __enter__(self) -> Worker:
        return self

    def __exit__(
        self, kind: type | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        with suppress(ProcessLookupError):  # waited for before
            os.killpg(self._process.pid, signal.SIGKILL)  # it and its forks
        self._process.wait()
        self._listener.join()
        self._line.close()

    def each(self, jobs: str, *arguments: Any) -> Future[list[Any]]:
        """Have jobs done, each by a fork, as many at once as there are cores.

        Args:
            jobs: full name of the function that returns them, which is called there.
            arguments: of it.

        Returns:
            What they return, in their order. It raises what one of them or their maker raises;
            MemoryError where the system ended one, or the process.
        """
        return self._ask(("each", jobs, arguments))

    def one(self, function: str, *arguments: Any) -> Future[list[Any]]:
        """Have one thing done by a fork; arguments as of :meth:`each`, a list of one answer."""
        return self._ask(("one", function, arguments))

    def prepare(self, function: str, *arguments: Any) -> Future[list[Any]]:
        """Have something done by the process itself, as to load what its forks need; no answer."""
        return self._ask(("prepare", function, arguments))

    def _ask(self, question: tuple[str, str, Sequence[Any]]) -> Future[list[Any]]:
        future: Future[list[Any]] = Future()
        self._asked.append(future)
        try:
            self._line.send((len(self._asked) - 1, *question))
        except (BrokenPipeError, ConnectionResetError):
            self._listener.join()
            if not future.done():
                future.set_exception(self._gone())
        return future

    def _gone(self) -> Exception:
        return _ended("the process beside the run", self._process.wait())

    def _listen(self) -> None:
        try:
            while True:
                number, wrong, answer = self._line.recv()
                future = self._asked[number]
                if wrong:
                    future.set_exception(answer)
                else:
                    future.set_result(answer)
        except (EOFError, OSError):
            pass
        for future in self._asked:
            if not future.done():
                future.set_exception(self._gone())


def _jobs(how: str, name: str, arguments: Sequence[Any]) -> list[Job]:
    """What is to be forked for, by the full name of a function."""
    module, _, attribute = name.rpartition(".")
    function = getattr(import_module(module), attribute)
    if how == "one":
        return [partial(function, *arguments)]
    made = function(*arguments)
    return list(made) if how == "each" else []


def _ended(what: str, code: int | None) -> Exception:
    kind = MemoryError if code == -signal.SIGKILL else RuntimeError
    return kind(f"{what} ended with code {code}")


class _Fork:
    """A fork at work on a job, and the end of a pipe with its answer."""

    def __init__(self, job: Job, line: Connection) -> None:
        forking = get_context("fork")
        self.answer, theirs = forking.Pipe(duplex=False)
        self._process = forking.Process(target=_work, args=(job, theirs, line))
        self._process.start()
        theirs.close()

    def result(self) -> tuple[bool, Any]:
        """Whether it went wrong, and what it returned or raised."""
        made = None
        with self.answer, suppress(EOFError):
            made = self.answer.recv()
        self._process.join()
        if made is None:
            return True, _ended("a process that draws or solves", self._process.exitcode)
        return made


def _work(job: Job, answer: Connection, line: Connection) -> None:
    line.close()  # the run must see it end with the process alone
    try:
        answer.send((False, job()))
    except Exception as error:
        error.add_note(traceback.format_exc())
        answer.send((True, error))


def serve(descriptor: int) -> None:
    """What the process does: fork for each job, and tell what came of them."""
    line = Connection(descriptor)
    waiting: deque[tuple[int, int, Job]] = deque()
    running: dict[Connection, tuple[int, int, _Fork]] = {}
    answers: dict[int, dict[int, Any]] = {}
    wanted: dict[int, int] = {}
    gc.disable()  # what it loads stays, and what it makes is forked

    def tell_if_done(number: int) -> None:
        if len(answers[number]) == wanted[number]:
            found = answers.pop(number)
            line.send((number, False, [found[place] for place in sorted(found)]))

    while True:
        while waiting and len(running) < (os.cpu_count() or 1):
            number, place, job = waiting.popleft()
            fork = _Fork(job, line)
            running[fork.answer] = number, place, fork
        for ready in wait([line, *running]):
            if ready is line:
                try:
                    number, *question = line.recv()
                except EOFError:
                    return  # the run ended before
                try:
                    made = _jobs(*question)
                except Exception as error:
                    error.add_note(traceback.format_exc())
                    line.send((number, True, error))
                    continue
                wanted[number], answers[number] = len(made), {}
                waiting.extend((number, place, job) for place, job in enumerate(made))
                tell_if_done(number)
                continue
            assert isinstance(ready, Connection)
            number, place, fork = running.pop(ready)
            wrong, answer = fork.result()
            if number not in answers:
                continue  # of several that go wrong the first is told
            if wrong:
                del answers[number]
                line.send((number, True, answer))
            else:
                answers[number][place] = answer
                tell_if_done(number)
