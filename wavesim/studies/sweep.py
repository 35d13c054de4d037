"""Sweeps: a case measured over ranges of its keys, written to one dataset as results come."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from importlib.metadata import version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from wavesim.io.folder_lock import locked
from wavesim.planewave.gap_map import all_edges, edge_families
from wavesim.studies.run_sweep import Judge, run_measure
from wavesim.studies.sweep_case import SweptCase, SweptMedia, check_matters, swept_case, swept_media
from wavesim.studies.sweep_store import Layout, Store, Variable
from wavesim.studies.sweep_workers import SweepStoppedError, here, pool
from wavesim.studies.variation import Axis, Region, SweepError, variation
from wavesim.timedomain.cost import HOUR, duration_in_words, rounded

MEASURES = ("gaps", "transmission", "run")
DATASET = "sweep.zarr"
# Called with the members done, failed, and all there are.
Progress = Callable[[int, int, int], None]


@dataclass(frozen=True)
class Sweep:
    """A sweep as it was asked for.

    Attributes:
        case: what is swept.
        measure: what is measured of each member.
        store: where it is written.
    """

    case: SweptCase
    measure: Any
    store: Store

    @property
    def count(self) -> int:
        """Number of members."""
        return self.case.varied.count

    def go(
        self,
        resume: bool = False,
        workers: int | None = None,
        scheduler: str | None = None,
        progress: Progress | None = None,
        at_most: float = HOUR,
    ) -> Any:
        """Measure all members that are still to come, and open the dataset.

        Args:
            resume: carry on the dataset that is there; else it is begun anew.
            workers: processes on this machine; None works in this one.
            scheduler: address of a scheduler of Dask, in place of them.
            progress: called after each block.
            at_most: what the rest may take once two blocks are done, s.

        Returns:
            The dataset (xarray).

        Raises:
            SweepError: there is nothing to carry on, or no workers; or it takes more disk than
                there is, or longer.
            SweepStoppedError: the scheduler is gone, or nothing more can be written.
            StorageError: another run or sweep writes there.
            OSError: the dataset can't be begun.
        """
        store, tell = self.store, progress or (lambda done, failed, of: None)
        with ExitStack() as until_the_end:
            work: Any = here
            if scheduler is not None or workers is not None:
                work = until_the_end.enter_context(pool(workers, scheduler))
            done, each = 0, list[float]()
            store.path.parent.mkdir(parents=True, exist_ok=True)
            until_the_end.enter_context(locked(store.path.parent))
            if resume:
                done = store.carry_on()
            else:
                store.check_room()
                store.create()
            tell(done, store.failed, self.count)
            jobs = ((region, self._prepared(region)) for region in store.pending)
            for region, result in work(_Timed(self.measure), jobs):
                members = len(self.case.varied.at(region))
                if isinstance(result, Exception):
                    found, messages, seconds = {}, [_why(result)] * members, float("nan")
                else:
                    (found, messages), seconds = result
                try:
                    store.write(region, found, messages, seconds / members, time.time())
                except OSError as error:
                    told = f"{store.path}: can't be written: {error.strerror}"
                    raise SweepStoppedError(told) from error
                done += members
                tell(done, store.failed, self.count)
                each.append(seconds / members)
                if len(each) == 2:  # what compiles, the first does
                    self._check_time(done, np.nanmin(each) / getattr(work, "workers", 1), at_most)
        return store.open()

    def _check_time(self, done: int, each: float, at_most: float) -> None:
        left = (self.count - done) * each
        if left > at_most:
            raise SweepError(
                f"{self.count} members: the {self.count - done} left take about "
                f"{duration_in_words(left)}; longer than {duration_in_words(at_most)}: take "
                f"{rounded(done + at_most / each)}, or carry on by --resume --at-most "
                f"{int(1.5 * left / HOUR) + 1}h (at_most in Python)"
            )

    def _prepared(self, region: Region) -> Any:
        return self.measure.prepare(self.case.varied.at(region))


@dataclass(frozen=True)
class _Timed:
    """A measure's work and the seconds it took."""

    measure: Any

    def __call__(self, argument: Any) -> Any:
        begun = time.perf_counter()
        found = self.measure.work(argument)
        return found, time.perf_counter() - begun


def sweep(
    case: str | Path,
    vary: Sequence[str | Axis],
    measure: str = "gaps",
    sample: int | None = None,
    sampler: str = "sobol",
    seed: int = 0,
    folder: str | Path = "outputs",
    overrides: Sequence[str] = (),
    judge: Judge | None = None,
    band: tuple[float, float] | None = None,
    points: int = 200,
) -> Sweep:
    """Describe a sweep; its ``go`` measures it.

    Args:
        case: path of the case file.
        vary: keys and their ranges, KEY=FROM:TO:N each, KEY as of ``--set``.
        measure: "gaps" (edges of all gaps, rad/s), "transmission" (T and R at real frequencies), or
            "run" (signals at the receivers, SI).
        sample: number of members drawn from the box of the ranges; None takes the grid.
        sampler: "sobol" or "lhs".
        seed: of the sample.
        folder: where the dataset, sweep.zarr, goes.
        overrides: "table.key=value", laid over every member.
        judge: of runs, as :func:`wavesim.verdict.judgement.measure`; None stores signals alone.
        band: of transmission, Hz; by default what the half-spaces' first band holds.
        points: of transmission, number of frequencies.

    Raises:
        CaseError: the case can't be used.
        SweepError: a range or key can't, or does not matter to what is measured.
    """
    if measure not in MEASURES:
        raise SweepError(f"--measure {measure}: must be one of {', '.join(MEASURES)}")
    if band is not None and measure != "transmission":
        raise SweepError(
            f"--band {band[0]:g} {band[1]:g}: of no matter to --measure {measure}; leave it out"
            + ("; wavesim gaps CASE --band shows where a gap holds it" if measure == "gaps" else "")
        )
    varied = variation(vary, sample, sampler, seed)
    swept = swept_case(case, varied, overrides)
    made: Any
    if measure == "gaps":
        made = gap_measure(swept)
    elif measure == "transmission":
        from wavesim.studies.transmission_sweep import transmission_measure

        made = transmission_measure(swept, band, points)
    else:
        made = run_measure(swept, judge)
    told = {
        "measure": measure,
        "case": swept.text,
        "set": list(overrides),
        "vary": [[axis.key, axis.low, axis.high, axis.count] for axis in varied.axes],
        "sampler": varied.sampler,
        "members": varied.count,
        "seed": varied.seed,
        "band": None if band is None else list(band),
        "points": points,
        "wavesim_version": version("wavesim"),
    }
    return Sweep(swept, made, Store(Path(folder) / DATASET, varied, made.layout, told))


def _why(error: Exception) -> str:
    """What went wrong with a member, in a line."""
    if type(error).__name__ == "KilledWorker":
        return "every worker that it was given to was lost: it may need more memory than they have"
    told = str(error).splitlines()
    return ": ".join([type(error).__name__, *told[:1]])


_BLOCK = 5000
_LOOKED_AT = "the parameters of the case's media"


@dataclass(frozen=True)
class GapMeasure:
    """Edges of the gaps of a case's media.

    Attributes:
        swept: the media.
    """

    swept: SweptMedia

    @property
    def layout(self) -> Layout:
        """What is stored."""
        names = self.swept.names
        own = ("medium", "gap") if len(names) > 1 else ("gap",)
        about = "edge of a gap; lower = upper where it is closed"
        variables = {name: Variable(own, "rad/s", f"{name} {about}") for name in ("lower", "upper")}
        whose = edge_families(self.swept.media[0])
        coordinates: dict[str, Any] = {"gap": (list(whose), "1")}
        if len(names) > 1:
            coordinates["medium"] = (list(names), "1")
        return Layout(variables, coordinates, _BLOCK, {"family": (list(whose.values()), "gap")})

    def prepare(self, values: NDArray[np.float64]) -> NDArray[np.float64]:
        """What is sent to where the work is done."""
        return values

    def work(self, values: NDArray[np.float64]) -> tuple[dict[str, Any], list[str]]:
        """Edges, and why members have none.

        Args:
            values: shape (members, keys).
        """
        count = len(values)
        families, messages = self.swept.families(values)
        sides: tuple[list[Any], list[Any]] = ([], [])
        for number, family in enumerate(families):
            for side, edges in zip(sides, all_edges(family), strict=True):
                parts = [np.broadcast_to(part, (count,)) for part in edges.values()]
                side.append(np.stack(parts, axis=1))
            # An edge that is not real is of a wave that grows.
            unreal = np.isnan(sides[0][-1] + sides[1][-1]).any(axis=1)
            for member in np.flatnonzero(unreal):
                self.swept.tell_growing(messages, number, family, int(member))
        failed = np.array([message != "" for message in messages])
        found = {}
        for name, parts in zip(("lower", "upper"), sides, strict=True):
            whole = np.stack(parts, axis=1) if len(parts) > 1 else parts[0]
            whole[failed] = np.nan
            found[name] = whole
        return found, messages


def gap_measure(swept: SweptCase) -> GapMeasure:
    """How the gaps of a sweep are measured.

    Raises:
        SweepError: no member can be made, or a key does not matter to any medium.
    """
    media, matters = swept_media(swept)
    for axis, does in zip(swept.varied.axes, matters, strict=True):
        check_matters(axis.key, does, "gaps", _LOOKED_AT)
    return GapMeasure(media)
