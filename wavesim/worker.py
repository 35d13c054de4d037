"""A process beside the run, which forks for each thing that it is told to do.

What holds Python's lock throughout, as drawing does, or could be done while this process compiles,
as exact solutions, is done there: a thread would not do. It is a fresh process, as jax's threads
do not survive a fork, and loads once what its forks need. Knows nothing of what it does.
"""

from __future__ import annotations

import gc
import math
import mmap
import os
import pickle
import signal
import socket
import subprocess
import sys
import tempfile
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
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # a process is begun before it is loaded
    import numpy as np

Job = Callable[[], Any]
# Whether something went wrong, and what that was or else each answer, pickled.
Told = tuple[bool, list[bytes]]

_PROGRAM = (
    "import sys; sys.path[:] = sys.argv[3:]; from wavesim.worker import serve; "
    "serve(int(sys.argv[1]), int(sys.argv[2]))"
)


# In a worker: the file that holds what it shares with the run.
_shared = -1
# Process ids of the workers of this process.
_RUNNING: set[int] = set()


def end_all() -> None:
    """End all workers of this process, and their forks, at once."""
    for number in list(_RUNNING):
        with suppress(ProcessLookupError, PermissionError):
            os.killpg(number, signal.SIGKILL)


class SharedArray:
    """An array of floats that a worker sees too: it travels there as no more than its place.

    Args:
        values: the array.
        place: where it begins in what is shared, bytes.
    """

    def __init__(self, values: np.ndarray, place: int) -> None:
        self._values, self._place = values, place

    def __getitem__(self, key: Any) -> np.ndarray:
        return self._values[key]

    def __setitem__(self, key: Any, values: Any) -> None:
        self._values[key] = values

    def freeze(self) -> None:
        """From here on nothing is written into it."""
        self._values.flags.writeable = False

    def __array__(self, dtype: Any = None, copy: Any = None) -> np.ndarray:
        return self._values.__array__(dtype, copy=copy)

    def __reduce__(self) -> tuple[Any, ...]:
        return _seen_by_worker, (self._place, self._values.shape)


def _mapped(file: int, place: int, shape: tuple[int, ...], access: int) -> np.ndarray:
    import numpy as np

    size = max(8 * math.prod(shape), 1)
    seen = mmap.mmap(file, size, access=access, offset=place)
    return np.frombuffer(seen, count=math.prod(shape)).reshape(shape)


def _seen_by_worker(place: int, shape: tuple[int, ...]) -> SharedArray:
    return SharedArray(_mapped(_shared, place, shape, mmap.ACCESS_READ), place)


class Answer:
    """What a worker was asked for, once it is there."""

    def __init__(self, pickled: bool = True) -> None:
        self.told: Future[Any] = Future()
        self._pickled = pickled

    def wait(self) -> None:
        """Wait until it is there, well or not."""
        self.told.exception()

    def result(self, timeout: float | None = None) -> list[Any]:
        """What the jobs returned, in their order.

        It is unpickled by who asks, not by the thread that listens: two threads that import what it
        is made of, each a part, may find modules half made.

        Args:
            timeout: longest to wait, s; no end where None.

        Raises:
            TimeoutError: it is not there yet.
            MemoryError: the system ended a fork, or the worker.
            Exception: what a job, or what makes them, raised.
        """
        wrong, parts = self.told.result(timeout)
        found = [pickle.loads(part) for part in parts] if self._pickled else parts
        if wrong:
            raise found[0]
        return found


class Worker:
    """Such a process; it and all that it does end where the ``with`` block does."""

    def __init__(self) -> None:
        here, there = socket.socketpair()
        self._memory = _memory()
        self._taken = 0
        given = [there.fileno(), self._memory]
        with there:
            self._process = subprocess.Popen(
                [sys.executable, "-c", _PROGRAM, *map(str, given), *sys.path],
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                # What goes wrong there is told by an answer.
                stderr=None if os.environ.get("WAVESIM_TRACEBACK") else subprocess.DEVNULL,
                pass_fds=given,
                start_new_session=True,  # an interrupt from the keyboard is the run's to deal with
            )
        _RUNNING.add(self._process.pid)
        self._line = Connection(here.detach())
        self._asked: list[Answer] = []
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
        _RUNNING.discard(self._process.pid)
        self._listener.join()
        self._line.close()
        os.close(self._memory)  # arrays in it stay as long as anyone holds them

    def array(self, shape: tuple[int, ...]) -> SharedArray:
        """A new array of zeros that the worker sees too.

        Raises:
            OSError: there is no room for it.
        """
        place, size = self._taken, 8 * math.prod(shape)
        self._taken += -(-size // mmap.ALLOCATIONGRANULARITY) * mmap.ALLOCATIONGRANULARITY
        os.ftruncate(self._memory, self._taken)
        return SharedArray(_mapped(self._memory, place, shape, mmap.ACCESS_WRITE), place)

    def each(self, jobs: str, *arguments: Any) -> Answer:
        """Have jobs done, each by a fork, as many at once as there are cores.

        Args:
            jobs: full name of the function that returns them, which is called there.
            arguments: of it.

        Returns:
            The answer to come: what each returns.
        """
        return self._ask(("each", jobs, arguments))

    def one(self, function: str, *arguments: Any) -> Answer:
        """Have one thing done by a fork; arguments as of :meth:`each`, a list of one answer."""
        return self._ask(("one", function, arguments))

    def prepare(self, function: str, *arguments: Any) -> Answer:
        """Have something done by the process itself, as to load what its forks need; no answer."""
        return self._ask(("prepare", function, arguments))

    def _ask(self, question: tuple[str, str, Sequence[Any]]) -> Answer:
        answer = Answer()
        self._asked.append(answer)
        try:
            self._line.send((len(self._asked) - 1, *question))
        except (BrokenPipeError, ConnectionResetError):
            self._listener.join()
            if not answer.told.done():
                answer.told.set_exception(self._gone())
        return answer

    def _gone(self) -> Exception:
        return _ended("the process beside the run", self._process.wait())

    def _listen(self) -> None:
        try:
            while True:
                number, told = self._line.recv()
                self._asked[number].told.set_result(told)
        except (EOFError, OSError):
            pass
        for answer in self._asked:
            if not answer.told.done():
                answer.told.set_exception(self._gone())


class Here:
    """In place of a worker: does what it is told at once, in this process, which alone knows it."""

    def array(self, shape: tuple[int, ...]) -> SharedArray:
        """As of a worker, of this process's own memory."""
        import numpy as np

        return SharedArray(np.zeros(shape), 0)

    def each(self, jobs: str, *arguments: Any) -> Answer:
        """As of a worker."""
        return self._done("each", jobs, arguments)

    def one(self, function: str, *arguments: Any) -> Answer:
        """As of a worker."""
        return self._done("one", function, arguments)

    def _done(self, how: str, name: str, arguments: Sequence[Any]) -> Answer:
        answer = Answer(pickled=False)
        try:
            answer.told.set_result((False, [job() for job in _jobs(how, name, arguments)]))
        except Exception as error:
            answer.told.set_result((True, [error]))
        return answer


def _memory() -> int:
    """A file in memory, without a name, which so leaves nothing behind."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("wavesim")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


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

    def result(self) -> tuple[bool, bytes]:
        """Whether it went wrong, and what it returned or raised, pickled."""
        told = None
        with self.answer, suppress(EOFError):
            told = self.answer.recv()
        self._process.join()
        if told is None:
            return True, _pickled(_ended("a process that draws or solves", self._process.exitcode))
        return told


def _pickled(what: Any) -> bytes:
    return pickle.dumps(what, pickle.HIGHEST_PROTOCOL)


def _wrong(error: Exception) -> bytes:
    error.add_note(traceback.format_exc())
    return _pickled(error)


def _work(job: Job, answer: Connection, line: Connection) -> None:
    line.close()  # the run must see it end with the process alone
    try:
        answer.send((False, _pickled(job())))
    except Exception as error:
        answer.send((True, _wrong(error)))


def serve(descriptor: int, shared: int) -> None:
    """What the process does: fork for each job, and tell what came of them.

    Args:
        descriptor: of the line to the run.
        shared: of the file that holds what both see.
    """
    global _shared
    _shared = shared
    line = Connection(descriptor)
    waiting: deque[tuple[int, int, Job]] = deque()
    running: dict[Connection, tuple[int, int, _Fork]] = {}
    answers: dict[int, dict[int, bytes]] = {}
    wanted: dict[int, int] = {}
    gc.disable()  # what it loads stays, and what it makes is forked

    def tell_if_done(number: int) -> None:
        if len(answers[number]) == wanted[number]:
            found = answers.pop(number)
            line.send((number, (False, [found[place] for place in sorted(found)])))

    while True:
        while waiting and len(running) < (os.cpu_count() or 1):
            number, place, job = waiting.popleft()
            fork = _Fork(job, line)
            running[fork.answer] = number, place, fork
        for ready in wait([line, *running]):
            if ready is line:
                try:
                    number, *question = line.recv()
                except (EOFError, OSError):
                    # The run ended before; forks at work on it end too.
                    os.killpg(os.getpgid(0), signal.SIGKILL)
                try:
                    made = _jobs(*question)
                except Exception as error:
                    line.send((number, (True, [_wrong(error)])))
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
                line.send((number, (True, [answer])))
            else:
                answers[number][place] = answer
                tell_if_done(number)
