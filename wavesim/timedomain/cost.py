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

from wavesim.material.medium import fastest_speed
from wavesim.simulation.field import MOST_WAVENUMBERS
from wavesim.simulation.simulation import Simulation
from wavesim.timedomain.time_step import RUN, TimeStep, chunk_frames

# Seconds on the machine that was measured on, quiet; products of states in the cache take less.
_START, _COMPILE = 1.6, {"propagator": 1.0, "chebyshev": 1.2}
_PER_FLOP, _PER_PRODUCT, _PER_POINT, _CACHED = 3.0e-11, 1.0e-5, (4.0e-9, 1.1e-8), 4.0e4
_PER_STORED, _PER_READ = 8.0e-9, 3.0e-9  # a byte
_ENDLESS, _PER_SPECTRUM, _BAR, _PER_SIGNAL, _PAGE = 0.5, 6.0e-8, 0.6, 2.0e-7, 1.2
# Bytes: what is loaded and compiled, here and in the process beside; how many times a chunk and a
# state are held; what a packed number takes where waves are; page and picture.
_LOADED, _CHUNKS, _STATES, _PACKED, _SHOWN = 0.48e9, 14, 20, 6.9, 5.5e6
# So much faster than waves travels what is no more than rounding, but takes as much room.
_FRONT = 1.5
_LOOKED_AT = 64
# What the same work took there: arithmetic of one thread, and a loop of Python.
_PRODUCT_THEN, _LOOP_THEN = 5.5e-5, 2.8e-3
_PART_OF_MEMORY = 0.8
# A field of so many bytes, or this part of the memory, is kept there until its run has ended.
_KEPT, _PART_KEPT = 0.5e9, 0.05
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
    state = float(cells * count)
    near, far = _PER_POINT
    each = _PER_PRODUCT + state * (near + far * state / (state + _CACHED))
    if steps.solver == "propagator":
        window = RUN + 2 * steps.reach
        fields = sum(len(b.macro + b.micro) ** 2 for b in simulated.blocks)
        each += _PER_FLOP * 2.0 * cells * window * fields
    seconds = arithmetic * steps.operator_products * each
    seconds += python * (_START + _COMPILE.get(steps.solver, 1.0))
    memory = _LOADED + 8.0 * state * (_STATES + _CHUNKS * chunk_frames(simulated))
    if not page:
        return Cost(seconds, memory + 2 * 8 * numbers, 0.0)
    if in_memory(simulated):
        memory += 2 * 8 * numbers  # each of two processes is said to hold it
    moving = numbers * _reached(simulated)
    seconds += python * _PAGE + arithmetic * 8 * (moving * _PER_STORED + numbers * _PER_READ)
    waves = min(cells // 2 + 1, MOST_WAVENUMBERS)
    disk = _PACKED * moving + 0.02 * numbers + _SHOWN
    if simulated.endless:
        seconds += python * _ENDLESS + arithmetic * _PER_SPECTRUM * numbers
        memory += 8.0 * frames * waves * 4
        disk += 8.0 * frames * waves * len({block.sector for block in simulated.blocks}) / 2
    else:
        signals = float(frames) * len(simulated.receivers) * len(simulated.layers.layers)
        seconds += python * _BAR + arithmetic * _PER_SIGNAL * signals * len(simulated.blocks)
    return Cost(seconds, memory, disk)


def in_memory(simulated: Simulation) -> bool:
    """Whether a run keeps its field in memory until it has ended, beside storing it."""
    size = 8.0 * simulated.frames * simulated.bar.cells * len(simulated.fields)
    return size <= min(_KEPT, _PART_KEPT * _memory())


def _memory() -> float:
    """Memory of this machine, bytes."""
    return float(os.sysconf("SC_PAGE_SIZE") * os.sysconf("SC_PHYS_PAGES"))


def _reached(simulated: Simulation) -> float:
    """Part of the bar that anything reaches, mean over the run: at rest it takes no room."""
    bar, layers = simulated.bar, simulated.layers
    speed = _FRONT * max(fastest_speed(medium) for medium in layers.media)
    found = []
    for t in np.linspace(0.0, simulated.duration, _LOOKED_AT):
        spans = []
        for source in simulated.sources:
            reach = speed * max(t - max(source.onset, 0.0), 0.0) + 4 * source.width
            for shift in (-bar.length, 0.0, bar.length) if bar.periodic else (0.0,):
                low, high = source.position + shift - reach, source.position + shift + reach
                spans.append((max(low, 0.0), min(high, bar.length)))
        total, end = 0.0, 0.0
        for low, high in sorted(spans):
            total += max(0.0, high - max(low, end))
            end = max(end, high)
        found.append(total / bar.length)
    return float(np.mean(found))


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
    memory = _PART_OF_MEMORY * _memory()
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
