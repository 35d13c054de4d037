"""Cases run whole by the command, each once for all tests and all workers."""

from __future__ import annotations

import json
import os
import pickle
import re
from collections.abc import Callable
from contextlib import nullcontext
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any
from unittest.mock import patch

import pytest
from click.testing import CliRunner, Result
from filelock import FileLock

from wavesim.case.load import load
from wavesim.cli.main import main
from wavesim.io import result_reader
from wavesim.worker import Here

SHIPPED = {path.stem: path for path in sorted((Path(__file__).parents[1] / "cases").glob("*.toml"))}


def call(*arguments: object, alone: bool = True) -> Result:
    """A command in this process; an exception that is not an exit fails the test.

    Alone, what a process beside a run would do is done here, where it is loaded already.
    """
    beside = patch("wavesim.report.run_files.begun_beside", lambda: nullcontext(Here()))
    with beside if alone else nullcontext():
        return CliRunner().invoke(main, [str(a) for a in arguments], catch_exceptions=False)


def refused(make: Callable[[], Any], given: str, remedy: str) -> None:
    """That it raises ValueError with one line, which has what was given, and then a remedy."""
    with pytest.raises(ValueError, match=re.escape(given)) as caught:
        make()
    message = str(caught.value)
    assert "\n" not in message
    assert remedy in message.partition(given)[2]


def once(path: Path, make: Callable[[], Any]) -> Any:
    """What ``make`` gives, kept in a file for all workers: the first to ask makes it."""
    with FileLock(path.with_suffix(".lock")):
        if not path.exists():
            path.write_bytes(pickle.dumps(make()))
    return pickle.loads(path.read_bytes())


@dataclass(frozen=True)
class Run:
    """A case and the folder of its results.

    Attributes:
        case: the case file.
        folder: what ``wavesim run`` wrote.
        exit_code, stdout, stderr: what it told.
    """

    case: Path
    folder: Path
    exit_code: int
    stdout: str
    stderr: str

    @cached_property
    def loaded(self):
        return load(self.case)

    @cached_property
    def summary(self):
        return json.loads((self.folder / "summary.json").read_text(encoding="utf-8"))

    @cached_property
    def field(self):
        return result_reader.read(self.result, self.loaded.simulation)

    @property
    def result(self) -> Path:
        return self.folder / "result.h5"


def run(case: Path, shared: Path) -> Run:
    """The run of a case in a folder that all workers see."""
    folder = shared / case.stem

    def made() -> tuple[int, str, str]:
        told = call("run", case, "--out", folder, alone=case.stem != "small")
        return told.exit_code, told.stdout, told.stderr

    return Run(case, folder, *once(shared / f"{case.stem}.pickle", made))


def shipped(name: str, shared: Path) -> Run:
    """The run of a shipped case; that of $WAVESIM_OUTPUTS, a folder of results, if it is there."""
    elsewhere = Path(os.environ.get("WAVESIM_OUTPUTS", "none")) / name
    if not (elsewhere / "summary.json").exists():
        return run(SHIPPED[name], shared)
    found = Run(SHIPPED[name], elsewhere, 0, "", "")
    stored = result_reader.describe(found.result)
    resolved = found.loaded.resolved(found.summary["stepper"], found.summary["step"])
    assert (stored.status, stored.case) == ("complete", resolved), elsewhere
    return found
