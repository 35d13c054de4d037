"""Fields packed as chunks of HDF5, beside each other, with their checksums.

The HDF5 library compresses in one thread, under a lock that keeps everyone else from reading. Here
chunks are compressed beside each other and handed over finished; a reader can't tell. At the end of
a run they are copied as they are into one file, while it goes on to other things.
"""

from __future__ import annotations

import io
import os
import threading
import zlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, contextmanager, suppress
from itertools import product
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from wavesim.io.whole_files import LIBVER
from wavesim.worker import cores

# As HDF5's filters have it: bytes of a kind together, deflated, and a checksum over that.
PACKED: dict[str, Any] = {
    "compression": "gzip",
    "compression_opts": 1,
    "shuffle": True,
    "fletcher32": True,
}
# Arrays of more numbers than this are packed.
_LONG = 65536
_CHUNK_POINTS = 16384
_WIDEST, _HIGHEST = 1024, 64
# So many threads compress, each so many points of the bar at a time.
_THREADS = min(4, cores())
_AT_ONCE = 65536
# Of Fletcher's two sums, for as many pairs of bytes as a packed chunk may have.
_LONGEST = 2 * 4 * _CHUNK_POINTS
_WEIGHTS = np.stack([np.ones(_LONGEST), np.arange(_LONGEST, 0, -1.0)])
# A field moves in a chunk where so many of its last bytes are not 0.
_MOVING = 0.97


def chunk_of(points: int) -> tuple[int, int]:
    """Frames and points of a chunk of a field on so many points.

    Frames are a power of two, so that fields on nodes and half-nodes, one point more or less, have
    parts of whole chunks alike.
    """
    wide = min(points, _WIDEST)
    return 2 ** (max(1, min(_HIGHEST, _CHUNK_POINTS // wide)).bit_length() - 1), wide


def packed_dataset(file: h5py.File, name: str, frames: int, points: int) -> h5py.Dataset:
    """A data set for a field, to be filled by :func:`pack`."""
    high, wide = chunk_of(points)
    chunks = min(high, frames), wide
    return file.create_dataset(name, (frames, points), np.float64, chunks=chunks, **PACKED)


def put(group: h5py.Group, name: str, data: Any, unit: str) -> Any:
    """An array with its unit and checksum, packed where it is long; else an attribute.

    Returns:
        The data set; None of a plain number or text, which is an attribute.
    """
    if isinstance(data, float | str):
        where, _, name = name.rpartition("/")
        group.require_group(where).attrs[name] = data
        return None
    kept: dict[str, Any] = {"fletcher32": True} if np.ndim(data) and np.size(data) else {}
    made = group.create_dataset(
        name, data=data, **(PACKED if np.size(data) > _LONG and kept else kept)
    )
    if unit:
        made.attrs["units"] = unit
    return made


def pack(data: h5py.Dataset, values: Any, first: int = 0) -> None:
    """Write frames into a data set of :func:`packed_dataset`.

    Args:
        data: the data set.
        values: shape (frames, points), an array or another data set.
        first: which frame the first one is; a whole number of chunks.
    """
    high, wide = data.chunks
    count, points = values.shape
    step = max(1, _AT_ONCE // wide) * wide
    corners = list(product(range(0, count, high), range(0, points, step)))
    made = _chunks(values, high, wide, step)
    with ThreadPoolExecutor(_THREADS) as helpers:
        # A few at a time, so that no more are held than are about to be written.
        for some in range(0, len(corners), 4 * _THREADS):
            for chunks in helpers.map(made, corners[some : some + 4 * _THREADS]):
                for (row, column), chunk in chunks:
                    data.id.write_direct_chunk((first + row, column), chunk)


def _chunks(
    values: Any, high: int, wide: int, step: int
) -> Callable[[tuple[int, int]], list[tuple[tuple[int, int], bytes]]]:
    """What gives the packed chunks of so many points from a corner on, each with its offset."""

    def made(corner: tuple[int, int]) -> list[tuple[tuple[int, int], bytes]]:
        row, left = corner
        block = values[row : row + high, left : left + step]
        found = []
        for at in range(0, block.shape[1], wide):
            chunk = np.zeros((high, wide), np.float64)
            part = block[:, at : at + wide]
            chunk[: part.shape[0], : part.shape[1]] = part
            packed = deflated(chunk)
            found.append(((row, left + at), packed + fletcher32(packed).to_bytes(4, "little")))
        return found

    return made


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


def fletcher32(data: bytes) -> int:
    """Fletcher's checksum of bytes as HDF5 takes it: big-endian pairs, sums modulo 65535 with 65535
    in place of 0; J. G. Fletcher, IEEE Trans. Commun. 30, 247 (1982). No longer than two chunks.
    """
    if len(data) % 2:
        data += b"\0"
    words = np.frombuffer(data, ">u2").astype(np.float64)
    # Whole numbers below 2^53, so that no product or sum is rounded.
    sums = _WEIGHTS[:, _LONGEST - len(words) :] @ words
    low, high = ((int(total) - 1) % 65535 + 1 if total else 0 for total in sums)
    return high << 16 | low


# Frames of parts that are packed otherwise are read so many numbers at a time.
_READ_AT_ONCE = 4_000_000


class Taking(io.FileIO):
    """A file that takes whatever is written, and keeps the first error to itself: the HDF5 library
    does not survive a disk that is full."""

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
        rows = high if alike else max(high, _READ_AT_ONCE // own.shape[1] // high * high)
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
