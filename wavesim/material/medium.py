"""A medium: what the waves of a family travel in, and what everything else asks it.

A family comes with a class of its own, a frozen dataclass derived from :class:`Medium` that holds
its parameters and gives its coefficients. ``Medium(family="translation", …)`` makes one by name.
"""

from __future__ import annotations

import dataclasses
import functools
import numbers
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, get_origin, get_type_hints

import numpy as np

from wavesim.material.arguments import real, shown, unknown
from wavesim.material.damping import UNDAMPED, Damping
from wavesim.material.family import Block, Family, register
from wavesim.material.parameter import PARAMETERS, Parameter
from wavesim.material.shown import Shown

_MEDIA: dict[str, type[Medium]] = {}
_USED: list[type[Medium]] = []
_LISTENERS: list[Callable[[type[Medium]], None]] = []


@dataclass(frozen=True)
class FluxForm:
    """Coefficients of the flux form (``family``); any 1D linear micromorphic medium fits.

    For n macro- and m micro-fields, in the order of the family's.

    Attributes:
        m_phi, m_B: inertias of a macro- and of a micro-field.
        C_phi_phi: C_φφ, shape (n, n).
        C_phi_B: C_φB, shape (n, m).
        C_B_phi: C_Bφ, shape (m, n); equals C_φBᵀ where the equations conserve energy.
        C_B_B: C_BB, shape (m, m).
        Gamma: Γ, shape (m, m).
        per: what all of them were divided by, such as l²N_p; 1 where they are in SI: energies per
            volume.
    """

    m_phi: Any
    m_B: Any
    C_phi_phi: Any
    C_phi_B: Any
    C_B_phi: Any
    C_B_B: Any
    Gamma: Any
    per: Any = 1.0


class _ByFamily(type):
    """Medium(family="…", …) makes a medium of that family's class."""

    def __call__(cls, *args: Any, family: str | None = None, **given: Any) -> Any:
        if cls is Medium:
            name = family or next(iter(_MEDIA))
            cls = medium_of(name)
        elif family is not None and family != cls.family.name:  # type: ignore[attr-defined]
            raise ValueError(
                f"family = {family!r}: a medium of family {cls.family.name!r} "  # type: ignore[attr-defined]
                "can't be made one of another; make a new one"
            )
        known = cls.family  # type: ignore[attr-defined]
        if isinstance(known, Family):  # several together look at what they are given themselves
            own = [one.name for one in dataclasses.fields(cls) if one.init]  # type: ignore[arg-type]
            said = unknown(f"Medium of family {known.name!r}", given, own)
            if said:
                raise ValueError(said)
        return super().__call__(*args, **given)


@dataclass(frozen=True, repr=False)
class Medium(Shown, metaclass=_ByFamily):
    """The medium of some family; ``Medium(family="…", **parameters)`` makes one, of rotation if
    none is named.

    Parameters, those annotated with a :class:`Parameter`, may each be a float or a scalar ``jax``
    array, so that gradients and batches go through; the range of a plain number is checked on
    construction.

    Args:
        closure: which form of the equations, of the class's ``closures``.
        damping: its loss law; lossless by default.

    Raises:
        ValueError: a parameter is outside its admissible range; the message names it.
    """

    closure: str = field(default="consistent", kw_only=True)
    damping: Damping = field(default=UNDAMPED, kw_only=True)

    family: ClassVar[Family]
    nested: ClassVar[tuple[str, ...]] = ()
    """Fields that hold parameters of their own."""
    closures: ClassVar[tuple[str, ...]] = ("consistent",)
    """Those that its equations have; the spectral solver may know more."""

    if TYPE_CHECKING:

        def __init__(self, *args: Any, family: str | None = None, **parameters: Any) -> None: ...

        def __getattr__(self, name: str) -> Any:
            """A parameter of the family's."""

    def __init_subclass__(cls, **options: Any) -> None:
        super().__init_subclass__(**options)
        if isinstance(vars(cls).get("family"), Family):
            register(cls.family)
            _MEDIA[cls.family.name] = cls
            PARAMETERS.update(cls.declared())

    def __post_init__(self) -> None:
        self._used()
        if not isinstance(self.closure, str) or self.closure not in self.closures:
            raise ValueError(self.closure_missing(self.closure))
        if not isinstance(self.damping, Damping):
            raise ValueError(
                f"damping = {shown(self.damping)}: must be of type Damping, such as "
                "constant_quality(30.0, (1e4, 1e6))"
            )
        for name, known in self.declared().items():
            value = getattr(self, name)
            if value is None and getattr(type(self), name, 0.0) is None:
                continue
            if not real(value) or not np.size(value):
                unit = f" in {known.unit}" if known.unit else ""
                raise ValueError(f"{name} = {shown(value)}: must be a finite number{unit}")
            if isinstance(value, numbers.Real):
                known.check(name, float(value))
            elif isinstance(value, np.ndarray):
                known.check(name, float(value.min()))
                known.check(name, float(value.max()))

    def _used(self) -> None:
        if type(self) not in _USED:
            _USED.append(type(self))
            for act in _LISTENERS:
                act(type(self))

    def __repr__(self) -> str:
        made = {"family": self.family.name} if self.family.name != next(iter(_MEDIA)) else {}
        changed = made | {
            one.name: getattr(self, one.name)
            for one in dataclasses.fields(self)
            if getattr(self, one.name) is not one.default
            and not _same(getattr(self, one.name), one.default)
        }
        return f"Medium({', '.join(f'{name}={value!r}' for name, value in changed.items())})"

    def told(self) -> dict[str, str]:
        """Every parameter with its symbol and unit."""
        told: dict[str, str] = {"family": self.family.name, "closure": self.closure}
        for name, value in self.parameters.items():
            own = self.known()[name]
            shown = f"{float(value):.6g}" if isinstance(value, numbers.Real) else str(value)
            told[f"{own.symbol}, {name}"] = f"{shown} {own.unit}".rstrip()
        return told | {"damping": str(self.damping) if self.damping else "none"}

    @classmethod
    def closure_missing(cls, closure: str) -> str:
        """What is said of a closure that its equations do not have."""
        return f"closure = {shown(closure)}: must be one of {', '.join(cls.closures)}"

    @classmethod
    @functools.cache
    def declared(cls) -> dict[str, Parameter]:
        """What is known of the parameters of its class, by name."""
        return {
            name: hint.__metadata__[0]
            for name, hint in get_type_hints(cls, include_extras=True).items()
            if get_origin(hint) is Annotated and isinstance(hint.__metadata__[0], Parameter)
        }

    def known(self) -> dict[str, Parameter]:
        """What is known of its parameters, by name."""
        return self.declared()

    def flux_form(self) -> FluxForm:
        """The coefficients of its equations, for waves along x₁; each family has its own.

        Raises:
            ValueError: the closure has no wave equations.
        """
        raise NotImplementedError(f"{type(self).__name__}.flux_form")

    @functools.cached_property
    def form(self) -> FluxForm:
        """:meth:`flux_form`, worked out once."""
        return self.flux_form()

    @functools.cached_property
    def fastest(self) -> float:
        """Speed of the fastest wave at short wavelengths, c_∞ = √(m_U max C_φφ/m_φ), m/s."""
        forms = [part.form for part in self.parts]
        squares = [np.linalg.eigvalsh(form.C_phi_phi).max() / form.m_phi for form in forms]
        return float(np.sqrt(self.damping.unrelaxed * max(squares)))

    @property
    def length_scale(self) -> Any:
        """Unit of length l (m), k̄ = k l/2π; each family has its own."""
        raise NotImplementedError(f"{type(self).__name__}.length_scale")

    @property
    def time_scale(self) -> Any:
        """Unit of time (s), ω̄ = ω times this: the highest cutoff's, unless a family has its own."""
        form = self.form
        return (form.m_B / np.abs(np.linalg.eigvals(form.C_B_B)).max()) ** 0.5

    @property
    def parts(self) -> tuple[Medium, ...]:
        """The media of each family in it: itself, unless it is several ``together``."""
        return (self,)

    def part(self, block: Block) -> Medium:
        """The medium that a block belongs to."""
        return self

    @property
    def macro_scale(self) -> Any:
        """Unit of a macro-field, in the family's."""
        return 1.0

    @property
    def inertias(self) -> tuple[Any, Any]:
        """Inertia of a macro- and of a micro-field per volume."""
        form = self.form
        return form.m_phi * form.per, form.m_B * form.per

    @property
    def of_gradient(self) -> tuple[Any, ...]:
        """Parameters that Γ comes from."""
        return ()

    @property
    def parameters(self) -> dict[str, Any]:
        """Every parameter by name, with what those left out stand for."""
        return {name: getattr(self, name) for name in self.known()}

    @property
    def keys(self) -> dict[str, Any]:
        """What [medium] of a case file says of it, losses apart; None where it says nothing."""
        own = {name: getattr(self, name) for name in self.known()}
        return {"family": self.family.name, "closure": self.closure} | own

    @property
    def conserves_energy(self) -> bool:
        """Whether its equations conserve energy, losses apart."""
        return self.closure == "consistent"

    @property
    def stable(self) -> bool:
        """Whether it is known beforehand that no wave of it grows."""
        return False

    @property
    def in_words(self) -> str:
        """What is said of it in a line: family, closure, and what else tells it from others."""
        return f"{self.family.name}, closure {self.closure}"

    @property
    def settings(self) -> str:
        """The keys that decide whether its waves are stable, with their values."""
        return ", ".join(f"{n} = {v:g}" for n, v in self.parameters.items())

    @property
    def described(self) -> dict[str, Any]:
        """All that makes it, as plain data."""
        return {"family": self.family.name} | dataclasses.asdict(self) | self.parameters

    def towards(self, other: Medium, share: float) -> Medium:
        """The medium with every parameter p + share · (p′ − p) between this one's and another's."""
        first, last = self.parameters, other.parameters
        values = {name: (1 - share) * first[name] + share * last[name] for name in first}
        if type(self).__post_init__ is not Medium.__post_init__:
            return dataclasses.replace(self, **values)
        # What is between admissible numbers need not be held to their ranges, thousands of times.
        made = object.__new__(type(self))
        kept = {one.name: getattr(self, one.name) for one in dataclasses.fields(self)}
        vars(made).update(kept | values)
        return made


def medium_of(family: str) -> type[Medium]:
    """The class of a family's media.

    Raises:
        ValueError: no family has that name.
    """
    if not isinstance(family, str) or family not in _MEDIA:
        raise ValueError(f"family = {family!r}: must be one of {', '.join(_MEDIA)}")
    return _MEDIA[family]


def with_each_class(act: Callable[[type[Medium]], None]) -> None:
    """Have something done with each class of media, once it is used."""
    _LISTENERS.append(act)
    for used in _USED:
        act(used)


def families() -> tuple[str, ...]:
    """Names of the families."""
    return tuple(_MEDIA)


def _same(value: Any, default: Any) -> bool:
    """Whether a parameter is a plain number or word that equals its default."""
    return isinstance(value, str | numbers.Real) and value == default
