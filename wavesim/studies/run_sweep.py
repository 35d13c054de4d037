"""Whole runs of a sweep's members: signals at the receivers, and the verdict where one is asked."""

from __future__ import annotations

import itertools
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.case.load import Case, build
from wavesim.case.schema import CaseError, CaseFile
from wavesim.material.family import known_field
from wavesim.studies.sweep_case import SweptCase
from wavesim.studies.sweep_store import Layout, Variable
from wavesim.studies.variation import SweepError

# Measures and judges a field of a case; its ``checks`` are looked at.
Judge = Callable[[Case, Any], Any]
# Corners of the box of all ranges that are looked at.
_CORNERS = 64


@dataclass(frozen=True)
class RunMeasure:
    """What each receiver records, and how the run was judged.

    Attributes:
        swept: the sweep.
        receivers, fields, frames: what a member may have.
        judge: of a run's field; None leaves it unjudged.
    """

    swept: SweptCase
    receivers: tuple[str, ...]
    fields: tuple[str, ...]
    frames: int
    judge: Judge | None

    @property
    def layout(self) -> Layout:
        """What is stored."""
        each = [known_field(name).unit for name in self.fields]
        by_unit = {
            unit: [f for f, u in zip(self.fields, each, strict=True) if u == unit] for unit in each
        }
        unit = (
            each[0]
            if len(by_unit) == 1
            else "; ".join(f"{unit} for {', '.join(fields)}" for unit, fields in by_unit.items())
        )
        seen = ("receiver", "field")
        variables = {
            "signal": Variable((*seen, "frame"), unit, "what a receiver records of a field"),
            "time": Variable(("frame",), "s", "of the frames"),
            "peak": Variable(seen, unit, "largest absolute value of the signal"),
        }
        if not self.receivers:
            variables = {}
        if self.judge is not None:
            variables |= {
                "checks": Variable((), "1", "number of checks of the run", "i4"),
                "fell_short": Variable((), "1", "number of checks that fell short", "i4"),
                "worst": Variable((), "1", "largest of |measured - reference| over tolerance"),
                "shortfall": Variable((), "1", "names of the checks that fell short", str),
            }
        names = {"receiver": self.receivers, "field": self.fields, "frame": range(self.frames)}
        shown = {name: (list(values), "1") for name, values in names.items()}
        if not self.receivers:
            return Layout(variables, {}, 1)
        return Layout(variables, shown, 1, {"unit": (each, "field")})

    def prepare(self, values: NDArray[np.float64]) -> Any:
        """The case of one member, or why there is none; what is sent to where it is run."""
        try:
            case = _checked(self.swept.file(values[0]), self.swept.name)
        except CaseError as error:
            return str(error)
        return case

    def work(self, case: Any) -> tuple[dict[str, Any], list[str]]:
        """Run one member."""
        if isinstance(case, str):
            return {}, [case]
        from wavesim.timedomain.compiled import keep_compiled
        from wavesim.timedomain.integrate import NotFiniteError, integrate

        keep_compiled()
        try:
            field = integrate(case.simulation)
        except (NotFiniteError, ValueError, MemoryError) as error:
            return {}, [str(error) or "the run does not fit into memory"]
        found: dict[str, Any] = {}
        if self.receivers:
            found = self._signals(field)
        if self.judge is not None:
            checks = self.judge(case, field).checks
            short = [check for check in checks if not check.passed]
            found |= {
                "checks": [len(checks)],
                "fell_short": [len(short)],
                "worst": [_worst(checks)],
                "shortfall": np.array(["; ".join(check.name for check in short)], dtype=object),
            }
        return found, [""]

    def _signals(self, field: Any) -> dict[str, Any]:
        shape = len(self.receivers), len(self.fields), self.frames
        signal, count = np.full(shape, np.nan), len(field.t)
        for i, name in enumerate(self.receivers):
            for j, wanted in enumerate(self.fields):
                if name in field.receivers and wanted in field.names:
                    signal[i, j, :count] = field.at(field.receivers[name], wanted)
        time = np.full(self.frames, np.nan)
        time[:count] = field.t
        peak = np.abs(signal[..., :count]).max(axis=-1)
        return {"signal": signal[None], "time": time[None], "peak": peak[None]}


def _worst(checks: Any) -> float:
    """Above 1 where a check falls short: of what is no number, or may not be off at all, ∞."""

    def over(check: Any) -> float:
        off = abs(check.measured - check.reference)
        if check.tolerance > 0 and np.isfinite(off):
            return float(off / check.tolerance)
        return 0.0 if check.passed else np.inf

    return max(map(over, checks), default=np.nan)


def _checked(file: CaseFile, name: str) -> Case:
    """A case whose run fits this machine; see :func:`time_step`."""
    from wavesim.timedomain.time_step import time_step

    case = build(file, name)
    try:
        time_step(case.simulation)
    except ValueError as error:
        raise CaseError(f"{name}: [time] {error}") from None
    return case


def run_measure(swept: SweptCase, judge: Judge | None = None) -> RunMeasure:
    """How the runs of a sweep are measured.

    Args:
        swept: the sweep.
        judge: as :func:`wavesim.verdict.judgement.measure`; None stores signals alone.

    Raises:
        SweepError: no member can be made, or there is nothing to store.
    """
    axes = swept.varied.axes
    anchor, first = swept.anchor(_checked)
    others = (swept.other(_checked, anchor, number) for number in range(len(axes)))
    cases = [first, *(other[1] for other in others if other is not None)]
    # A corner of the box holds the most frames there can be.
    ends = itertools.product(*({axis.low, axis.high} for axis in axes))
    for corner in itertools.islice(ends, _CORNERS):
        with suppress(CaseError):
            cases.append(_checked(swept.file(corner), swept.name))
    receivers = dict.fromkeys(name for case in cases for name in case.simulation.receivers)
    fields = dict.fromkeys(name for case in cases for name in case.simulation.fields)
    if not receivers and judge is None:
        raise SweepError(f"{swept.name}: --measure run needs [[receivers]] to record something at")
    frames = max(case.simulation.frames for case in cases)
    return RunMeasure(swept, tuple(receivers), tuple(fields), frames, judge)
