"""What ``--against`` says of a series: what differs from record to record, and its values."""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass

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


def states(against: str) -> States:
    """What is said as NAME=V1,V2,…, with a unit behind the values or in brackets."""
    parameter, mark, listed = against.partition("=")
    if not (mark and parameter.strip()):
        stop(f"--against {against}: must be NAME=V1,V2,…, as stress=20,40,80", BAD_INPUT)
    parameter, listed = _with_unit(parameter.strip(), listed)
    return States(parameter, numbers("--against", listed))


def _with_unit(parameter: str, listed: str) -> tuple[str, str]:
    """A series' parameter with the unit that its first or last value has, and its numbers alone."""
    found = re.findall(r"(?<=[\d.])\s*([A-Za-zµ%°/²³]+)\s*(?=[,;]|$)", listed)
    if not found or len(set(found)) > 1:
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
