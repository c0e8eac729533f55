"""A fat that the force hides, by another code: what moves inside the section names it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_diagnosis import INSTRUMENT

from legfem.channels import Sight
from legfem.channels.kind import Frames
from legfem.channels.kinds.section_image import INSIDE, SectionDisplacements
from legfem.common.progress import Silent
from legfem.common.units import FloatArray
from legfem.data import Recording, segment_all
from legfem.data.recording import RecordedChannel
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.geometry.indenter import Site
from legfem.inverse.library_build import build_library
from legfem.inverse.observations import observe
from legfem.inverse.responses import SolvedResponses
from legfem.legs.diagnosis import STIFFENING, diagnose_body, shown_mechanisms
from legfem.legs.finite_element_models import LegVariants, tissues_of
from legfem.legs.loading import load_subject
from legfem.legs.mechanisms import TissueMechanism, mechanism_named
from legfem.legs.nuisances import Accuracy
from legfem.legs.schema import SUBJECTS
from studies.other_code.plane_leg import OtherCase, OtherCode

pytestmark = pytest.mark.slow
DEPTH, RATE, LATE_S = 9.0, 0.5, 0.1
ASKED = ("superficial-stiffness", "fascia-stiffness", "indenter-tilt", "strain-stiffening")
SHIFT_MM, TURN_DEG = np.array([1.5, -1.0]), 2.0
"""Of the image, which the lab doesn't know of."""


def test_a_stiff_fat_is_named_by_displacements_inside():
    """felupe's leg with 2.5 times the fat's stiffness: force alone is consistent and hides it in C10.

    Speckle errors by 0.3 mm (Laplace's distribution, alike over 4 mm), 1 % of gain, 0.1 s late, an image laid in 1.8 mm
    beside and turned by 2 degrees.
    """
    subject = load_subject(SUBJECTS.find("3"), need_recordings=False)
    site, rng = Site(subject.section, subject.indenter), np.random.default_rng(5)
    points = grid(site)
    sight = Sight(INSIDE.name, tuple((float(x), float(y), float(way)) for x, y in points for way in (0, 1)))
    other = OtherCode(subject, OtherCase(0.75, factors={"superficial": 2.5}), sights=[sight]).solve(DEPTH, 0.75)
    assert other.reached
    moves = np.array([other.channels[name] for name in INSIDE.courses(2 * len(points))])

    def moved(depth: float) -> FloatArray:
        return np.array([np.interp(depth, other.displacement, row) for row in moves]).reshape(-1, 2)

    recordings = []
    for k in range(3):
        time = np.arange(0.0, DEPTH / RATE, 0.05)
        force = np.interp(RATE * time, other.displacement, other.force)
        force = (1 + 0.005 * rng.standard_normal()) * force + 0.02 * rng.standard_normal()
        force += 0.02 * rng.standard_normal(len(time))
        at = RATE * time + 0.01 * rng.standard_normal(len(time))
        recordings.append(Recording(time, at, force, f"trial{k + 1}"))
    frames = tracked(points, moved, rng, recordings[0])
    ((read,),) = SectionDisplacements().of_frames([frames], site)
    inside = RecordedChannel(read.name, read.time, read.values, INSIDE.usual, None, read.course, read.places)
    recordings[0] = replace(recordings[0], channels=(inside,))
    observed = observe(segment_all(recordings, INSTRUMENT, True))

    settings = PlaneStrainSettings()
    settings = replace(settings, mesh=settings.mesh.refined(0.45))
    sights = (Sight(INSIDE.name, read.places),)
    variants = LegVariants(subject.section, subject.indenter, tissues_of(subject), settings, sights=sights)
    solved = SolvedResponses(variants, DEPTH + 1.0, None, {})
    asked = [one for one in map(mechanism_named, ASKED) if isinstance(one, TissueMechanism)]
    law = subject.tissues["deep"].law
    library = build_library(solved, solved, observed, asked, 1, Silent(), STIFFENING[law])
    able, _ = shown_mechanisms(observed, None)
    others = [one.name for one in able if isinstance(one, TissueMechanism) and one not in asked]
    library = replace(library, missing={**library.missing, **dict.fromkeys(others, "isn't tabulated")})

    def diagnosed(what):
        return diagnose_body(what, INSTRUMENT, law, library, None, Silent(), Accuracy())

    alone, both = diagnosed(replace(observed, channels=())), diagnosed(observed)
    print(alone.verdict, both.verdict, [one.name for one in both.best.fit.mechanisms])
    assert alone.verdict == "consistent"
    assert both.verdict == "named" and [one.name for one in both.best.fit.mechanisms] == ["superficial-stiffness"]


def grid(site: Site) -> FloatArray:
    """Points 3 mm apart, 36 mm wide, from 3 mm under the skin on."""
    travel = site.direction
    at = np.array([(x, y) for y in np.arange(18.0, 46.0, 3.0) for x in np.arange(-18.0, 19.0, 3.0)])
    return np.asarray(site.touch + at[:, :1] * [-travel[1], travel[0]] + at[:, 1:] * travel)


def tracked(points: FloatArray, moved, rng: np.random.Generator, recording: Recording) -> Frames:
    """A frame a second, where the lab takes the points to be."""
    angle = np.deg2rad(TURN_DEG)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    middle = points.mean(axis=0)
    stated = middle + (points - middle - SHIFT_MM) @ turn
    apart = np.linalg.norm(points[:, None] - points[None], axis=-1)
    alike = np.linalg.cholesky(np.exp(-apart / 4.0) + 1e-9 * np.eye(len(points)))
    rows = []
    for time in np.arange(0.0, DEPTH / RATE, 1.0):
        seen = 1.01 * moved(RATE * max(time - LATE_S, 0.0)) @ turn
        seen += 0.3 * alike @ rng.laplace(0.0, 1 / np.sqrt(2), points.shape)
        rows.append(np.column_stack([np.full(len(points), time), stated, seen]))
    table = np.concatenate(rows)
    return Frames(table[:, 0], table[:, 1:], recording.time, recording.force)
