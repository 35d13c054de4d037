"""Layers as arrays that jax sees: parameters, thicknesses and losses, one entry for each layer."""

from __future__ import annotations

import dataclasses
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from wavesim.material.layers import Grading, Layers
from wavesim.material.medium import Medium
from wavesim.material.several_families import together
from wavesim.planewave.band_edges import keeps_gradient

jax.config.update("jax_enable_x64", True)


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
            :class:`~wavesim.material.damping.Damping`; None where nothing is lost.
        kinds: of each layer, a medium of the closure at hand; its parameters do not count.
        gradings: of each layer "smooth" or "linear" where it is graded, else None.
        kept: whether the gradient term Γ is kept.
    """

    first: dict[str, Any]
    last: dict[str, Any] | None
    thickness: Any
    losses: dict[str, Any] | None
    kinds: tuple[Medium, ...] = dataclasses.field(metadata={"static": True})
    gradings: tuple[Grading | None, ...] = dataclasses.field(metadata={"static": True})
    kept: bool = dataclasses.field(default=False, metadata={"static": True})

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
        ValueError: Γ is kept beside a graded layer, of which ``wavesim.layered.transmission`` has
            the answer. Or families that share a parameter have values of their own: take the
            layers of one.
    """
    kept = keeps_gradient(layers, gradient)
    if kept and any(layer.last is not None for layer in layers.layers):
        raise ValueError(
            "the gradient term counts in these layers, and transmission in jax keeps it in uniform "
            "layers alone; lower its stiffness (G_n_g, K_n_g), or take wavesim.layered.transmission"
        )
    own = layers.layers
    graded = any(layer.last is not None for layer in own)
    last = _parameters([layer.last or layer.medium for layer in own]) if graded else None
    losses = None
    if layers.lossy:
        laws = [layer.medium.damping for layer in own]
        most = max(len(law.rates) for law in laws)
        # A rate of 1 with a strength of 0 loses nothing.
        rates = np.ones((len(own), most))
        strengths = np.zeros((len(own), most))
        for row, law in enumerate(laws):
            rates[row, : len(law.rates)] = law.rates
            strengths[row, : len(law.rates)] = law.strengths
        plain = {
            name: jnp.asarray([getattr(law, name) for law in laws], dtype=float)
            for name in ("mass", "stiffness", "unrelaxed")
        }
        losses = plain | {"rates": jnp.asarray(rates), "strengths": jnp.asarray(strengths)}
    return TracedLayers(
        first=_parameters([layer.medium for layer in own]),
        last=last,
        thickness=jnp.asarray([layer.thickness for layer in own]),
        losses=losses,
        kinds=tuple(_kind(layer.medium) for layer in own),
        gradings=tuple(None if layer.last is None else layer.grading for layer in own),
        kept=kept,
    )


def _parameters(media: list[Medium]) -> dict[str, Any]:
    for medium in media:
        for part in medium.parts:
            for name in part.known():
                if getattr(part, name) != getattr(medium, name):
                    raise ValueError(
                        f"{name}: must be one for all families of a stack; take that of one, "
                        "layers.mapped(lambda medium: medium.parts[0])"
                    )
    given = {name: [getattr(m, name) for m in media] for name in media[0].known()}
    return {
        name: jnp.asarray([np.nan if value is None else float(value) for value in values])
        for name, values in given.items()
    }


def _kind(medium: Medium) -> Medium:
    """A medium without its numbers."""
    if len(medium.parts) > 1:
        return together(*map(_kind, medium.parts))
    return type(medium)(closure=medium.closure)


def medium_of(kind: Medium, values: dict[str, Any]) -> Medium:
    """One traced medium; what is NaN follows from other parameters, as an inertia does from R."""
    follow = [name for name in values if getattr(kind, name) is None]
    plain = dataclasses.replace(kind, **{k: v for k, v in values.items() if k not in follow})
    known = plain.parameters
    derived: dict[str, Any] = {
        n: jnp.where(jnp.isnan(values[n]), known[n], values[n]) for n in follow
    }
    return dataclasses.replace(plain, **derived)
