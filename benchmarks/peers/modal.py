"""The exact modal propagator: FFT in space, eigenvectors of each wavenumber's small matrix.

    q̂(t) = Σ V Im[e^{iωt} P(t)] Vᵀĝ,    P(t) = ∫₀ᵗ e^{−iωτ} s(τ) dτ / ω

Once the pulses are over P is their spectrum, known in closed form, so the final field takes one
turn of every mode and twelve inverse FFTs. ``Frames`` gives 400 frames in between as well. It
exists for uniform periodic bars alone.
"""

from __future__ import annotations

from typing import ClassVar

import numpy as np
import scipy.fft
from contestant import Solution
from numpy.typing import NDArray
from problem import COMPONENTS, Drive, Problem

from wavesim.grid.stencils import modified_wavenumber
from wavesim.material.scaling import block_coefficients, scales
from wavesim.material.sectors import BLOCKS

Complex = NDArray[np.complex128]

_WORKERS = 2
_NODES = 24  # Gauss nodes in a frame's interval of half a unit: 9 radians of the fastest mode


class _Modes:
    """One block: frequencies (k, modes), vectors, and its driven modes."""

    def __init__(self, problem: Problem, number: int, first: int, k: np.ndarray) -> None:
        form = block_coefficients(problem.medium, BLOCKS[number], scales(problem.medium))
        wave = modified_wavenumber(k, problem.spacing, problem.bar.order)
        p, size = len(form.c_pp), len(form.c_pp) + len(form.c_bb)
        # D acts as i k̃ e^{ikh/2}; with i e^{ikh/2} taken into B̂ the matrices are real, and
        # symmetric, the problem's closure being consistent.
        K = np.zeros((len(k), size, size))
        K[:, :p, :p] = wave[:, None, None] ** 2 * form.c_pp
        K[:, :p, p:] = -wave[:, None, None] * form.c_pb
        K[:, p:, :p] = -wave[:, None, None] * form.c_bp
        K[:, p:, p:] = form.c_bb + wave[:, None, None] ** 2 * form.gamma
        squares, self.V = np.linalg.eigh(K)
        self.omega = np.sqrt(np.maximum(squares, 1e-30))
        self.shift = np.ones((size, len(k)), dtype=complex)
        self.shift[p:] = 1j * np.exp(0.5j * k * problem.spacing)
        self.driven: list[tuple[Drive, Complex]] = []
        for drive in problem.drives:
            i = drive.component - first
            if 0 <= i < size:
                ghat = drive.strength * np.exp(-1j * k * drive.cell * problem.spacing)
                self.driven.append((drive, self.V[:, i, :] * (ghat / self.shift[i])[:, None]))

    def final(self) -> list[tuple[Complex, Complex]]:
        """For each drive (P, Vᵀĝ) after all pulses."""
        made = []
        for drive, g in self.driven:
            unit = drive.time_scale
            spectrum = drive.pulse.spectrum(self.omega / unit) / unit
            made.append((spectrum.conj() / self.omega, g))
        return made

    def early(self, interval: float, count: int) -> list[tuple[Complex, Complex]]:
        """For each drive (P at the first ``count`` frames, Vᵀĝ), by Gauss sums."""
        nodes, weights = np.polynomial.legendre.leggauss(_NODES)
        tau, weights = interval * (nodes + 1) / 2, interval * weights / 2
        start = interval * np.arange(count)
        within = np.exp(-1j * np.multiply.outer(tau, self.omega)) / self.omega
        before = np.exp(-1j * np.multiply.outer(start, self.omega))
        made = []
        for drive, g in self.driven:
            signal = weights * drive.signal(start[:, None] + tau)
            made.append((np.cumsum(before * np.tensordot(signal, within, 1), axis=0), g))
        return made

    def hat(self, pairs: list[tuple[Complex, Complex]], turn: Complex) -> Complex:
        """q̂ of the block's components, (size, k), for e^{iωt} = turn."""
        modal = sum(((turn * P).imag * g for P, g in pairs), start=np.zeros(turn.shape, complex))
        return np.asarray((self.V @ modal[..., None])[..., 0].T * self.shift)


class Peer:
    kind: ClassVar[str] = "none"
    least_steps = 0
    frames: ClassVar[int] = 1

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        k = 2 * np.pi * scipy.fft.rfftfreq(problem.bar.cells, problem.spacing)
        firsts = np.cumsum([0, *(len(b.rotations) + len(b.curvatures) for b in BLOCKS)])
        self.blocks = [
            (int(first), _Modes(problem, number, int(first), k))
            for number, first in enumerate(firsts[:-1])
        ]

    def warm_up(self, setting: float) -> None:
        self.run(setting)

    def run(self, setting: float) -> Solution:
        return Solution(self.problem.fields(self._states()[-1]), None)

    def _states(self) -> np.ndarray:
        """Scaled states at the frames, (frames, 12, N)."""
        n, interval = self.problem.bar.cells, self.problem.duration / self.frames
        early = min(int(self.problem.quiet_from / interval), self.frames - 1)
        spectrum = np.empty((self.frames, COMPONENTS, n // 2 + 1), dtype=complex)
        for first, block in self.blocks:
            rows = slice(first, first + block.V.shape[1])
            during, after = block.early(interval, early) if early else [], block.final()
            turn = step = np.exp(1j * block.omega * interval)
            for frame in range(self.frames):
                pairs = [(P[frame], g) for P, g in during] if frame < early else after
                spectrum[frame, rows] = block.hat(pairs, turn)
                turn = turn * step
        return np.asarray(scipy.fft.irfft(spectrum, n, workers=_WORKERS, overwrite_x=True))


class Frames(Peer):
    """The same with 400 frames."""

    frames: ClassVar[int] = 400
