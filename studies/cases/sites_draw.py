"""A leg pressed at three sites by another discretisation, recorded as a lab does.

Every other leg is pressed by another code (felupe: quadratic triangles, a penalty, a mesh and a
Newton's method of its own); the others by finer elements and another contact law.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType

import numpy as np

from legfem.common.errors import UnsolvedError
from legfem.common.units import kpa_to_mpa
from legfem.geometry.indenter import Indenter
from legfem.jobs.store import Store
from legfem.legs.finite_element_models import plane_strain_test
from legfem.legs.placement import Calf, calf_section
from legfem.legs.subject import SitedLeg, Subject, TissueParameters
from legfem.solve.path import ForceCurve
from studies.cases.planted import TRUTH_SETTINGS
from studies.making.plane_leg import OtherCase, OtherCode
from studies.making.recording import INSTRUMENT, Course, LabErrors, record

RATE_MM_PER_S, TRIALS = 0.5, 3
LEAST_MM = 8.0
"""That a site has to be pressed; felupe's Newton iteration may stop short of the depth."""
C10_KPA, C20_KPA, FAT_FACTOR = (0.3, 2.5), (0.0, 2.0), 1.5
"""Where truths are drawn from; the fat's stiffness is 2 kPa up to a factor."""
FAT_KPA = 2.0
LAB = LabErrors(gain_sd=0.01, air=4.0)
_GIRTH_MM, _FAT_MM = (320.0, 400.0), (4.0, 10.0)
_FASCIA_MM, _RADIUS_MM, _LENGTH_MM = 0.6, 15.0, 50.0
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
        generator = np.random.default_rng([seed, k])
        low, high = np.log(C10_KPA)
        found.append(
            Truth(
                k,
                seed,
                float(np.exp(generator.uniform(low, high))),
                float(generator.uniform(*C20_KPA)),
                float(FAT_KPA * FAT_FACTOR ** generator.uniform(-1, 1)),
                float(generator.uniform(*_GIRTH_MM)),
                float(generator.uniform(*_FAT_MM)),
                depth_mm,
            )
        )
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
        site = _site(truth, name)
        curve = _true_curve(truth, site, kept)
        time = np.arange(0.0, curve.depth / RATE_MM_PER_S + 1e-9, 0.1)
        displacement = RATE_MM_PER_S * time
        course = Course(time, displacement, curve(displacement))
        trials = record([course] * TRIALS, LAB, generator)
        sites.append(replace(site, recordings=tuple(trials)))
    return SitedLeg(f"leg-{truth.number}", "A calf, simulated", tuple(sites), kept)


def _site(truth: Truth, name: str) -> Subject:
    girth, fat, direction = _SITES[name]
    section = calf_section(Calf(girth * truth.girth_mm, fat * truth.fat_mm, _FASCIA_MM))
    aim = section.fascia.mean(axis=0)
    return Subject(
        id=f"leg-{truth.number}-{name}",
        title=f"A calf, simulated, {name}",
        origin="simulated",
        section=section,
        indenter=Indenter(_RADIUS_MM, _LENGTH_MM, aim, direction),
        tissues=_tissues(FAT_KPA),
        instrument=INSTRUMENT,
        recordings=(),
        directory=Path(),
        plane_strain=True,
        plane_strain_stated=True,
        site=name,
    )


def _tissues(fat_kpa: float) -> Mapping[str, TissueParameters]:
    return MappingProxyType(
        {
            "deep": TissueParameters("reduced-polynomial", None, None, 28.0, 28.0),
            "superficial": TissueParameters("neo-hookean", kpa_to_mpa(fat_kpa), None, 22.5, None),
            "fascia": TissueParameters("neo-hookean", kpa_to_mpa(100.0), None, 22.5, None),
        }
    )


def _true_curve(truth: Truth, site: Subject, kept: Path) -> ForceCurve:
    def solved() -> ForceCurve:
        true = replace(site, tissues=_tissues(truth.fat))
        if truth.by_other_code:
            found = OtherCode(true, OtherCase(truth.c10, truth.c20)).solve(truth.depth_mm)
            if found.displacement[-1] < LEAST_MM:
                raise UnsolvedError(f"{site.id}: felupe stops at {found.displacement[-1]:g} mm")
            return ForceCurve(found.displacement, found.force, {})
        test = plane_strain_test(true, TRUTH_SETTINGS)
        deep = {"deep.C10": kpa_to_mpa(truth.c10), "deep.C20": kpa_to_mpa(truth.c20)}
        pressed = test.solve(deep, truth.depth_mm)
        if not pressed.report.complete:
            raise UnsolvedError(f"{site.id}: {pressed.report.reason}")
        return pressed.curve

    return Store(kept, ForceCurve, modules=(__name__,)).get_or_make((truth, site.site), solved)
