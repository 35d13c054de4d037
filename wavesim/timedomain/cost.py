"""What a run takes: time, memory and disk, said before it begins; from its plan and the machine.

Counts (products, points, bytes) are those of the plan; what each takes was measured once, on two
cores, and is scaled by how fast this machine is now at the same kind of work.
"""

from __future__ import annotations

import functools
import os
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from wavesim.simulation.field import MOST_WAVENUMBERS
from wavesim.simulation.simulation import Simulation
from wavesim.timedomain.time_step import RUN, TimeStep, chunk_frames

# Seconds on the machine that was measured on, quiet.
_START, _COMPILE = 2.6, {"propagator": 2.2, "chebyshev": 3.0}
_PER_FLOP, _PER_PRODUCT, _PER_POINT = 3.0e-11, 1.0e-4, 2.5e-8
_PER_STORED, _PER_READ = 8.0e-9, 3.0e-9  # a byte
_ENDLESS, _BAR, _PER_SIGNAL, _PAGE = 0.8, 1.2, 6.0e-7, 2.2
# Bytes: what is loaded and compiled, here and in the process beside; what a packed number takes
# where waves are; page and picture.
_LOADED, _PACKED, _SHOWN = 0.85e9, 6.9, 5.0e6
# What the same work took there: arithmetic of one thread, and a loop of Python.
_PRODUCT_THEN, _LOOP_THEN = 5.5e-5, 2.8e-3
_PART_OF_MEMORY = 0.8
HOUR = 3600.0


@dataclass(frozen=True)
class Cost:
    """What a run takes.

    Attributes:
        seconds: wall time, s.
        memory: largest, bytes.
        disk: of its folder, bytes.
    """

    seconds: float
    memory: float
    disk: float

    @property
    def in_words(self) -> str:
        """Such as "about 3 days, 2.1 GB of memory and 65 GB of disk"."""
        taken = duration_in_words(self.seconds)
        return f"about {taken}, {size(self.memory)} of memory and {size(self.disk)} of disk"


def size(count: float) -> str:
    """Bytes in MB, GB or TB."""
    unit, name = next((u, n) for u, n in ((1e12, "TB"), (1e9, "GB"), (0.0, "MB")) if count >= u)
    return f"{count / (unit or 1e6):.3g} {name}"


def duration_in_words(seconds: float) -> str:
    """A time in the largest unit that it has two of, or seconds."""
    for unit, name in ((31557600.0, "years"), (604800.0, "weeks"), (86400.0, "days"),
                       (3600.0, "hours"), (60.0, "minutes")):  # fmt: skip
        if seconds >= 2 * unit:
            return f"{seconds / unit:.2g} {name}"
    return f"{seconds:.2g} seconds"


@functools.cache
def slowness() -> tuple[float, float]:
    """How much longer this machine takes now than that which was measured on: arithmetic, Python.

    Takes a tenth of a second; once in a process.
    """
    a = np.linspace(0.5, 1.0, 100_000)

    def product() -> None:
        np.exp(a)

    def loop() -> None:
        sum(i * i for i in range(100_000))

    found = []
    for work, then in ((product, _PRODUCT_THEN), (loop, _LOOP_THEN)):
        work()
        begun, count = time.perf_counter(), 0
        while time.perf_counter() - begun < 0.04:
            work()
            count += 1
        found.append((time.perf_counter() - begun) / count / then)
    return found[0], found[1]


def cost(simulated: Simulation, steps: TimeStep, page: bool = True) -> Cost:
    """What a run takes.

    Args:
        simulated: the simulation.
        steps: how it is stepped.
        page: whether it is judged, stored and shown, as ``wavesim run`` does; else it is kept in
            memory, as ``simulate`` does.
    """
    frames, cells, count = simulated.frames, simulated.bar.cells, len(simulated.fields)
    numbers = float(frames) * cells * count
    arithmetic, python = slowness()
    each = _PER_PRODUCT + _PER_POINT * cells * count
    if steps.solver == "propagator":
        window = RUN + 2 * steps.reach
        fields = sum(len(b.macro + b.micro) ** 2 for b in simulated.blocks)
        each += _PER_FLOP * 2.0 * cells * window * fields
    seconds = arithmetic * steps.operator_products * each
    seconds += python * (_START + _COMPILE.get(steps.solver, 2.0))
    seconds += arithmetic * numbers * 8 * _PER_STORED / 4
    chunk = 8.0 * cells * count * (12 + 8 * chunk_frames(simulated))
    if not page:
        return Cost(seconds, _LOADED / 2 + chunk + 2 * 8 * numbers, 0.0)
    seconds += python * _PAGE + arithmetic * numbers * 8 * (_PER_STORED + _PER_READ)
    waves = min(cells // 2 + 1, MOST_WAVENUMBERS)
    memory, disk = _LOADED + chunk, _PACKED * numbers + _SHOWN
    if simulated.endless:
        seconds += python * _ENDLESS
        memory += 8.0 * frames * waves * (6 + 2 * len(simulated.blocks))
        disk += 8.0 * frames * waves * len({block.sector for block in simulated.blocks}) / 2
    else:
        signals = float(frames) * len(simulated.receivers) * len(simulated.layers.layers)
        seconds += python * _BAR + arithmetic * _PER_SIGNAL * signals * len(simulated.blocks)
        memory += 8.0 * frames * 64 * max(len(simulated.receivers), 1)
    return Cost(seconds, memory, disk)


def check_cost(
    simulated: Simulation, found: Cost, at_most: float = HOUR, folder: Path | None = None
) -> None:
    """Hold a run to this machine's memory, to the room on its disk and to a time.

    Args:
        simulated: the simulation.
        found: what it takes.
        at_most: longest time, s.
        folder: that it writes into; None where it writes nothing.

    Raises:
        ValueError: it takes more; the message says how much, and what would fit.
    """
    memory = _PART_OF_MEMORY * os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES")
    room = float("inf") if folder is None else _free(folder)
    given = f"duration = {simulated.duration:g}"
    frames, cells = simulated.frames, simulated.bar.cells
    asked = f"{given}: {frames} frames of {cells} cells take {found.in_words}"
    if found.memory > memory:
        part = max(memory - _LOADED, 0.0) / (found.memory - _LOADED)
        raise ValueError(
            f"{asked}; more memory than {size(memory)}, which this machine has to give: take at "
            f"most {_rounded(cells * part)} cells, or fewer [time] samples"
        )
    if found.disk > room:
        raise ValueError(
            f"{asked}; more disk than {size(room)}, which is free there: take at most "
            f"{_rounded(frames * room / found.disk)} [time] samples, make room, or name another "
            "folder with --out"
        )
    if found.seconds > at_most:
        part = at_most / found.seconds
        raise ValueError(
            f"{asked}; longer than {duration_in_words(at_most)}: take at most "
            f"duration = {simulated.duration * part:.2g}, or allow more with --at-most "
            f"{max(1, round(1.5 * found.seconds / HOUR))}h (at_most in Python)"
        )


def _rounded(count: float) -> str:
    """Two digits of a number, downwards."""
    whole = max(int(count), 0)
    step = 10 ** max(len(str(whole)) - 2, 0)
    return str(whole // step * step)


def _free(folder: Path) -> float:
    """Bytes free where a folder is, or is to be."""
    import shutil

    place = folder.absolute()
    while not place.exists() and place != place.parent:
        place = place.parent
    try:
        return float(shutil.disk_usage(place).free)
    except OSError:
        return float("inf")


def seconds_of(text: str) -> float:
    """A time such as "90", "90s", "30min", "2h", "1d" or "1w", s.

    Raises:
        ValueError: it is none.
    """
    units = {"": 1.0, "s": 1.0, "min": 60.0, "h": HOUR, "d": 24 * HOUR, "w": 168 * HOUR}
    number = text.strip().rstrip("abcdefghijklmnopqrstuvwxyz")
    unit = units.get(text.strip()[len(number) :])
    try:
        value = float(number) * unit if unit else 0.0
    except ValueError:
        value = 0.0
    if not (value > 0 and value < float("inf")):
        raise ValueError("must be a time such as 90s, 30min, 2h or 1d")
    return value
