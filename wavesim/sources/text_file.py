"""The text of a file that somebody names: of any bytes, and of any kind of file."""

from __future__ import annotations

import os
import stat
from pathlib import Path

# Larger ones take longer to read than anybody waits; a minute of a signal at 10 kHz has 15 MB.
_LARGEST = 64_000_000


def text_of(path: Path, what: str) -> str:
    """The text of a regular file in UTF-8, with or without a byte-order mark.

    Args:
        path: of the file.
        what: it should be, for messages, such as "a case file".

    Raises:
        ValueError: it isn't there, can't be read, is no regular file (which might never end), is
            too long, or isn't text; the message says which, and what to do.
    """
    try:
        found = os.stat(path)
        if not stat.S_ISREG(found.st_mode):
            kind = "a folder" if stat.S_ISDIR(found.st_mode) else "a device, pipe or socket"
            raise ValueError(f"is {kind}, no regular file; name {what}")
        if found.st_size > _LARGEST:
            raise ValueError(
                f"{found.st_size / 1e6:.0f} MB, more than {_LARGEST / 1e6:.0f} MB; name {what}"
            )
        with open(path, "rb") as file:
            data = file.read(_LARGEST + 1)
    except FileNotFoundError:
        raise ValueError(f"no such file; name {what}") from None
    except OSError as error:
        raise ValueError(f"can't be read: {error.strerror}; name {what}") from None
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data.count(b"\n", 0, error.start) + 1
        raise ValueError(
            f"line {line}: not text in UTF-8 ({error.reason}); save it as UTF-8, or name {what}"
        ) from None
