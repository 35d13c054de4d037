"""What ``--against`` says of a series: what differs from record to record, and its values."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from wavesim.report.terminal import BAD_INPUT, stop


@dataclass(frozen=True)
class States:
    """The parameter of a series, with its unit, and its values, one for each record."""

    parameter: str
    values: tuple[float, ...]

    def check(self, names: Sequence[str], count: int) -> None:
        """Refuse another number of values than of records, and another order than that of the
        numbers that the records' names have."""
        if len(self.values) != count:
            stop(
                f"--against {self.parameter}: {len(self.values)} values for {count} records; give "
                "one for each, in the order of the files",
                BAD_INPUT,
            )
        said = []
        for name in names[:count]:
            own = {float(n) for n in re.findall(r"\d+(?:\.\d+)?", name.rpartition("/")[2])}
            said.append(own & set(self.values))
        told = [min(one) for one in said if len(one) == 1]
        if sorted(told) != sorted(self.values):
            self._counted(names)
        elif told != list(self.values):
            n = next(n for n, value in enumerate(self.values) if value != told[n])
            stop(
                f"--against {self.parameter}: {names[n]} is given {self.values[n]:g}, but is named "
                f"{told[n]:g}; in the order of the files: {','.join(f'{v:g}' for v in told)}",
                BAD_INPUT,
            )

    def _counted(self, names: Sequence[str]) -> None:
        """Refuse steady values of files that the shell has in another order than their numbers."""
        counted = [[int(n) for n in re.findall(r"\d+", name)] for name in names]
        alike = len({re.sub(r"\d+", "0", name) for name in names}) == 1
        steady = list(self.values) in (sorted(self.values), sorted(self.values, reverse=True))
        as_text = list(names) == sorted(names) and counted != sorted(counted)
        if alike and steady and as_text and len(names) > 2:
            n = next(n for n in range(1, len(names)) if counted[n] < counted[n - 1])
            stop(
                f"--against {self.parameter}: values rise or fall steadily, but the shell puts "
                f"{names[n - 1]} before {names[n]}: give them in its order, or the files in that "
                "of their numbers, as ls -v lists them",
                BAD_INPUT,
            )


def states(against: str, files: Sequence[str] = ()) -> States:
    """What is said as NAME=V1,V2,…, with a unit behind the values or in brackets; or as NAME=FILE.

    Args:
        against: what is said.
        files: of the records.
    """
    parameter, mark, listed = against.partition("=")
    if not (mark and parameter.strip()):
        stop(f"--against {against}: must be NAME=V1,V2,…, as stress=20,40,80", BAD_INPUT)
    if Path(listed.strip()).is_file():
        parameter, listed = _of_file(parameter.strip(), Path(listed.strip()), files)
    parameter, listed = _with_unit(parameter.strip(), listed)
    return States(parameter, numbers("--against", listed))


def _of_file(parameter: str, file: Path, files: Sequence[str]) -> tuple[str, str]:
    """The same of a table: the last column in the order of the records, or by their names where
    its first has these; a heading may have the unit in brackets."""
    lines = file.read_text(encoding="utf-8-sig", errors="replace").splitlines()
    rows = [[cell for cell in re.split(r"[,;\s]+", line.strip()) if cell] for line in lines
            if line.strip() and not line.lstrip().startswith(("#", "%"))]  # fmt: skip
    if rows and not re.match(r"[-+.]?\d", rows[0][-1]):
        unit = re.search(r"[(\[](.+?)[)\]]", rows.pop(0)[-1])
        parameter += f" ({unit[1]})" if unit and "(" not in parameter else ""
    stems = [Path(one).stem for one in files]
    named = {stem: row[-1] for row in rows if row[1:] and (stem := Path(row[0]).stem) in stems}
    if not named:
        return parameter, ",".join(row[-1] for row in rows)
    for one, stem in zip(files, stems, strict=True):
        if stem not in named:
            stop(f"--against {parameter}={file}: has no row for {one}: give it one", BAD_INPUT)
    return parameter, ",".join(named[stem] for stem in stems)


def _with_unit(parameter: str, listed: str) -> tuple[str, str]:
    """A series' parameter with the unit that its first or last value has, and its numbers alone."""
    found = re.findall(r"(?<=[\d.])\s*([A-Za-zµ%°/²³]+)\s*(?=[,;]|$)", listed)
    if len(set(found)) > 1:
        units = ", ".join(dict.fromkeys(found))
        stop(f"--against {parameter}={listed}: values in {units}; give all in one unit", BAD_INPUT)
    if not found:
        return parameter, listed
    numbers = re.sub(rf"\s*{re.escape(found[0])}\s*(?=[,;]|$)", "", listed)
    return (parameter if "(" in parameter else f"{parameter} ({found[0]})"), numbers


def numbers(option: str, text: str, unit: str = "") -> tuple[float, ...]:
    """Numbers with commas between them; of a unit, in SI."""
    from wavesim.case.units import meant_by

    parts = [part.strip() for part in text.replace(";", ",").split(",") if part.strip()]
    try:
        found = tuple(float((meant_by(unit, part) if unit else None) or part) for part in parts)
    except ValueError:
        found = ()
    if not found or not all(math.isfinite(v) for v in found):
        what = f"numbers in {unit}, or with a unit," if unit else "numbers"
        stop(f"{option} {text}: must be {what} with commas between them", BAD_INPUT)
    return found
