"""Media of several families in one bar, side by side: what one specimen is to each of them.

Families do not couple, so that each block belongs to one medium; sectors and blocks are named after
their family as well, such as translation-longitudinal.
"""

from __future__ import annotations

import collections
import dataclasses
from dataclasses import dataclass
from functools import cache
from typing import Any

from wavesim.material.arguments import shown
from wavesim.material.damping import Damping
from wavesim.material.family import Block, Family
from wavesim.material.medium import FluxForm, Medium
from wavesim.material.parameter import Parameter


@cache
def _joined(families: tuple[Family, ...]) -> Family:
    blocks: list[Block] = []
    gaps: dict[str, tuple[str, ...]] = {}
    uses = collections.Counter(name for one in families for name in one.all_gaps)
    for one in families:
        blocks += [
            dataclasses.replace(
                block, name=f"{one.name}-{block.name}", sector=f"{one.name}-{block.sector}"
            )
            for block in one.blocks
        ]
        gaps |= {
            f"{one.name}-{sector}": tuple(
                name if uses[name] == 1 else f"{one.name}-{name}" for name in one.gap_names(sector)
            )
            for sector in one.sectors
        }
    return Family(
        name=" and ".join(one.name for one in families),
        macro=tuple(name for one in families for name in one.macro),
        micro=tuple(name for one in families for name in one.micro),
        blocks=tuple(blocks),
        gaps=gaps,
        words=(
            " or ".join(one.words[0] for one in families),
            " or ".join(one.words[1] for one in families),
        ),
        waves={f"{one.name}-{s}": wave for one in families for s, wave in one.waves.items()},
        time=families[0].time,
    )


def _of_first(name: str) -> Any:
    """A property that is the first part's."""
    return property(lambda self: getattr(self.parts[0], name))


@dataclass(frozen=True, repr=False, init=False)
class Together(Medium):
    """Media of different families, which share the loss law; made by :func:`together`.

    Units of length and time are those of the first. A parameter given beside the parts, as
    ``dataclasses.replace`` does, is laid over that of each of them that has it; one that is asked
    for is that of the first that has it.
    """

    parts: tuple[Medium, ...] = ()

    nested = ("parts",)

    def __init__(
        self,
        parts: tuple[Medium, ...] = (),
        *,
        closure: str = "",
        damping: Damping | None = None,
        **given: Any,
    ) -> None:
        law = parts[0].damping if damping is None else damping
        odd = [name for name in given if not any(name in part.declared() for part in parts)]
        if odd:
            raise ValueError(f"{odd[0]}: is no parameter of {', '.join(map(repr, parts))}")
        kept = []
        for part in parts:
            own = {name: value for name, value in given.items() if name in part.declared()}
            if closure in part.closures:
                own["closure"] = closure
            kept.append(dataclasses.replace(part, damping=law, **own))
        object.__setattr__(self, "parts", tuple(kept))
        object.__setattr__(self, "damping", law)
        object.__setattr__(self, "closure", ", ".join(dict.fromkeys(p.closure for p in kept)))
        self._used()

    def __getattr__(self, name: str) -> Any:
        own = () if name.startswith("_") or name == "parts" else self.parts
        for part in own:
            if name in part.declared():
                return getattr(part, name)
        raise AttributeError(f"{type(self).__name__} has no {name!r}")

    def known(self) -> dict[str, Parameter]:
        """What is known of the parameters of all, by name."""
        return {name: one for part in reversed(self.parts) for name, one in part.known().items()}

    def __repr__(self) -> str:
        return f"together({', '.join(map(repr, self.parts))})"

    def told(self) -> dict[str, str]:
        """What each of them tells."""
        return {
            f"{part.family.name}: {what}": value
            for part in self.parts
            for what, value in part.told().items()
        }

    @property
    def family(self) -> Family:  # type: ignore[override]
        """All their fields and blocks."""
        return _joined(tuple(part.family for part in self.parts))

    def part(self, block: Block) -> Medium:
        """The medium that a block belongs to."""
        return next(p for p in self.parts if block.fields[0] in p.family.fields)

    def flux_form(self) -> FluxForm:
        """Each has its own."""
        raise ValueError("media of several families have an equation each: take one of the parts")

    # Units, and what they are made of.
    length_scale, time_scale = _of_first("length_scale"), _of_first("time_scale")
    macro_scale, inertias = _of_first("macro_scale"), _of_first("inertias")

    @property
    def of_gradient(self) -> tuple[Any, ...]:
        """All parameters that some Γ comes from."""
        return tuple(value for part in self.parts for value in part.of_gradient)

    @property
    def parameters(self) -> dict[str, Any]:
        """All their parameters by name; of those of one name, the first's."""
        found: dict[str, Any] = {}
        for part in self.parts:
            found = part.parameters | found
        return found

    @property
    def keys(self) -> dict[str, Any]:
        """What [medium] of a case file says of them.

        Raises:
            ValueError: a parameter that both have differs, which it can't say.
        """
        found: dict[str, Any] = {}
        for part in self.parts:
            for name, value in part.keys.items():
                if name not in ("family", "closure") and found.get(name, value) != value:
                    raise ValueError(f"{name}: must be one for all families of a case file")
                if name not in found or (name == "closure" and len(part.closures) > 1):
                    found[name] = value
        return found | {"family": [part.family.name for part in self.parts]}

    @property
    def conserves_energy(self) -> bool:
        """Whether the equations of each do."""
        return all(part.conserves_energy for part in self.parts)

    @property
    def stable(self) -> bool:
        """Whether each is."""
        return all(part.stable for part in self.parts)

    @property
    def settings(self) -> str:
        """Those of each."""
        return ", ".join(dict.fromkeys(part.settings for part in self.parts))

    @property
    def in_words(self) -> str:
        """What is said of each in a line."""
        return "; ".join(part.in_words for part in self.parts)

    @property
    def described(self) -> dict[str, Any]:
        """What makes each, by family."""
        return {"family": self.family.name} | {p.family.name: p.described for p in self.parts}

    def towards(self, other: Medium, share: float) -> Medium:
        """Each of them between itself and the other's."""
        pairs = zip(self.parts, other.parts, strict=True)
        return dataclasses.replace(self, parts=tuple(a.towards(b, share) for a, b in pairs))


def together(*media: Medium) -> Medium:
    """Media of different families as one, for a bar in which all their waves run.

    Args:
        media: such as ``Medium()`` and ``Medium(family="translation")``: the same specimen, as one
            and as another family has it; one loss law for all.

    Returns:
        A medium with the blocks of all; of one medium, itself.

    Raises:
        ValueError: one is no medium, two are of one family, or their loss laws differ.
    """
    if not media:
        raise ValueError("media: none given; give one medium of each family")
    odd = [one for one in media if not isinstance(one, Medium)]
    if odd:
        raise ValueError(f"media = {shown(odd[0])}: must be of type Medium, each")
    names = [medium.family.name for medium in media]
    if len(set(names)) < len(names):
        raise ValueError(f"family = {', '.join(names)}: must differ; give one medium of each")
    if any(medium.closure == "appendix_c" for medium in media):
        raise ValueError('closure = "appendix_c": has no wave equations to stand beside others')
    if any(medium.damping != media[0].damping for medium in media):
        raise ValueError("damping: must be the same for media of all families in a bar")
    return media[0] if len(media) == 1 else Together(parts=media, damping=media[0].damping)
