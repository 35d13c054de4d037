"""Files that are there as a whole, or are what they were before."""

from __future__ import annotations

import errno
import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:  # what only writes bytes does without
    import h5py

_FULL = "make room on the disk"
_CLOSED = "let its folder be written to"
# What helps where a file can't be written.
_WAYS_OUT = {
    errno.ENOSPC: _FULL,
    errno.EDQUOT: _FULL,
    errno.EFBIG: "raise the limit of the size of files (ulimit -f)",
    errno.EROFS: _CLOSED,
    errno.EACCES: _CLOSED,
    errno.EPERM: _CLOSED,
    errno.EMFILE: "let more files be open (ulimit -n)",
    errno.EIO: "look to the disk",
}
# Metadata with checksums too.
LIBVER = ("v110", "v110")


def way_out(error: Exception) -> str:
    """What helps where a file can't be written; "" where that is not known."""
    return _WAYS_OUT.get(getattr(error, "errno", None) or 0, "")


@contextmanager
def written(path: Path) -> Iterator[h5py.File]:
    """A new file, which takes the place of an old one once it is whole.

    It is made in memory: no failure to write can upset the HDF5 library.
    """
    import h5py

    image = io.BytesIO()
    with h5py.File(image, "w", libver=LIBVER) as file:
        yield file
    write_whole(path, image.getbuffer())


def write_whole(path: Path, data: bytes | memoryview) -> None:
    """A file that is there as a whole, or is what it was before.

    Raises:
        OSError: it can't be written.
    """
    temporary = path.with_name(path.name + ".tmp")
    try:
        temporary.write_bytes(data)
        os.replace(temporary, path)
    finally:
        with suppress(OSError):
            temporary.unlink(missing_ok=True)
