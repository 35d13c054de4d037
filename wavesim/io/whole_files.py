"""Files that are there as a whole, or are what they were before."""

from __future__ import annotations

import io
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import h5py

# Metadata with checksums too.
LIBVER = ("v110", "v110")


@contextmanager
def written(path: Path) -> Iterator[h5py.File]:
    """A new file, which takes the place of an old one once it is whole.

    It is made in memory: no failure to write can upset the HDF5 library.
    """
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
