"""Layers as arrays that jax sees: parameters, thicknesses and losses, one entry for each layer."""

from __future__ import annotations

import dataclasses
import functools
import itertools
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.material.damping import UNDAMPED
from wavesim.material.layers import Grading, Layers
from wavesim.material.medium import Medium
from wavesim.material.several_families import together
from wavesim.planewave.band_edges import keeps_gradient
from wavesim.planewave.eigenproblem import spectral_form

# Slices of a graded layer: where Γ is left out, and at most.
_SLICES, _MOST_SLICES = 96, 4096


@jax.tree_util.register_dataclass
@dataclass(frozen=True)
class TracedLayers:
    """A stack of L layers as arrays; the first and the last medium are the half-spaces too.

    Every array may have leading axes under ``jax.vmap``. dataclasses.replace, or
    :meth:`with_values`, makes another stack of the same build.

    Attributes:
        first: {parameter of Medium: (L,)} at the start of each layer, SI; NaN where it
            follows from others, as an inertia does from R.
        last: the same at the end of each layer; None where none is graded.
        thickness: (L,), m.
        losses: {"mass", "stiffness", "unrelaxed": (L,), "rates", "strengths": (L, M)} of
            :class:`~wavesim.material.damping.Damping`; None where no layer has a law.
        kinds: of each layer, a medium of the closure at hand; its parameters do not count.
        gradings: of each layer "smooth" or "linear" where it is graded, else None.
        kept: whether the gradient term Γ is kept.
        slices: into how many a graded layer is cut at most.
    """

    first: dict[str, Any]
    last: dict[str, Any] | None
    thickness: Any
    losses: dict[str, Any] | None
    kinds: tuple[Medium, ...] = dataclasses.field(metadata={"static": True})
    gradings: tuple[Grading | None, ...] = dataclasses.field(metadata={"static": True})
    kept: bool = dataclasses.field(default=False, metadata={"static": True})
    slices: int = dataclasses.field(default=0, metadata={"static": True})

    def stretches(self) -> list[tuple[Grading | None, Any]]:
        """Layers alike in grading, and kind where they are graded, and which, from the right."""
        alike = list(zip(self.gradings, self.kinds, strict=True))
        found = itertools.groupby(
            range(len(alike) - 1, -1, -1), lambda n: alike[n] if alike[n][0] else (None, None)
        )
        return [(grading, np.array(list(members))) for (grading, _), members in found]

    def with_values(self, name: str, layers: Any, value: Any, end: str = "both") -> TracedLayers:
        """The same with a value, or one for each, laid over some layers.

        Args:
            name: "thickness" or a parameter of :class:`Medium`.
            layers: indices, shape (n,).
            value: scalar or shape (n,), SI; may be traced.
            end: of graded layers "first", "last" or "both".
        """
        at = np.asarray(layers, dtype=int)

        def laid(array: Any) -> Any:
            return jnp.asarray(array).at[..., at].set(value)

        if name == "thickness":
            return dataclasses.replace(self, thickness=laid(self.thickness))
        first, last = self.first, self.last
        if end in ("first", "both"):
            first = first | {name: laid(first[name])}
        if last is not None and end in ("last", "both"):
            last = last | {name: laid(last[name])}
        return dataclasses.replace(self, first=first, last=last)


def traced_layers(layers: Layers, gradient: bool | None = None) -> TracedLayers:
    """Layers of plain numbers as arrays, the start for gradients and batches.

    Args:
        layers: the stack, first and last layer between half-spaces of their media.
        gradient: whether Γ is kept; None lets its share decide, above 1e-9 of a layer.

    Raises:
        ValueError: Γ is so small that a graded layer would be cut into more than 4096 slices. Or
            families that share a parameter have values of their own: take the
            layers of one.
    """
    kept = keeps_gradient(layers, gradient)
    own = layers.layers
    graded = any(layer.last is not None for layer in own)
    last = _parameters([layer.last or layer.medium for layer in own]) if graded else None
    losses = None
    laws = [layer.medium.damping for layer in own]
    if any(law != UNDAMPED for law in laws):
        most = max(len(law.rates) for law in laws)
        # A rate of 1 with a strength of 0 loses nothing.
        rates = np.ones((len(own), most))
        strengths = np.zeros((len(own), most))
        for row, law in enumerate(laws):
            rates[row, : len(law.rates)] = law.rates
            strengths[row, : len(law.rates)] = law.strengths
        plain = {
            name: np.array([getattr(law, name) for law in laws], dtype=float)
            for name in ("mass", "stiffness", "unrelaxed")
        }
        losses = plain | {"rates": rates, "strengths": strengths}
    found = TracedLayers(
        first=_parameters([layer.medium for layer in own]),
        last=last,
        thickness=np.array([layer.thickness for layer in own]),
        losses=losses,
        kinds=tuple(_kind(layer.medium) for layer in own),
        gradings=tuple(None if layer.last is None else layer.grading for layer in own),
        kept=kept,
        slices=_slices(layers, kept),
    )
    return _held(found)


@jax.jit
def _held(stack: TracedLayers) -> TracedLayers:
    """The same as jax's arrays: all at once, in a twentieth of the time that they take singly."""
    return stack


def _slices(layers: Layers, kept: bool) -> int:
    """Into how many a graded layer is cut at most: two for each decay of waves that Γ carries."""
    graded = [layer for layer in layers.layers if layer.last is not None]
    if not kept or not graded:
        return _SLICES if graded else 0
    most = max(
        layer.thickness / medium.length_scale * _steepest(medium)
        for layer in graded
        for medium in layer.sampled()
    )
    if most > _MOST_SLICES:
        raise ValueError(
            "the gradient term counts so little in a graded layer that its waves die out within "
            f"{1 / most:.1g} of it; leave the term out (gradient=False), or raise its stiffness "
            "(G_n_g, K_n_g)"
        )
    return int(2 ** np.ceil(np.log2(_SLICES + most)))


def _steepest(medium: Medium) -> float:
    """√ of the largest eigenvalue of Γ⁻¹ C_BB, l⁻¹, over the blocks."""
    squares = []
    for block in medium.family.blocks:
        form = spectral_form(medium, block)
        squares.append(np.abs(np.linalg.eigvals(np.linalg.solve(form.gamma, form.c_bb))).max())
    return float(np.sqrt(max(squares)))


def _parameters(media: list[Medium]) -> dict[str, Any]:
    for medium in media:
        for part in medium.parts:
            for name in part.known() if part is not medium else ():
                if getattr(part, name) != getattr(medium, name):
                    raise ValueError(
                        f"{name}: must be one for all families of a stack; take that of one, "
                        "layers.mapped(lambda medium: medium.parts[0])"
                    )
    given = {name: [getattr(m, name) for m in media] for name in media[0].known()}
    # None, of what follows from others, becomes NaN.
    return {name: np.array(values, dtype=float) for name, values in given.items()}


def _kind(medium: Medium) -> Medium:
    """A medium without its numbers."""
    if len(medium.parts) > 1:
        return together(*map(_kind, medium.parts))
    return _plain(type(medium), medium.closure)


@functools.cache
def _plain(of: type[Medium], closure: str) -> Medium:
    return of(closure=closure)


def medium_of(kind: Medium, values: dict[str, Any]) -> Medium:
    """One traced medium; what is NaN follows from other parameters, as an inertia does from R."""
    follow = [name for name in values if getattr(kind, name) is None]
    plain = dataclasses.replace(kind, **{k: v for k, v in values.items() if k not in follow})
    known = plain.parameters
    derived: dict[str, Any] = {
        n: jnp.where(jnp.isnan(values[n]), known[n], values[n]) for n in follow
    }
    return dataclasses.replace(plain, **derived)
