"""Many parts of a run made into one compressed file, while the run goes on to other things.

The HDF5 library compresses in one thread, under a lock that keeps everyone else from reading. Here
chunks are compressed beside each other and handed over finished; a reader can't tell.
"""

from __future__ import annotations

import os
import threading
import zlib
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from itertools import product
from pathlib import Path
from typing import Any

import h5py
import numpy as np

COMPRESSED: dict[str, Any] = {"compression": "gzip", "compression_opts": 1, "shuffle": True}
_CHUNK_POINTS = 16384
# So many threads compress, each so many points of the bar at a time.
_THREADS = min(4, os.cpu_count() or 1)
_GATHERED = 65536
# A field moves in a chunk where so many of its last bytes are not 0.
_MOVING = 0.97


class Gathering:
    """Fields of one file on their way, compressed, into the one that shall take its place.

    Args:
        path: of the file.
        before: the file, open.
        names: of the fields.
    """

    def __init__(self, path: Path, before: h5py.File, names: Sequence[str]) -> None:
        self._path, self._temporary = path, path.with_name(path.name + ".tmp")
        self._fields = {name: before[f"fields/{name}"] for name in names}
        self._abandoned = threading.Event()
        self._file = h5py.File(self._temporary, "w")
        self._helpers = ThreadPoolExecutor(_THREADS)
        self._keeper = ThreadPoolExecutor(1)
        self._done = self._keeper.submit(self._copy)

    @contextmanager
    def file(self) -> Iterator[h5py.File]:
        """The new file with all fields in it; afterwards it takes the place of the old one."""
        self._done.result()
        yield self._file
        self._file.close()
        os.replace(self._temporary, self._path)

    def abandon(self) -> None:
        """Stop, and leave nothing behind but what took the old file's place."""
        self._abandoned.set()
        self._keeper.shutdown()
        self._helpers.shutdown()
        self._file.close()
        self._temporary.unlink(missing_ok=True)

    def _copy(self) -> None:
        for name, frames in self._fields.items():
            count, points = frames.shape
            wide = min(points, 1024)
            high = max(1, min(64, _CHUNK_POINTS // wide, count))
            new = self._file.create_dataset(
                f"fields/{name}", frames.shape, frames.dtype, chunks=(high, wide), **COMPRESSED
            )
            step = max(1, _GATHERED // wide) * wide
            corners = list(product(range(0, count, high), range(0, points, step)))
            compress = _chunks(frames, high, wide, step)
            # A few at a time, so that no more are held than are about to be written.
            for some in range(0, len(corners), 4 * _THREADS):
                for chunks in self._helpers.map(compress, corners[some : some + 4 * _THREADS]):
                    for offset, chunk in chunks:
                        new.id.write_direct_chunk(offset, chunk)
                if self._abandoned.is_set():
                    return


def _chunks(
    frames: h5py.Dataset, high: int, wide: int, step: int
) -> Callable[[tuple[int, int]], list[tuple[tuple[int, int], bytes]]]:
    """What gives the compressed chunks of so many points from a corner on, each with its offset."""

    def compress(corner: tuple[int, int]) -> list[tuple[tuple[int, int], bytes]]:
        first, left = corner
        block = frames[first : first + high, left : left + step]
        found = []
        for at in range(0, block.shape[1], wide):
            chunk = np.zeros((high, wide), block.dtype)
            part = block[:, at : at + wide]
            chunk[: part.shape[0], : part.shape[1]] = part
            found.append(((first, left + at), deflated(chunk)))
        return found

    return compress


def deflated(chunk: np.ndarray) -> bytes:
    """A chunk as HDF5's filters shuffle and deflate leave it.

    Runs of equal bytes, and bytes more frequent than others, are all that a shuffled wave field
    offers to save: looking for nothing else is more than twice as fast, for 1.5 % more bytes. Where
    the field moves only its two leading bytes offer that, sign and exponent among them: the others
    are stored, which is as fast again for 0.1 % more.
    """
    planes = chunk.reshape(-1).view(np.uint8).reshape(-1, chunk.itemsize).T
    shuffled = planes.tobytes()
    moving = np.count_nonzero(planes[0]) > _MOVING * planes.shape[1]
    plain = (chunk.itemsize - 2) * planes.shape[1] if moving else 0
    store = zlib.compressobj(0, zlib.DEFLATED, -zlib.MAX_WBITS)
    packer = zlib.compressobj(1, zlib.DEFLATED, -zlib.MAX_WBITS, 8, zlib.Z_RLE)
    # The two deflated parts of one zlib stream, between its head and its checksum.
    return b"".join(
        (
            b"\x78\x01",
            store.compress(shuffled[:plain]) + store.flush(zlib.Z_FULL_FLUSH),
            packer.compress(shuffled[plain:]) + packer.flush(),
            zlib.adler32(shuffled).to_bytes(4, "big"),
        )
    )
