"""The table of docs/calibration.md: how often 95 % bars hold the truth.

python benchmarks/calibration.py            # all, some minutes of processor time; writes the table
python benchmarks/calibration.py --seeds 4 --only line --print
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from wavesim.readings.dispersion.frequency_at_wavenumber import in_time
from wavesim.readings.dispersion.points import BranchPoints
from wavesim.readings.dispersion.wavenumber_at_frequency import in_space
from wavesim.records.fitness import for_frequency_at_k, for_k_at_frequency
from wavesim.records.record import Record, RecordError, record

Made = tuple[Any, Any, Any, dict[str, Any]]
PAGE = Path(__file__).parent.parent / "docs" / "calibration.md"
SPEED = 3000.0


def acoustic(k: Any) -> Any:
    return 2000.0 * k


def optical(k: Any) -> Any:
    return np.sqrt(2e6**2 + (1500 * k) ** 2)


def ring(rng: Any) -> Made:
    """64 receivers round a ring, two branches, random phases both ways; 600 frames."""
    x, t = np.arange(64) * 1e-3, np.arange(600) * 2e-7
    k = 2 * np.pi * np.arange(1, 29) / 0.064
    u = np.zeros((len(t), len(x)))
    for omega, size in ((acoustic, 1.0), (optical, 0.7)):
        for sign in (1, -1):
            phase = rng.uniform(0, 2 * np.pi, len(k))
            wave = np.exp(1j * (sign * np.outer(k, x) + phase[:, None]))
            u += size * (np.exp(-1j * np.outer(t, omega(k))) @ wave).real
    return u / np.abs(u).max(), t, x, {"ring": True}


def chain(rng: Any) -> Made:
    """A lattice of 48 sites, ω = 10⁶ |sin(ka/2)|, struck at random."""
    x, t = np.arange(48) * 1e-3, np.arange(800) * 1e-6
    k = 2 * np.pi * np.arange(1, 24) / 0.048
    u = np.zeros((len(t), len(x)))
    for sign in (1, -1):
        phase = rng.uniform(0, 2 * np.pi, len(k))
        wave = np.exp(1j * (sign * np.outer(k, x) + phase[:, None]))
        u += (np.exp(-1j * np.outer(t, lattice(k))) @ wave).real
    return u / np.abs(u).max(), t, x, {"ring": True, "lattice": True}


def lattice(k: Any) -> Any:
    return 1e6 * np.abs(np.sin(k * 5e-4))


def sent(x: Any, t: Any, waves: Any, f0: float) -> Any:
    """A Ricker pulse through U = S Σ A(x, ω) e^{ikx}; a wave is (k(ω), A(x))."""
    n = 8 * len(t)
    a = (np.pi * f0 * (np.arange(n) * (t[1] - t[0]) - 1.5 / f0)) ** 2
    spectrum = np.fft.rfft((1 - 2 * a) * np.exp(-a))
    omega = 2 * np.pi * np.fft.rfftfreq(n, t[1] - t[0])
    through = [sum(size(q) * np.exp(-1j * k(omega) * q) for k, size in waves) for q in x]
    u = np.fft.irfft(spectrum * np.array(through), n, axis=1)[:, : len(t)].T
    return u / np.abs(u).max()


def plain(omega: Any) -> Any:
    return omega / SPEED


def dispersive(omega: Any) -> Any:
    return omega / (2000 + 300 / (1 + (omega / 3e5) ** 2))


def even(x: Any) -> Any:
    return 1.0 + 0 * x


def line(rng: Any, waves: Any = ((dispersive, even),), count: int = 24) -> Made:
    """24 receivers 5 mm apart, a pulse of 40 kHz that passes them, c from 2000 to 2300 m/s."""
    x, t = 0.05 + 0.005 * np.arange(count), np.arange(600) * 1e-6
    return sent(x, t, waves, 4e4), t, x, {}


def lossy_line(rng: Any) -> Made:
    """The line with amplitudes r^−½ e^{−10r}."""
    return line(rng, ((dispersive, lambda r: r**-0.5 * np.exp(-10 * r)),))


def two_modes(rng: Any) -> Made:
    """The line with a second mode of 3600 m/s and 0.4 of the amplitude; 48 receivers."""
    return line(rng, ((dispersive, even), (lambda w: w / 3600, lambda r: 0.4 + 0 * r)), 48)


def few(rng: Any) -> Made:
    """Eight receivers 5 mm apart, a pulse of 50 kHz, 3000 m/s."""
    x, t = 0.02 + 0.005 * np.arange(8), np.arange(1000) * 5e-7
    return sent(x, t, ((plain, even),), 5e4), t, x, {}


def few_uneven(rng: Any) -> Made:
    """Five receivers at uneven places, a loss of 8 Np/m."""
    x, t = np.array([0.02, 0.027, 0.039, 0.046, 0.062]), np.arange(1000) * 5e-7
    return sent(x, t, ((plain, lambda q: np.exp(-8 * q)),), 5e4), t, x, {}


def apart(rng: Any) -> float:
    """How far two modes are apart, of 2π/T or 2π/X: all sizes from one hundredth to 2.5 alike."""
    return float(0.01 * 250 ** rng.uniform())


def close_ring(rng: Any) -> Made:
    """32 receivers round a ring, two waves at each k, 0.01 to 2.5 of 2π/T apart, in phase."""
    x, t = np.arange(32) * 1e-3, np.arange(400) * 2e-7
    k = 2 * np.pi * np.arange(1, 16) / 0.032
    gap, size = apart(rng), rng.uniform(0.3, 1)
    u = np.zeros((len(t), len(x)))
    for sign in (1, -1):
        phase = rng.uniform(0, 2 * np.pi, len(k))
        wave = np.exp(1j * (sign * np.outer(k, x) + phase[:, None]))
        for part, more in ((1.0, 0.0), (size, gap)):
            omega = acoustic(k) + more * 2 * np.pi / 8e-5
            u += part * (np.exp(-1j * np.outer(t, omega)) @ wave).real
    return u / np.abs(u).max(), t, x, {"ring": True, "apart": gap}


def close_line(rng: Any, count: int = 24, loss: float = 0.0) -> Made:
    """The line with a second mode, 0.01 to 2.5 of 2π/X apart at 40 kHz."""
    x, t = 0.05 + 0.005 * np.arange(count), np.arange(600) * 1e-6
    gap, size = apart(rng), rng.uniform(0.3, 1)

    def second(omega: Any) -> Any:
        return slower(gap, count)(omega)

    def fall(r: Any) -> Any:
        return np.exp(-loss * (r - x[0]) / np.ptp(x))

    waves = (dispersive, fall), (second, lambda r: size * fall(r))
    return sent(x, t, waves, 4e4), t, x, {"apart": gap}


def slower(gap: float, count: int) -> Callable[[Any], Any]:
    """k of the second mode."""
    part = gap * 2 * np.pi / (0.005 * (count - 1)) / dispersive(2 * np.pi * 4e4)
    return lambda omega: (1 + part) * dispersive(omega)


def close_few(rng: Any) -> Made:
    """Ten receivers of that line, both modes losing 2 nepers over them."""
    return close_line(rng, 10, 2.0)


def as_is(made: Made, rng: Any) -> Made:
    return made


def noisy(part: float) -> Callable[[Made, Any], Made]:
    def spoil(made: Made, rng: Any) -> Made:
        u, t, x, more = made
        return u + part * rng.normal(size=u.shape), t, x, more

    return spoil


def with_noise(spoil: Callable[[Any, Any, Any, Any], Any], part: float = 1e-3) -> Any:
    def both(made: Made, rng: Any) -> Made:
        u, t, x, more = noisy(part)(made, rng)
        return spoil(u, t, x, rng), t, x, more

    return both


def in_band(u: Any, t: Any, x: Any, rng: Any) -> Any:
    """Noise of 1 % below a quarter of the Nyquist frequency alone: a filter before it."""
    noise = np.fft.rfft(rng.normal(size=u.shape), axis=0)
    noise[len(noise) // 4 :] = 0
    back = np.fft.irfft(noise, len(u), axis=0)
    return u + 0.01 * back / back.std()


def low_passed(made: Made, rng: Any) -> Made:
    u, t, x, more = made
    quiet = 300 if not more.get("ring") else 0
    step = t[1] - t[0]
    u = np.concatenate([np.zeros((quiet, u.shape[1])), u])
    t = np.concatenate([t[0] - step * np.arange(quiet, 0, -1), t])
    return in_band(u, t, x, rng), t, x, more


def rounded(made: Made, rng: Any) -> Made:
    u, t, x, more = noisy(1e-3)(made, rng)
    step = t[1] - t[0]
    digit = 10.0 ** np.floor(np.log10(step / 8))
    return u, np.round(t / digit) * digit, x, more


def placed_roughly(made: Made, rng: Any) -> Made:
    u, t, x, more = noisy(1e-3)(made, rng)
    return u, t, np.float32(x).astype(float), more


def padded(made: Made, rng: Any) -> Made:
    u, t, x, more = noisy(0.01)(made, rng)
    step = t[1] - t[0]
    u = np.concatenate([u, np.zeros((len(u), len(x)))])
    return u, t[0] + step * np.arange(len(u)), x, more


def jittered(made: Made, rng: Any) -> Made:
    u, t, x, more = noisy(1e-3)(made, rng)
    late = 0.05 * (t[1] - t[0]) * rng.normal(size=len(t))
    return u + np.gradient(u, t, axis=0) * late[:, None], t, x, more


def moved(made: Made, rng: Any) -> Made:
    u, t, x, more = noisy(1e-3)(made, rng)
    shift = 0.01 * (x[1] - x[0]) * rng.normal(size=len(x))
    if not more.get("ring"):
        return u + np.gradient(u, x, axis=1) * shift, t, x, more
    k = 2j * np.pi * np.fft.fftfreq(len(x), x[1] - x[0])
    k[len(x) // 2] *= len(x) % 2
    hat = np.fft.fft(u, axis=1)
    slope, bend = (np.fft.ifft(k**n * hat, axis=1).real for n in (1, 2))
    return u + slope * shift + bend * shift**2 / 2, t, x, more


FAULTS: dict[str, Callable[[Made, Any], Made]] = {
    "none": as_is,
    "noise 0.1 %": noisy(1e-3),
    "noise 1 %": noisy(0.01),
    "noise 5 %": noisy(0.05),
    "noise 1 % in the band alone": low_passed,
    "8 bits": lambda made, rng: (np.round(made[0] * 100) + 128, *made[1:]),
    "12 bits": lambda made, rng: (np.round(made[0] * 2000), *made[1:]),
    "offset 10 %": with_noise(lambda u, t, x, rng: u + 0.1),
    "gains 1 %": with_noise(lambda u, t, x, rng: u * (1 + 0.01 * rng.normal(size=len(x)))),
    "gains 10 %": with_noise(lambda u, t, x, rng: u * (1 + 0.1 * rng.normal(size=len(x)))),
    "times rounded": rounded,
    "positions in single precision": placed_roughly,
    "half of it zeros": padded,
    "jitter 5 % of Δt": jittered,
    "receivers misplaced, 1 % of d": moved,
    "one dead": with_noise(lambda u, t, x, rng: np.where(np.arange(len(x)) == 3, 0, u)),
}


def along(truths: Any) -> Callable[..., tuple[Any, Any]]:
    """Off and bar of ω at given k against the nearest branch."""

    def off(points: BranchPoints, gap: float) -> tuple[Any, Any]:
        exact = np.stack([truth(points.k) for truth in truths])
        return np.abs(exact - points.omega).min(axis=0), points.bar

    return off


def at_frequency(truths: Any) -> Callable[..., tuple[Any, Any]]:
    """Off and bar of k at given ω against the nearest mode."""

    def off(points: BranchPoints, gap: float) -> tuple[Any, Any]:
        exact = np.stack([truth(points.omega) for truth in truths])
        bar = points.bar if points.in_space else 1.96 * points.k_error
        return np.abs(exact - points.k).min(axis=0), bar

    return off


def either(points: BranchPoints, gap: float) -> tuple[Any, Any]:
    """Of two close branches; where bars are single waves' they count with half the splitting."""
    both = [acoustic, lambda k: acoustic(k) + gap * 2 * np.pi / 8e-5]
    off, bar = along(both)(points, gap)
    return off, bar + (points.splitting / 2 if points.method == "harmonic" else 0)


def either_along(points: BranchPoints, gap: float) -> tuple[Any, Any]:
    """The same of two close modes of a line."""
    count, loss = (10, 2j / 0.045) if points.in_space else (24, 0)
    both = [lambda w: dispersive(w) + loss, lambda w: slower(gap, count)(w) + loss]
    off, bar = at_frequency(both)(points, gap)
    return off, bar + (points.splitting / 2 if points.in_space else 0)


def by(method: str) -> Callable[[Record], BranchPoints]:
    return lambda made: in_time(for_frequency_at_k(made, method == "harmonic"), method=method)


def attenuation(made: Record) -> BranchPoints:
    return in_space(for_k_at_frequency(made), 2 * np.pi * np.linspace(1e4, 1e5, 25))


def lossy(omega: Any) -> Any:
    return omega / SPEED + 8j


ROWS: tuple[tuple[str, Any, str, Any, Any], ...] = (
    ("ring", ring, "dispersion, harmonic", by("harmonic"), along((acoustic, optical))),
    ("ring", ring, "dispersion, fft", by("fft"), along((acoustic, optical))),
    ("chain", chain, "dispersion, harmonic", by("harmonic"), along((lattice,))),
    ("chain", chain, "dispersion, fft", by("fft"), along((lattice,))),
    ("line", line, "dispersion, along the line", by("auto"), at_frequency((dispersive,))),
    ("lossy line", lossy_line, "dispersion, along the line", by("auto"),
     at_frequency((dispersive,))),
    ("two modes", two_modes, "dispersion, along the line", by("auto"),
     at_frequency((dispersive, lambda w: w / 3600))),
    ("eight receivers", few, "attenuation", attenuation, at_frequency((plain,))),
    ("five receivers, uneven", few_uneven, "attenuation", attenuation, at_frequency((lossy,))),
    ("close, ring", close_ring, "dispersion, harmonic", by("harmonic"), either),
    ("close, ring", close_ring, "dispersion, fft", by("fft"), either),
    ("close, line", close_line, "dispersion, along the line", by("auto"), either_along),
    ("close, ten receivers", close_few, "attenuation", attenuation, either_along),
)  # fmt: skip


def cell(make: Any, fault: Any, read: Any, held: Any, seeds: int) -> tuple[int, int, float, str]:
    """Points, those within their bars, median error over bar, and why there are none."""
    points, within, ratios, reason = 0, 0, [], ""
    for seed in range(seeds):
        rng = np.random.default_rng(seed)
        u, t, x, more = fault(make(rng), rng)
        gap = more.pop("apart", 0.0)
        try:
            found = read(record(u, t, x, **more))
        except RecordError as error:
            reason = str(error)
            continue
        own = found.take(found.valid)
        if not len(own):
            reason = str(max(set(found.reason), key=list(found.reason).count)) or "no points"
            continue
        off, bar = held(own, gap)
        points += len(own)
        within += int((off <= bar).sum())
        ratios += list(off / np.maximum(bar, 1e-300))
    return points, within, float(np.median(ratios)) if ratios else float("nan"), reason


def table(seeds: int, only: str | None, skipped: str | None) -> list[list[str]]:
    """Rows of the table."""
    rows = []
    for kind, make, method, read, held in ROWS:
        name = f"{kind}, {method}"
        if (only and only not in name) or (skipped and skipped in name):
            continue
        for fault_name, fault in FAULTS.items():
            n, inside, ratio, reason = cell(make, fault, read, held, seeds)
            told = f"{100 * inside / n:.0f} %" if n else f"refused: {reason.split(':')[0]}"
            rows.append([kind, method, fault_name, str(n), told, "–" if not n else f"{ratio:.2g}"])
            print(*rows[-1], sep=" | ", flush=True)
    return rows


def known() -> list[list[str]]:
    """Rows of the table as it is."""
    if not PAGE.is_file():
        return []
    lines = PAGE.read_text(encoding="utf-8").splitlines()
    rows = [[c.strip() for c in line.strip("|").split("|")] for line in lines if line[:2] == "| "]
    return [row for row in rows if len(row) == 6 and row[0] != "record"]


HEAD = """# Calibration of the bars

How often a 95 % bar holds the truth, for points called valid: by kind of record, fault, and
method. Made by `python benchmarks/calibration.py`. Over the whole table: {share:.1f} % of {points}
points, without the rows of close modes {single:.1f} %.

Without noise a bar is what rounding and the record's end leave open, and holds nearly always.
Where receivers' gains, places or clocks are off, the error is one for the whole record, so that
the points of a record are off together. Bars of fft are its resolution, as far as noise leaves it,
and wider than the errors of lone modes mostly are; so are those along a line where receivers differ
in gain, as they would if a second mode were there.
Two modes that are not told apart bend the logarithm of what stands for both, and a bar holds that
from where it shows. Modes closer than noise lets a bend be seen pass for one between them. Of
`--method fft` bars hold that, of modes along a line down to a tenth of 2π/X (what the rows of close
lines lack is of closer ones, and off by a hundredth of 2π/X). Those of harmonic
inversion and of `attenuation` are of single waves: bars that held such pairs would be ten to thirty
times as wide, and too wide for all else. What they leave out stands beside each point as its
`splitting`, the distance of two waves up to which they pass for one (at 1 % of noise 0.07 to 0.1 of
2π/T in time, 0.16 to 0.5 of 2π/X along ten receivers, the more the waves lose over them; less where
there is less noise), and one of the two is within the bar and half the splitting, as is counted in
the rows of close modes.

{about}

| record | method | fault | points | within bars | error over bar, median |
|---|---|---|---|---|---|
"""


def shares(rows: list[list[str]]) -> tuple[int, float]:
    """Points of some rows, and how many of a hundred are within bars."""
    counted = [(int(row[3]), float(row[4].split()[0])) for row in rows if row[3] != "0"]
    points = sum(n for n, _ in counted)
    return points, sum(n * part for n, part in counted) / max(points, 1)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=12, help="records for each cell")
    parser.add_argument("--only", help="kinds and methods with this in their name; others stay")
    parser.add_argument("--skip", help="not those with this in their name")
    parser.add_argument("--print", action="store_true", dest="dry", help="write nothing")
    options = parser.parse_args()
    rows = table(options.seeds, options.only, options.skip)
    if options.dry:
        return
    merged = {tuple(row[:3]): row for row in [*known(), *rows]}
    order = [(kind, method, fault) for kind, _, method, *_ in ROWS for fault in FAULTS]
    rows = [merged[key] for key in order if key in merged]
    points, share = shares(rows)
    _, single = shares([row for row in rows if not row[0].startswith("close")])
    kinds = {kind: make.__doc__ for kind, make, *_ in ROWS}
    about = "\n".join(f"- *{kind}*: {text}" for kind, text in kinds.items())
    head = HEAD.format(share=share, points=points, single=single, about=about)
    body = "\n".join("| " + " | ".join(row) + " |" for row in rows)
    PAGE.write_text(head + body + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
