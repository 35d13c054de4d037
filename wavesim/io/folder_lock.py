"""One run a folder: a lock that tells who has it, and that no killed process keeps."""

from __future__ import annotations

import datetime
import errno
import fcntl
import os
import socket
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from wavesim.io.result_reader import StorageError

NAME = "run.lock"
# On some network file systems there are no locks: a run goes on without.
_NO_LOCKS = (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP)
_MOST_TOLD = 500


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Have a folder to oneself while this lasts. The system frees it whatever ends the process.

    Raises:
        StorageError: another run has it; the message says who, and since when.
        OSError: nothing can be written there.
    """
    path = folder / NAME
    while True:
        descriptor = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o666)
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError as error:
            who = os.read(descriptor, _MOST_TOLD).decode(errors="replace").strip()
            os.close(descriptor)
            if error.errno in _NO_LOCKS:
                yield
                return
            raise StorageError(
                f"{folder}: another run writes there ({who or 'it says not which'}); wait for it, "
                "or name another folder with --out"
            ) from None
        # Whoever had it may have taken its file away just before.
        with suppress(FileNotFoundError):
            if os.stat(path).st_ino == os.fstat(descriptor).st_ino:
                break
        os.close(descriptor)
    try:
        since = datetime.datetime.now().astimezone().isoformat(" ", "seconds")
        what = " ".join(Path(word).name for word in sys.argv[:3])[:100]
        text = f"process {os.getpid()} on {socket.gethostname()}, since {since}: {what}\n"
        with suppress(OSError):  # a full disk: the lock holds all the same
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, text.encode(), 0)
        yield
    finally:
        with suppress(OSError):
            path.unlink()
        os.close(descriptor)
