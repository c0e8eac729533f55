"""A leg pressed at three sites by another discretisation, recorded as a lab does.

Every other leg is pressed by another code (felupe: quadratic triangles, a penalty, a mesh and a
Newton's method of its own); the others by finer elements and another contact law.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from legfem.jobs.store import Store
from legfem.legs.subject import SitedLeg, Subject
from legfem.legs.typical import Calf, calf_section
from legfem.solve.path import ForceCurve
from studies.cases.truth import FINE
from studies.making.plane_leg import OtherCase
from studies.making.pressed_legs import stated_leg, true_force
from studies.making.recording import LabErrors, loading, record

RATE_MM_PER_S, TRIALS = 0.5, 3
LEAST_MM = 8.0
"""That a site has to be pressed; felupe's Newton iteration may stop short of the depth."""
C10_KPA, C20_KPA, FAT_FACTOR = (0.3, 2.5), (0.0, 2.0), 1.5
"""Where truths are drawn from; the fat's stiffness is 2 kPa up to a factor."""
FAT_KPA = 2.0
LAB = LabErrors(gain_sd=0.01, air=4.0)
_GIRTH_MM, _FAT_MM = (320.0, 400.0), (4.0, 10.0)
_FASCIA_MM = 0.6
_SITES = {"back": (1.0, 1.0, 90.0), "medial": (0.97, 0.8, 180.0), "low": (0.85, 0.7, 90.0)}
"""Girth and fat over those at the largest girth, and direction of travel in degrees."""


@dataclass(frozen=True)
class Truth:
    """What is planted; stiffness in kPa."""

    number: int
    seed: int
    c10: float
    c20: float
    fat: float
    girth_mm: float
    fat_mm: float
    depth_mm: float

    @property
    def by_other_code(self) -> bool:
        """Whether felupe presses it."""
        return self.number % 2 == 1


def truths(number: int, seed: int, depth_mm: float = 12.0) -> list[Truth]:
    """Return what is planted in as many legs."""
    found = []
    for k in range(number):
        draw = np.random.default_rng([seed, k]).uniform
        c10, c20, factor = np.exp(draw(*np.log(C10_KPA))), draw(*C20_KPA), FAT_FACTOR ** draw(-1, 1)
        sizes = FAT_KPA * factor, draw(*_GIRTH_MM), draw(*_FAT_MM)
        c10, c20, fat, girth_mm, fat_mm = (float(one) for one in (c10, c20, *sizes))
        found.append(Truth(k, seed, c10, c20, fat, girth_mm, fat_mm, depth_mm))
    return found


def leg_of(truth: Truth, kept: Path) -> SitedLeg:
    """Return the leg as the lab gives it, with its recordings; true courses are kept.

    The lab assumes `FAT_KPA`; sections, aims and all else are as they are.

    Raises
    ------
    RuntimeError
        If a site can't be pressed to the depth.
    """
    generator = np.random.default_rng([truth.seed, truth.number, 1])
    sites = []
    for name in _SITES:
        curve = _true_curve(truth, name, kept)
        trials = record([loading(curve, curve.depth, RATE_MM_PER_S)] * TRIALS, LAB, generator)
        sites.append(replace(_site(truth, name), recordings=tuple(trials)))
    return SitedLeg(f"leg-{truth.number}", "A calf, simulated", tuple(sites), kept)


def _site(truth: Truth, name: str, fat_kpa: float = FAT_KPA) -> Subject:
    girth, fat, direction = _SITES[name]
    section = calf_section(Calf(girth * truth.girth_mm, fat * truth.fat_mm, _FASCIA_MM))
    aim = section.fascia.mean(axis=0)
    return stated_leg(f"leg-{truth.number}-{name}", section, aim, direction, fat_kpa, "reduced-polynomial", name)


def _true_curve(truth: Truth, name: str, kept: Path) -> ForceCurve:
    def solved() -> ForceCurve:
        settings = None if truth.by_other_code else FINE
        case = OtherCase(truth.c10, truth.c20)
        return true_force(_site(truth, name, truth.fat), case, truth.depth_mm, LEAST_MM, settings)

    return Store(kept, ForceCurve, modules=(__name__,)).get_or_make((truth, name), solved)
