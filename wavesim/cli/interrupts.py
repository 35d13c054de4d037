"""Ctrl-C and SIGTERM: a command ends at once, with one line and exit code 130, whatever it is at.

Python hands a signal to the main thread alone, when that is done with what it is at, which may be a
minute in a compiler; an exception raised there may be dropped in a callback, or told as an error of
whatever was half done. So here the signal itself wakes a thread, and that ends the process: files
are whole at any instant, and processes beside it are ended first. Imports nothing, to be in place
before anything else is.
"""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from threading import Thread, current_thread, main_thread
from typing import Any

INTERRUPTED = 130

_SIGNALS = (signal.SIGINT, signal.SIGTERM, signal.SIGHUP)
_said: list[Callable[[], str]] = []


@contextmanager
def farewell(told: Callable[[], str]) -> Iterator[None]:
    """What is said of an interrupt while this lasts.

    Args:
        told: gives what is stored and how to go on, "" where nothing is; must not wait for
            anything.
    """
    _said.append(told)
    try:
        yield
    finally:
        _said.remove(told)


def install() -> None:
    """Have signals end this process from now on."""
    if current_thread() is not main_thread():
        return
    listen, speak = os.pipe()
    os.set_blocking(speak, False)
    # First, so that no signal comes between: one that does is heard once the thread runs.
    signal.set_wakeup_fd(speak, warn_on_full_buffer=False)
    for number in _SIGNALS:
        # A terminal that is gone is ignored where nohup says so; who sends the others means it.
        if number != signal.SIGHUP or signal.getsignal(number) is not signal.SIG_IGN:
            signal.signal(number, _nothing)
    Thread(target=_listen, args=(listen, os.getpid()), daemon=True).start()


def _nothing(number: int, frame: Any) -> None:
    """The thread has heard it too."""


def _listen(listen: int, process: int) -> None:
    while True:
        heard = os.read(listen, 1)
        if os.getpid() == process and heard and heard[0] in _SIGNALS:
            end()


def end() -> None:
    """End the process, and what runs beside it."""
    text = "interrupted"
    with suppress(Exception):
        beside = sys.modules.get("wavesim.worker")
        if beside is not None:
            beside.end_all()
    with suppress(Exception):
        beside = sys.modules.get("multiprocessing")  # of a sweep
        if beside is not None:
            for child in beside.active_children():
                child.kill()
    with suppress(Exception):
        more = _said[-1]() if _said else ""
        text = f"{text}; {more}" if more else text
    with suppress(Exception):
        clear = (
            "\r\x1b[K\x1b[?25h" if sys.stderr.isatty() else ""
        )  # a progress bar, if there is one
        os.write(2, f"{clear}wavesim: {text}\n".encode())
    os._exit(INTERRUPTED)


_BY_NAME = "-m wavesim ", "-m wavesim.cli.main "
if os.path.basename(sys.argv[0]) == "wavesim" or any(
    named in " ".join([*sys.orig_argv, ""]) for named in _BY_NAME
):
    install()
