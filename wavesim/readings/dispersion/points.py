"""Branch points: what every method of extraction returns, whatever it started from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from wavesim.material.shown import Shown

if TYPE_CHECKING:
    import xarray


Float = NDArray[Any]

# A 95 % bar is this many standard errors.
BAR = 1.959963984540054
# … and for the modulus of a complex number with that much in both parts together, √ln 20.
COMPLEX_BAR = 1.7308183826022854
CUT = (
    "the record begins or ends inside the signal: what its ends leave of other frequencies is as "
    "strong there; record from before to after it, or listen nearer to the source"
)
ALONE = "stands alone: no branch goes on from it"


# How points were found, in words.
METHODS = {
    "harmonic": "by harmonic inversion",
    "fft": "by FFT",
    "beam": "by the phases along the line",
    "space": "by fits along the line",
}


@dataclass(frozen=True, repr=False)
class BranchPoints(Shown):
    """Points (k, ω) of dispersion branches, in arrays of shape (m,).

    Attributes:
        method: "harmonic" or "fft" (ω at given k), "beam" (waves along a line, at given ω), or
            "space" (complex k at given ω).
        k: wavenumber, rad/m; complex for "space": Re k along x, Im k > 0 decay.
        omega: angular frequency, rad/s; for "space" complex, ω + iσ, the frequency at which k was
            measured.
        decay: temporal decay γ at given k, 1/s; 0 where the method has none.
        amplitude: unit of the record.
        error: standard error of ω (rad/s) or, for "space", of the modulus of k (rad/m).
        residual: part of the power at that k or ω that the points there do not explain.
        valid: whether the point counts.
        reason: why not, "" where it does.
        branch: number of its branch, joined by continuity; −1 for none.
        k_error: for "beam", standard error of k at given ω, rad/m; None else.
        splitting: two waves nearer to each other than this, in ω (rad/s) or, for "space", in k
            (rad/m), pass for one, which is within half of it of one of them; None if not known.
    """

    method: str
    k: Float
    omega: Float
    decay: Float
    amplitude: Float
    error: Float
    residual: Float
    valid: NDArray[np.bool_]
    reason: NDArray[Any]
    branch: NDArray[np.int64]
    k_error: Float | None = None
    splitting: Float | None = None

    def __len__(self) -> int:
        return len(self.k)

    @property
    def in_space(self) -> bool:
        """Whether k was measured at given ω, rather than ω at given k."""
        return self.method == "space"

    @property
    def bar(self) -> Float:
        """Half-width of the 95 % error bar, unit of the error."""
        return (COMPLEX_BAR if self.in_space else BAR) * self.error

    @property
    def phase_velocity(self) -> Float:
        """c = ω/|Re k|, m/s."""
        return np.asarray(np.real(self.omega) / np.maximum(np.abs(np.real(self.k)), 1e-290))

    @property
    def phase_velocity_error(self) -> Float:
        """Standard error of c at given k or, for "beam" and "space", at given ω, m/s."""
        error = self.error if self.in_space else self.k_error
        if error is None:
            return np.asarray(self.error / np.maximum(self.k, 1e-290))
        return self.phase_velocity * error / np.maximum(np.abs(np.real(self.k)), 1e-290)

    @property
    def branches(self) -> tuple[int, ...]:
        """Numbers of the branches."""
        return tuple(int(b) for b in np.unique(self.branch[self.branch >= 0]))

    def told(self) -> dict[str, str]:
        """Method, how many count, how large the bars are."""
        own = self.take(self.valid)
        told = {
            "method": self.method,
            "points": f"{len(own)} valid of {len(self)}",
            "branches": str(len(own.branches)),
        }
        if len(own):
            size = np.abs(own.k if self.in_space else own.omega)
            median = float(np.median(own.bar / np.where(size > 0, size, np.nan)))
            told["95 % bar, median"] = f"{median:.1e} of {'|k|' if self.in_space else 'ω'}"
        return told

    def to_xarray(self) -> xarray.Dataset:
        """The points as a data set over their number, the names of columns with their units."""
        import xarray

        return xarray.Dataset(
            {name: ("point", np.asarray(values)) for name, values in self.columns().items()},
            attrs={"method": self.method},
        )

    def take(self, which: Any) -> BranchPoints:
        """The points at an index or mask."""
        known = [n for n in (*_COLUMNS, *_OPTIONAL) if getattr(self, n) is not None]
        kept: dict[str, Any] = {n: getattr(self, n)[which] for n in known}
        return replace(self, **kept)

    def refused(self, where: Any, reason: str) -> BranchPoints:
        """The points with those at a mask no longer valid; an earlier reason stays."""
        where = np.asarray(where) & self.valid
        return replace(
            self,
            valid=self.valid & ~where,
            reason=np.where(where, reason, self.reason),
        )

    def known(self) -> BranchPoints:
        """The points with those no longer valid whose error bar is as large as what they tell."""
        size, name = (np.abs(self.k), "k") if self.in_space else (self.omega, "ω")
        return self.refused(~(self.bar < size), f"the error bar is as large as {name}")

    def columns(self) -> dict[str, Float]:
        """Columns for a table, real numbers only, names with units."""
        table: dict[str, Float] = {"branch": self.branch}
        if self.in_space:
            table |= {
                "omega_rad_per_s": self.omega.real,
                "sigma_rad_per_s": self.omega.imag,
                "k_real_rad_per_m": self.k.real,
                "k_imag_rad_per_m": self.k.imag,
                "k_error_rad_per_m": self.error,
            }
        else:
            table |= {
                "k_rad_per_m": self.k,
                "omega_rad_per_s": self.omega,
                "omega_error_rad_per_s": self.error,
                "decay_per_s": self.decay,
                "phase_velocity_m_per_s": self.phase_velocity,
                "phase_velocity_error_m_per_s": self.phase_velocity_error,
            }
        if self.splitting is not None:
            unit = "rad_per_m" if self.in_space else "rad_per_s"
            table[f"splitting_{unit}"] = self.splitting
        return table | {
            "amplitude": self.amplitude,
            "residual": self.residual,
            "valid": self.valid,
            "reason": self.reason,
        }


_OPTIONAL = "k_error", "splitting"
_COLUMNS = tuple(n for n in BranchPoints.__dataclass_fields__ if n not in ("method", *_OPTIONAL))


def joined(parts: list[BranchPoints]) -> BranchPoints:
    """Points of several records in one; their branches are numbered on."""
    offset, shifted = 0, []
    for part in parts:
        moved = np.where(part.branch >= 0, part.branch + offset, -1)
        shifted.append(replace(part, branch=moved))
        offset += int(part.branch.max(initial=-1)) + 1
    whole: dict[str, Any] = {n: np.concatenate([getattr(p, n) for p in shifted]) for n in _COLUMNS}
    for name in _OPTIONAL:
        known = [getattr(p, name) for p in shifted if getattr(p, name) is not None]
        whole[name] = np.concatenate(known) if len(known) == len(shifted) else None
    return replace(shifted[0], **whole)
