"""The cases: which leg, what is stated of it, which tissue, which protocol, and what is concealed."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

import numpy as np

from legfem.inverse.catalogue import LawName
from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject
from studies.making.stated import drawn_misstatement, misstated

DEPTH_MM = 20.0
SUBJECTS_OF_LEGS: tuple[tuple[str, LawName], ...] = (
    ("2", "neo-hookean"),
    ("1", "reduced-polynomial"),
    ("3", "reduced-polynomial"),
)
"""Whose sections the true legs have, and the base model's law."""

type Kind = Literal["none", "single", "pair", "outside"]
type Code = Literal["legfem", "felupe"]


@dataclass(frozen=True)
class SealedCase:
    """One sealed case."""

    number: int
    kind: Kind
    leg: int
    """Number of the true leg and of what is stated of it."""
    law: LawName
    """Of the base model."""
    code: Code
    """Which solves the truth."""
    c10_kpa: float
    c20_kpa: float
    effects: tuple[tuple[str, tuple[tuple[str, float], ...]], ...]
    """Mechanisms with their numbers; see `studies.cases.forms`."""
    outside: tuple[tuple[str, float], ...]
    """Effects outside the library with their sizes."""
    noise_seed: int

    @property
    def name(self) -> str:
        """In a line of progress."""
        return f"case{self.number:03d}"


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
