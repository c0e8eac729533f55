"""The cases: which leg, which tissue, which protocol, and what is concealed in them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from typing import Any, Literal

import numpy as np

from legfem.diagnose.predict import LawName
from legfem.protocol import Protocol
from legfem.recording import Instrument

DEPTH_MM, SLOW, FAST, HOLD_S = 19.0, 0.4, 2.0, 60.0
SAMPLING_HZ = 20.0
LAWS: Mapping[str, LawName] = {
    "1": "reduced-polynomial", "2": "neo-hookean", "3": "reduced-polynomial",
}  # fmt: skip
"""Of the base model, by the subject whose section it is."""
C10_KPA, RATIO = (0.45, 1.8), (0.4, 3.0)
PEOPLE = 4
"""Stiffnesses of the deep tissue that stand behind each section."""
INSTRUMENT = Instrument(force_sd=0.015, displacement_sd=0.01)
"""A good load cell of 20 N (0.1 % of its range) and a good displacement sensor."""

type ProtocolName = Literal["ramps", "rates"]
type Kind = Literal["none", "single", "pair", "outside"]

STRENGTHS: Mapping[str, tuple[float, float]] = {
    "strain-stiffening": (0.6, 2.5),
    "end-effects": (0.8, 2.0),
    "viscoelasticity": (0.02, 0.2),
    "superficial-viscoelasticity": (0.1, 0.6),
    "poroelastic-drainage": (4.0, 40.0),
    "compressibility": (8.0, 25.0),
    "contact-onset": (0.25, 0.9),
    "support-compliance": (0.35, 0.8),
    "force-drift": (0.001, 0.01),
    "muscle-contraction": (0.02, 0.15),
    "preconditioning": (0.03, 0.15),
    "fascia-stiffness": (5.0, 20.0),
    "superficial-stiffness": (0.6, 2.0),
    "prestress": (80.0, 250.0),
}
"""Range of each mechanism's strength, in its own unit; drawn evenly in its logarithm.

From about one and a half times what is found at 80 % power. Two mechanisms of the library are left
out: an indenter's tilt is hidden by a refit at any angle, and slipping tape takes long to simulate.
"""
RAMPS_SUFFICE = ("contact-onset", "muscle-contraction", "preconditioning")
"""Mechanisms that loading alone can tell; others are recorded at two rates with holds."""
PAIRS = (
    ("viscoelasticity", "support-compliance"),
    ("viscoelasticity", "contact-onset"),
    ("muscle-contraction", "preconditioning"),
    ("superficial-stiffness", "force-drift"),
    ("poroelastic-drainage", "preconditioning"),
    ("viscoelasticity", "preconditioning"),
)
OUTSIDE = ("ripple", "drop", "clipping", "leg-shift")
"""Effects that no mechanism of the library describes; see `legfem.study.concealed.truth`."""
TWINS = 0.25
"""Twins over cases: single effects recorded once more."""
SHARES: Mapping[Kind, float] = {"none": 0.15, "single": 0.55, "pair": 0.15, "outside": 0.15}


@dataclass(frozen=True)
class Case:
    """One sealed case."""

    number: int
    kind: Kind
    subject: str
    """Whose section."""
    law: str
    """Of the base model."""
    protocol: ProtocolName
    c10_kpa: float
    c20_kpa: float
    effects: tuple[tuple[str, tuple[tuple[str, float], ...]], ...]
    """Mechanisms with their parameters."""
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
        """Of its mechanisms."""
        return tuple(name for name, _ in self.effects)

    def document(self) -> dict[str, Any]:
        """Return it as JSON types."""
        return asdict(self)

    @classmethod
    def of(cls, document: Mapping[str, Any]) -> Case:
        """Return the case of a document."""
        effects = tuple(
            (str(name), tuple((str(key), float(v)) for key, v in values))
            for name, values in document["effects"]
        )
        outside = tuple((str(name), float(size)) for name, size in document["outside"])
        return cls(**{**document, "effects": effects, "outside": outside})


def protocols_of(name: ProtocolName) -> list[Protocol]:
    """Return the protocols of a case's trials, in order."""
    if name == "ramps":
        return [Protocol.ramp(DEPTH_MM, SLOW)] * 3
    return [Protocol.cycle(DEPTH_MM, rate, HOLD_S) for rate in (SLOW, FAST) for _ in range(3)]


def make_cases(number: int, seed: int, mechanisms: Sequence[str] = tuple(STRENGTHS)) -> list[Case]:
    """Return cases without effect, with one, two, or one outside the library; and twins."""
    generator = np.random.default_rng([seed, 20])
    people = {subject: [_stiffness(law, generator) for _ in range(PEOPLE)]
              for subject, law in LAWS.items()}  # fmt: skip
    counts = {kind: round(share * number) for kind, share in SHARES.items()}
    counts["single"] += number - sum(counts.values())
    kinds = [kind for kind, count in counts.items() for _ in range(count)]
    within = [k for count in counts.values() for k in range(count)]
    cases = [
        _case(0, kind, turn, mechanisms, people, generator)
        for kind, turn in zip(kinds, within, strict=True)
    ]
    order = generator.permutation(len(cases))
    made = [replace(cases[k], number=position) for position, k in enumerate(order)]
    singles = [case for case in made if case.kind == "single"][: round(TWINS * number)]
    return made + [
        replace(case, number=number + k, noise_seed=case.noise_seed + 1, twin_of=case.number)
        for k, case in enumerate(singles)
    ]


def weakened(case: Case, factor: float) -> Case:
    """Return the case with the strengths of its effects times a factor; shapes stay."""
    return replace(
        case,
        effects=tuple(
            (name, ((values[0][0], values[0][1] * factor), *values[1:]))
            for name, values in case.effects
        ),
        outside=tuple((name, size * factor) for name, size in case.outside),
    )


def _case(
    number: int,
    kind: Kind,
    turn: int,
    mechanisms: Sequence[str],
    people: Mapping[str, Sequence[tuple[float, float]]],
    generator: np.random.Generator,
) -> Case:
    names: tuple[str, ...] = ()
    outside: tuple[tuple[str, float], ...] = ()
    if kind == "single":
        names = (mechanisms[turn % len(mechanisms)],)
    elif kind == "pair":
        able = [pair for pair in PAIRS if set(pair) <= set(mechanisms)]
        names = able[turn % len(able)]
    elif kind == "outside":
        which = OUTSIDE[turn % len(OUTSIDE)]
        outside = ((which, float(generator.uniform(0.5, 1.5))),)
    slow = kind != "pair" and set(names) <= set(RAMPS_SUFFICE)
    protocol: ProtocolName = "ramps" if slow and generator.random() < 0.5 else "rates"
    subject = str(generator.choice(sorted(LAWS)))
    # A neo-Hookean base leaves out C20, which is then what stiffens.
    law = LAWS[subject]
    c10, c20 = people[subject][int(generator.integers(PEOPLE))]
    return Case(
        number,
        kind,
        subject,
        law,
        protocol,
        c10,
        c20,
        tuple((name, _values(name, protocol, law, c10, generator)) for name in names),
        outside,
        int(generator.integers(2**31)),
    )


def _stiffness(law: str, generator: np.random.Generator) -> tuple[float, float]:
    """Return C10 and C20 of a person, kPa."""
    c10 = float(np.exp(generator.uniform(*np.log(C10_KPA))))
    return c10, 0.0 if law == "neo-hookean" else c10 * float(generator.uniform(*RATIO))


def _values(
    name: str, protocol: ProtocolName, law: str, c10: float, generator: np.random.Generator
) -> tuple[tuple[str, float], ...]:
    from legfem.diagnose.diagnosis import mechanism_named

    first = mechanism_named(name).parameters[0].name
    strength = float(np.exp(generator.uniform(*np.log(STRENGTHS[name]))))
    if name == "indenter-tilt" and generator.random() < 0.5:
        strength = -strength
    if name == "strain-stiffening" and law == "neo-hookean":
        # Of the same size as the stiffness, as in the paper's subjects.
        strength = c10 * float(generator.uniform(0.2, 1.0))
    values = [(first, strength)]
    if name in ("viscoelasticity", "superficial-viscoelasticity"):
        values.append(("relaxation_time", float(np.exp(generator.uniform(*np.log((3.0, 25.0)))))))
    if name == "muscle-contraction":
        end = min(p.duration for p in protocols_of(protocol))
        values.append(("onset", float(generator.uniform(0.25, 0.7)) * end))
        values.append(("rise", float(generator.uniform(0.04, 0.1)) * end))
    return tuple(values)
