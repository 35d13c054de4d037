"""The parts of a run made into one file, while the run goes on to other things.

Packed chunks are copied as they are. The HDF5 library does not survive a disk that is full: it
writes into a file that takes everything, and says afterwards what went wrong.
"""

from __future__ import annotations

import io
import os
import threading
from collections.abc import Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from wavesim.io.packing import chunk_of, pack, packed_dataset
from wavesim.io.whole_files import LIBVER

# Frames of parts that are packed otherwise are read so many numbers at a time.
_AT_ONCE = 4_000_000


class Taking(io.FileIO):
    """A file that takes whatever is written, and keeps the first error to itself."""

    failed: OSError | None = None

    def write(self, data: Any) -> int:
        """All of the data, or none of it any more."""
        left = memoryview(data).cast("B")
        size = len(left)
        try:
            while self.failed is None and len(left):
                left = left[super().write(left) or 0 :]
        except OSError as error:
            self.failed = error
        if self.failed is not None:
            with suppress(OSError):
                self.seek(len(left), io.SEEK_CUR)
        return size

    def truncate(self, size: int | None = None) -> int:
        """As long as may be."""
        try:
            return super().truncate(size)
        except OSError as error:
            self.failed = self.failed or error
            return self.tell() if size is None else size


class Gathering:
    """Fields of the parts of a run on their way into the file that shall take its place.

    Args:
        path: of the file.
        points: {field: number of its points}.
        parts: (first frame, file) of each part, in order; its field is fields/NAME or NAME.
        tail: {field: frames after the last part}.
        frames: of all.
    """

    def __init__(
        self,
        path: Path,
        points: Mapping[str, int],
        parts: Sequence[tuple[int, Path]],
        tail: Mapping[str, np.ndarray],
        frames: int,
    ) -> None:
        self._path, self._temporary = path, path.with_name(path.name + ".tmp")
        self._points, self._parts, self._tail, self._frames = points, parts, tail, frames
        self._abandoned = threading.Event()
        self._raw = Taking(self._temporary, "w+")
        self._file = h5py.File(self._raw, "w", libver=LIBVER)
        self._keeper = ThreadPoolExecutor(1)
        self._done = self._keeper.submit(self._copy)

    @contextmanager
    def file(self) -> Iterator[h5py.File]:
        """The new file with all fields in it; afterwards it takes the place of the old one.

        Raises:
            OSError: it could not be written.
        """
        self._done.result()
        self._check()
        yield self._file
        self._file.close()
        self._check()
        self._raw.flush()
        self._raw.close()
        os.replace(self._temporary, self._path)

    def _check(self) -> None:
        if self._raw.failed is not None:
            raise self._raw.failed

    def abandon(self) -> None:
        """Stop, and leave nothing behind but what took the old file's place."""
        self._abandoned.set()
        self._keeper.shutdown()
        with suppress(OSError, RuntimeError, ValueError):
            self._file.close()
        self._raw.close()
        with suppress(OSError):
            self._temporary.unlink(missing_ok=True)

    def _copy(self) -> None:
        with ExitStack() as until_the_end:
            opened = [
                (first, until_the_end.enter_context(h5py.File(path, "r")))
                for first, path in self._parts
            ]
            for name, points in self._points.items():
                new = packed_dataset(self._file, f"fields/{name}", self._frames, points)
                end = 0
                for first, file in opened:
                    own = file[name] if name in file else file[f"fields/{name}"]
                    end = first + len(own)
                    if not self._copied(own, new, first):
                        return
                if end < self._frames:
                    pack(new, self._tail[name], end)

    def _copied(self, own: h5py.Dataset, new: h5py.Dataset, first: int) -> bool:
        """Copy frames; False where that was abandoned, or went wrong."""
        alike = own.chunks == new.chunks and own.fletcher32 and own.shuffle
        high, wide = chunk_of(own.shape[1])
        rows = high if alike else max(high, _AT_ONCE // own.shape[1] // high * high)
        for row in range(0, len(own), rows):
            if self._abandoned.is_set() or self._raw.failed is not None:
                return False
            if alike:
                for column in range(0, own.shape[1], wide):
                    _, chunk = own.id.read_direct_chunk((row, column))
                    new.id.write_direct_chunk((first + row, column), chunk)
            else:
                pack(new, own[row : row + rows], first + row)
        return True
