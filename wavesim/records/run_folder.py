"""The folder of a run, opened again: its case, its field, its verdict."""

from __future__ import annotations

import json
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any

from wavesim.case.load import Case, build
from wavesim.case.schema import CaseError, parse
from wavesim.io.result_reader import StorageError, describe, read
from wavesim.material.shown import Shown
from wavesim.records.content import RecordError
from wavesim.simulation.field import Field

if TYPE_CHECKING:
    import pandas
    import xarray


@dataclass(frozen=True, repr=False)
class Run(Shown):
    """What ``wavesim run`` left in a folder.

    Attributes:
        folder: the folder.
        status: "running", "complete" or "failed".
        case: what was run, every default filled in.
        field: the space-time field; its arrays are read when they are indexed.
    """

    folder: Path
    status: str
    case: Case
    field: Field

    @cached_property
    def summary(self) -> dict[str, Any]:
        """What summary.json holds; empty while there is none.

        Raises:
            StorageError: it is not JSON.
        """
        path = self.folder / "summary.json"
        if not path.is_file():
            return {}
        try:
            return dict(json.loads(path.read_text(encoding="utf-8")))
        except (ValueError, TypeError, RecursionError) as error:
            raise StorageError(f"{path}: is not JSON: {error}; run the case again") from None

    @property
    def checks(self) -> pandas.DataFrame:
        """The verdict as a table: name, measured, reference, tolerance, unit, passed."""
        import pandas

        return pandas.DataFrame(self.summary.get("checks", []))

    @property
    def passed(self) -> bool:
        """Whether every check of a complete run passed."""
        return self.status == "complete" and bool(self.summary.get("passed"))

    def told(self) -> dict[str, str]:
        """Title, status, verdict, and what was run."""
        checks = self.summary.get("checks", [])
        good = sum(bool(check["passed"]) for check in checks)
        return {
            "title": self.case.title,
            "status": self.status,
            "verdict": f"{good} of {len(checks)} checks passed" if self.summary else "none yet",
            **self.case.simulation.told(),
        }

    def to_xarray(self) -> xarray.Dataset:
        """Its field as a labelled data set."""
        return self.field.to_xarray()


def open_run(folder: str | Path) -> Run:
    """Open the folder of a run, or its result.h5.

    Args:
        folder: such as outputs/slab.

    Raises:
        StorageError: there is no result of wavesim, or it holds fewer than two frames.
        CaseError: the stored case is of another version of wavesim.
    """
    path = Path(folder)
    path = path / "result.h5" if path.is_dir() else path
    stored = describe(path)
    case = build(parse(stored.case, str(path)), str(path))
    return Run(path.parent, stored.status, case, read(path, case.simulation))


def field_of(path: Path) -> Field:
    """The field of a run as a record's source.

    Raises:
        RecordError: its file can't be used; the message names it.
    """
    try:
        return open_run(path).field
    except (StorageError, CaseError) as error:
        raise RecordError(str(error)) from None
