"""What several commands do: read a case, write results into a folder, print them as JSON."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import click

from wavesim.report.terminal import stop, unwritable


def read_case(case: str, overrides: Sequence[str] = ()) -> Any:
    """The case of a file or a name."""
    from wavesim.case.load import load

    return load(case, overrides)


def read_layers(case: str, overrides: Sequence[str] = ()) -> Any:
    """The material alone of a case that need not be one of a simulation."""
    from wavesim.case.layered_case import load_layers

    return load_layers(case, overrides)


def folder_for(out: str | None, case: str) -> Path:
    """Where results go."""
    return Path(out) if out else Path("outputs") / Path(case).stem


@contextmanager
def writing(folder: Path) -> Iterator[None]:
    """A folder that is there; what can't be written into it ends the command with a line."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
        yield
    except OSError as error:
        stop(*unwritable(error, f"--out {error.filename or folder}"))


def print_json(answer: Any) -> None:
    """One line."""
    click.echo(json.dumps(answer, ensure_ascii=False))


def write_json(path: Path, answer: Any, indent: int | None = 1) -> None:
    """The same as a file."""
    text = json.dumps(answer, ensure_ascii=False, indent=indent)
    path.write_text(text + "\n", encoding="utf-8")


def write_table(path: Path, heads: Sequence[str], rows: Any, fmt: str = "%.18e") -> None:
    """Numbers as CSV under a line of headings."""
    import numpy as np

    np.savetxt(path, rows, fmt=fmt, delimiter=",", header=",".join(heads), comments="")
