"""The true legs, and what is stated of them."""

from __future__ import annotations

from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np

from legfem.legs.loading import load_subject
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject
from studies.concealed.cases import SUBJECTS_OF_LEGS
from studies.lab.conditions import drawn_misstatement
from studies.lab.stated import misstated


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
