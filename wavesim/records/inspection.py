"""What is wrong with a record, and what can be read off it as it is: all before anything is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from wavesim.material.shown import plain
from wavesim.records.content import RecordError
from wavesim.records.faults.finding import Finding
from wavesim.records.faults.quiet import fine_noise
from wavesim.records.files import own_result, read
from wavesim.records.fitness import (
    for_frequency_at_k,
    for_k_at_frequency,
    for_pulse_test,
    for_waves_along_line,
)
from wavesim.records.layout import Layout
from wavesim.records.record import Record

# Receivers along a line, below which waves at one frequency are not told apart.
_FEWEST_ON_LINE = 5


@dataclass(frozen=True)
class Inspection:
    """A record looked over.

    Attributes:
        record: the record, cured where that can be done.
        assumed: what the file does not say and was assumed, a sentence each.
        findings: what is wrong with it, and what was done.
        usable: by command what it would refuse the record for; "" where it takes it.
        lacking: commands that lack an option alone, which ``usable`` names.
        run: of one of wavesim's runs its status, fields and receivers, a sentence; else "".
    """

    record: Record
    assumed: tuple[str, ...]
    findings: tuple[Finding, ...]
    usable: dict[str, str]
    lacking: tuple[str, ...] = ()
    run: str = ""

    def summary(self) -> dict[str, Any]:
        """Plain, for JSON, SI units; NaN as None."""
        record = self.record
        strongest = int(np.argmax(np.abs(record.values).max(axis=(1, 2))))
        own = record.values[strongest]

        channels = [
            {
                "name": label,
                "position_m": plain(record.x[j]),
                "peak": float(np.abs(own[:, j]).max()),
                "noise": max(fine_noise(own[:, j]), float(_quantum(record, j)) / np.sqrt(12)),
                "quantum": float(_quantum(record, j)),
                "clipped": bool(len(record.clipped) and record.clipped[j]),
                "begun": bool(len(record.begun) and record.begun[j]),
            }
            for j, label in enumerate(record.labels)
        ]
        return {
            "run": self.run,
            "frames": len(record.t),
            "start_s": float(record.t[0]),
            "interval_s": record.interval,
            "missing_frames": int(record.missing.sum()) if len(record.missing) else 0,
            "components": len(record.values),
            "receivers": channels,
            "assumed": list(self.assumed),
            "findings": [finding.row() for finding in self.findings],
            "usable": self.usable,
            "lacking": list(self.lacking),
        }


def _quantum(record: Record, j: int) -> Any:
    return record.quantum[j] if len(record.quantum) else 0.0


def inspect(
    source: str | Path | Sequence[str | Path] | Record, layout: Layout | None = None
) -> Inspection:
    """Look a record over, before anything is read off it.

    Args:
        source: a file, several of one record, a run's folder or result.h5, or a record that has
            been read.
        layout: what the file does not say for itself; positions need not be known.

    Returns:
        The findings, and which commands can use the record.

    Raises:
        RecordError: the file can't be read, or nothing can be made of it.
    """
    if isinstance(source, Record):
        record = source
    else:
        layout = layout or Layout()
        alone = [source] if isinstance(source, (str, Path)) else source
        result = own_result(alone[0]) if len(alone) == 1 else None
        if result is not None and layout.values is None:
            return _of_run(result)
        record = read(source, replace(layout, placed=False, transmitter=True))
    said = {finding.said for finding in record.findings}
    assumed = tuple(note for note in record.notes if note not in said)
    return Inspection(record, assumed, record.findings, *_usable(record))


def _of_run(path: Path) -> Inspection:
    """A run of wavesim: its first field, and what its own commands say to it."""
    from wavesim.case.schema import CaseError
    from wavesim.io.result_reader import StorageError
    from wavesim.records.of_medium import OF_LAYERS
    from wavesim.records.of_pulse_test import of_field
    from wavesim.records.run_folder import open_run

    try:
        run = open_run(path)
        field = run.field
        name = field.names[0]
        values, x = field[name], field.positions(name)
    except (StorageError, CaseError) as error:
        raise RecordError(str(error)) from None
    labels = tuple(f"{name} {j}" for j in range(1, len(x) + 1))
    endless = field.simulation.endless
    record = Record(field.t, x, values[None], (name,), endless, labels=labels)
    usable = dict.fromkeys(("attenuation", "dispersion"), "" if endless else OF_LAYERS)
    try:
        of_field(field, str(path))
        usable["pulse"] = ""
    except RecordError as error:
        usable["pulse"] = str(error)
    heard = ", ".join(f"{n} at {1e3 * p:.6g} mm" for n, p in field.receivers.items()) or "none"
    told = f"a run of wavesim, {run.status}: fields {', '.join(field.names)}; receivers {heard}"
    return Inspection(record, (), (), usable, run=told)


def _usable(record: Record) -> tuple[dict[str, str], tuple[str, ...]]:
    """By command what it would refuse the record for, and which lack an option alone."""
    known = np.isfinite(record.x)
    reasons, lacking = {}, []
    for command, needs in (
        ("attenuation", lambda: for_k_at_frequency(record)),
        ("dispersion", lambda: for_frequency_at_k(record, harmonic=False)),
    ):
        reasons[command] = ""
        try:
            if len(record.x) < 2:
                raise RecordError("1 receiver: at least 2 are needed")
            if not known.all():
                lacking.append(command)
                raise RecordError("positions are not known: give --spacing, or --positions X1,X2,…")
            if command == "dispersion" and record.ring and not record.even:
                raise RecordError("receivers are not evenly spaced round the ring")
            if command == "dispersion" and not record.ring and len(record.x) < _FEWEST_ON_LINE:
                raise RecordError(
                    f"{len(record.x)} receivers: at least {_FEWEST_ON_LINE} are needed to tell "
                    "waves along a line apart"
                )
            if command == "dispersion" and not record.ring:
                for_waves_along_line(record)
            needs()
        except RecordError as error:
            reasons[command] = str(error)
    reasons["pulse"] = ""
    if record.ring:
        reasons["pulse"] = "a ring has no first arrival"
    elif known.sum() < 2 and not (len(record.x) == 1 and np.nan_to_num(record.x).any()):
        lacking.append("pulse")
        named = "" if record.input is not None else ", and --input if a column is what was sent"
        reasons["pulse"] = f"positions are not known: give --distance, from tip to tip{named}"
        if len(record.x) > 1:
            several = "where several columns are receivers of one test"
            reasons["pulse"] += f"; {several}, --spacing or --positions X1,X2,…"
    else:
        try:
            for_pulse_test(record)
        except RecordError as error:
            reasons["pulse"] = str(error)
    return reasons, tuple(lacking)
