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
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from contextlib import suppress
from functools import partial
from importlib import import_module
from multiprocessing import get_context
from multiprocessing.connection import Connection, wait
from multiprocessing.reduction import ForkingPickler
from threading import Thread
from types import TracebackType
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:  # a process is begun before it is loaded
    import numpy as np

_PROGRAM = (
    "import sys; sys.path[:] = sys.argv[3:]; from wavesim.worker import serve; "
    "serve(int(sys.argv[1]), int(sys.argv[2]))"
)


# In a worker: the file that holds what it shares with the run.
_shared = -1
# Process ids of the workers of this process.
_RUNNING: set[int] = set()


def cores() -> int:
    """Cores that this process may use, of a machine that may have more."""
    known = getattr(os, "sched_getaffinity", None)
    return len(known(0)) if known else os.cpu_count() or 1


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
        # Whether something went wrong, and what that was or else what was returned.
        self.told: Future[tuple[bool, Any]] = Future()
        self._pickled = pickled

    def wait(self) -> None:
        """Wait until it is there, well or not."""
        self.told.exception()

    def result(self, timeout: float | None = None) -> Any:
        """What the function returned.

        It is unpickled by who asks, not by the thread that listens: two threads that import what it
        is made of, each a part, may find modules half made.

        Args:
            timeout: longest to wait, s; no end where None.

        Raises:
            TimeoutError: it is not there yet.
            MemoryError: the system ended the fork, or the worker.
            Exception: what the function raised.
        """
        wrong, told = self.told.result(timeout)
        found = pickle.loads(told) if self._pickled else told
        if wrong:
            raise found
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
        # While it works by itself it takes nothing, and what is large waits to be taken.
        self._sender = ThreadPoolExecutor(1)
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
        self._sender.shutdown()
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

    def ask(self, function: str, *arguments: Any) -> Answer:
        """Have a function called by a fork; of forks as many work at once as there are cores."""
        return self._ask(False, function, arguments)

    def prepare(self, function: str, *arguments: Any) -> Answer:
        """Have one called by the process itself, as to load what its forks need; returns None."""
        return self._ask(True, function, arguments)

    def _ask(self, itself: bool, function: str, arguments: tuple[Any, ...]) -> Answer:
        answer = Answer()
        self._asked.append(answer)
        told = ForkingPickler.dumps((len(self._asked) - 1, itself, function, arguments))
        self._sender.submit(self._send, told, answer)
        return answer

    def _send(self, told: memoryview, answer: Answer) -> None:
        try:
            self._line.send_bytes(told)
        except OSError:  # it has ended
            self._listener.join()
            if not answer.told.done():
                answer.told.set_exception(self._gone())

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

    def ask(self, function: str, *arguments: Any) -> Answer:
        """As of a worker."""
        answer = Answer(pickled=False)
        try:
            answer.told.set_result((False, _named(function)(*arguments)))
        except Exception as error:
            answer.told.set_result((True, error))
        return answer


def _memory() -> int:
    """A file in memory, without a name, which so leaves nothing behind."""
    if hasattr(os, "memfd_create"):
        return os.memfd_create("wavesim")
    with tempfile.TemporaryFile() as file:
        return os.dup(file.fileno())


def _named(function: str) -> Callable[..., Any]:
    """A function by its full name."""
    module, _, attribute = function.rpartition(".")
    return getattr(import_module(module), attribute)


def _ended(what: str, code: int | None) -> Exception:
    kind = MemoryError if code == -signal.SIGKILL else RuntimeError
    return kind(f"{what} ended with code {code}")


class _Fork:
    """A fork at work, and the end of a pipe with its answer."""

    def __init__(self, number: int, work: Callable[[], Any], line: Connection) -> None:
        forking = get_context("fork")
        self.number = number
        self.answer, theirs = forking.Pipe(duplex=False)
        self._process = forking.Process(target=_work, args=(work, theirs, line))
        self._process.start()
        theirs.close()

    def result(self) -> tuple[bool, bytes]:
        """Whether it went wrong, and what it returned or raised, pickled."""
        told = None
        with self.answer, suppress(EOFError, OSError):  # ended, or while it told
            told = self.answer.recv()
        self._process.join()
        if told is None:
            return True, _pickled(_ended("a process that draws or solves", self._process.exitcode))
        return told


def _pickled(what: Any) -> bytes:
    return pickle.dumps(what, pickle.HIGHEST_PROTOCOL)


def _told(work: Callable[..., Any], *arguments: Any) -> tuple[bool, bytes]:
    """What comes of work, as :meth:`_Fork.result` has it."""
    try:
        return False, _pickled(work(*arguments))
    except Exception as error:
        error.add_note(traceback.format_exc())
        return True, _pickled(error)


def _work(work: Callable[[], Any], answer: Connection, line: Connection) -> None:
    line.close()  # the run must see it end with the process alone
    answer.send(_told(work))


def serve(descriptor: int, shared: int) -> None:
    """What the process does: fork for each job, and tell what came of them."""
    global _shared
    _shared = shared
    line = Connection(descriptor)
    waiting: deque[tuple[int, Callable[[], Any]]] = deque()
    running: dict[Connection, _Fork] = {}
    gc.disable()  # what it loads stays, and what it makes is forked

    def begin(number: int, itself: bool, function: str, arguments: tuple[Any, ...]) -> None:
        work = partial(_named(function), *arguments)
        if itself:
            work()
        else:
            waiting.append((number, work))

    while True:
        while waiting and len(running) < cores():
            fork = _Fork(*waiting.popleft(), line)
            running[fork.answer] = fork
        for ready in wait([line, *running]):
            if ready is not line:
                assert isinstance(ready, Connection)
                fork = running.pop(ready)
                line.send((fork.number, fork.result()))
                continue
            try:
                number, itself, function, arguments = line.recv()
            except (EOFError, OSError):
                # The run ended before; forks at work on it end too.
                os.killpg(os.getpgid(0), signal.SIGKILL)
            wrong, told = _told(begin, number, itself, function, arguments)
            if itself or wrong:
                line.send((number, (wrong, told)))
