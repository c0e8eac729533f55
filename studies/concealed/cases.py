"""The cases: which leg, what is stated of it, which tissue, which protocol, and what is concealed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType
from typing import Any, Literal

import numpy as np

from legfem.inverse.predictor import LawName
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject
from legfem.solve.protocol import Protocol
from studies.concealed.forms import FORMS, NAMED, OUTSIDE, drawn_values
from studies.lab.stated import drawn_misstatement, misstated

DEPTH_MM, SLOW, FAST, HOLD_S, TRIALS = 20.0, 0.4, 1.0, 60.0, 3
SUBJECTS_OF_LEGS: tuple[tuple[str, LawName], ...] = (
    ("2", "neo-hookean"),
    ("1", "reduced-polynomial"),
    ("3", "reduced-polynomial"),
)
"""Whose sections the true legs have, and the base model's law."""
C10_KPA, RATIO = (0.45, 1.8), (0.4, 3.0)
PEOPLE = 3
"""Stiffnesses of the deep tissue that stand behind each leg, unless another number is asked for."""

type ProtocolName = Literal["ramps", "holds"]
type Kind = Literal["none", "single", "pair", "outside"]
type Code = Literal["legfem", "felupe"]

SINGLES: tuple[tuple[str, Code], ...] = (
    ("viscoelasticity", "legfem"),
    ("preconditioning", "legfem"),
    ("fascia-stiffness", "felupe"),
    ("strain-stiffening", "legfem"),
    ("support-compliance", "felupe"),
    ("contact-slip", "legfem"),
    ("superficial-stiffness", "felupe"),
    ("superficial-viscoelasticity", "legfem"),
    ("muscle-contraction", "legfem"),
    ("compressibility", "felupe"),
    ("force-drift", "felupe"),
    ("end-effects", "legfem"),
    ("strain-stiffening", "felupe"),
    ("poroelastic-drainage", "legfem"),
    ("support-compliance", "legfem"),
    ("contact-slip", "felupe"),
    ("preconditioning", "felupe"),
    ("fascia-stiffness", "legfem"),
    ("superficial-stiffness", "legfem"),
    ("prestress", "legfem"),
    ("dermis", "legfem"),
    ("superficial-stiffening", "legfem"),
    ("indenter-tilt", "legfem"),
    ("fat-sliding", "felupe"),
)
"""Effects and the code that solves them, taken in turn."""
PAIRS = (
    ("viscoelasticity", "preconditioning"),
    ("viscoelasticity", "support-compliance"),
    ("superficial-stiffness", "force-drift"),
    ("muscle-contraction", "preconditioning"),
)
TWINS = 0.2
"""Twins over cases: single effects recorded once more."""
SHARES: Mapping[Kind, float] = {"none": 0.15, "single": 0.58, "pair": 0.12, "outside": 0.15}


@dataclass(frozen=True)
class SealedCase:
    """One sealed case."""

    number: int
    kind: Kind
    leg: int
    """Number of the true leg and of what is stated of it."""
    law: LawName
    """Of the base model."""
    protocol: ProtocolName
    code: Code
    """Which solves the truth."""
    c10_kpa: float
    c20_kpa: float
    effects: tuple[tuple[str, tuple[tuple[str, float], ...]], ...]
    """Mechanisms with their numbers; see `studies.concealed.forms`."""
    outside: tuple[tuple[str, float], ...]
    """Effects outside the library with their sizes."""
    noise_seed: int
    twin_of: int | None = None
    """Number of the case whose physics it repeats with other noise."""

    @property
    def name(self) -> str:
        """Of its folder."""
        return f"case{self.number:03d}"

    @property
    def names(self) -> tuple[str, ...]:
        """Of the mechanisms that are the truth."""
        outside = tuple(NAMED[name] for name, _ in self.outside if name in NAMED)
        return tuple(name for name, _ in self.effects) + outside

    @property
    def true_c10_kpa(self) -> float:
        """Half the shear modulus of its unstrained deep tissue.

        The second code's exponential, alpha exp(beta (I1 - 3)) in the energy's derivative, has its
        strength alpha there beside C10.
        """
        effects = {name: dict(values) for name, values in self.effects}
        exponential = effects.get("strain-stiffening") if self.code == "felupe" else None
        return self.c10_kpa + (exponential["strength"] if exponential else 0.0)

    @property
    def judged(self) -> Kind:
        """What its diagnosis is judged as: an outside effect that has a mechanism is a single."""
        return "single" if self.kind == "outside" and self.names else self.kind

    @property
    def protocol_of_trials(self) -> Protocol:
        """How all its trials are driven, from first touch on."""
        if self.protocol == "ramps":
            return Protocol.ramp(DEPTH_MM, SLOW)
        return Protocol.cycle(DEPTH_MM, FAST, HOLD_S)

    def document(self) -> dict[str, Any]:
        """Return it as JSON types."""
        return asdict(self)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> SealedCase:
        """Return the case of a document."""
        effects = tuple(
            (str(name), tuple((str(key), float(v)) for key, v in values)) for name, values in document["effects"]
        )
        outside = tuple((str(name), float(size)) for name, size in document["outside"])
        return cls(**{**document, "effects": effects, "outside": outside})


def make_cases(number: int, seed: int, legs: int, each: int = PEOPLE) -> list[SealedCase]:
    """Return cases without effect, with one, two, or one outside the library; and twins.

    Parameters
    ----------
    number
        Of cases, twins left out.
    seed
        Of all draws.
    legs
        True legs, each stated in its own wrong way; every leg costs a library.
    each
        Stiffnesses of the deep tissue that stand behind each leg; a library holds near one.
    """
    generator = np.random.default_rng([seed, 20])
    people = [
        [_stiffness(SUBJECTS_OF_LEGS[leg % len(SUBJECTS_OF_LEGS)][1], generator) for _ in range(each)]
        for leg in range(legs)
    ]
    counts = {kind: round(share * number) for kind, share in SHARES.items()}
    counts["single"] += number - sum(counts.values())
    kinds = [kind for kind, count in counts.items() for _ in range(count)]
    turns = [k for count in counts.values() for k in range(count)]
    cases = [_case(kind, turn, people, generator) for kind, turn in zip(kinds, turns, strict=True)]
    order = generator.permutation(len(cases))
    made = [replace(cases[k], number=position) for position, k in enumerate(order)]
    singles = [case for case in made if case.kind == "single"][: round(TWINS * number)]
    return made + [
        replace(case, number=number + k, noise_seed=case.noise_seed + 1, twin_of=case.number)
        for k, case in enumerate(singles)
    ]


def _case(kind: Kind, turn: int, people: list[list[tuple[float, float]]], generator: np.random.Generator) -> SealedCase:
    names: tuple[str, ...] = ()
    outside: tuple[tuple[str, float], ...] = ()
    code: Code = "felupe" if kind == "none" and turn % 3 == 0 else "legfem"
    if kind == "single":
        name, code = SINGLES[turn % len(SINGLES)]
        names = (name,)
    elif kind == "pair":
        names = PAIRS[turn % len(PAIRS)]
    elif kind == "outside":
        which = tuple(OUTSIDE)[turn % len(OUTSIDE)]
        code = "felupe" if which == "lump" else "legfem"
        outside = ((which, float(generator.uniform(0.5, 1.5))),)
    leg = int(generator.integers(len(people)))
    if names == ("strain-stiffening",) and code == "felupe":
        leg -= leg % len(SUBJECTS_OF_LEGS)  # its form replaces C20, so the base has none
    law = SUBJECTS_OF_LEGS[leg % len(SUBJECTS_OF_LEGS)][1]
    timed = any(FORMS[name].needs_time for name in names)
    # Another code's friction is solved for one loading.
    slides = names == ("contact-slip",) and code == "felupe"
    protocol: ProtocolName = "ramps"
    if timed or (not slides and generator.random() < 0.4):
        protocol = "holds"
    c10, c20 = people[leg][int(generator.integers(len(people[leg])))]
    return SealedCase(
        0,
        kind,
        leg,
        law,
        protocol,
        code,
        c10,
        c20,
        tuple((name, drawn_values(name, code, law, c10, generator)) for name in names),
        outside,
        int(generator.integers(2**31)),
    )


def _stiffness(law: str, generator: np.random.Generator) -> tuple[float, float]:
    """Return C10 and C20 of a person, kPa."""
    c10 = float(np.exp(generator.uniform(*np.log(C10_KPA))))
    return c10, 0.0 if law == "neo-hookean" else c10 * float(generator.uniform(*RATIO))


@dataclass(frozen=True, eq=False)
class SealedLeg:
    """A leg twice over."""

    true: Subject
    stated: Subject
    """With the same tissues as in every folder, which aren't the true leg's."""


def sealed_leg(number: int, seed: int) -> SealedLeg:
    """Return a leg of the study with the base model's law."""
    name, law = SUBJECTS_OF_LEGS[number % len(SUBJECTS_OF_LEGS)]
    usual = with_deep_law(load_subject(SUBJECTS.find(name), need_recordings=False), law)
    generator = np.random.default_rng([seed, 21, number])
    drawn = misstated(usual, drawn_misstatement(generator), generator)
    return SealedLeg(replace(usual, tissues=drawn.tissues), replace(drawn, tissues=usual.tissues))


def with_deep_law(subject: Subject, law: str) -> Subject:
    """Return the subject with another law of the deep tissue, its volumetric part fitting."""
    deep = subject.tissues["deep"]
    second = deep.D1 if law == "reduced-polynomial" else None
    tissue = replace(deep, law=law, C20=None, D2=second)  # type: ignore[arg-type]
    return replace(subject, tissues=MappingProxyType({**subject.tissues, "deep": tissue}))
