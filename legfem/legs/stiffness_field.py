r"""Where the muscle is stiffer and where softer: a field of its C10 in the section, and what recordings tell of it.

Its logarithm is a Gaussian process about that of the whole muscle's, of covariance
:math:`\sigma^2 \exp(-r^2 / 2 l^2)`, on the sines of a square of side L below the indenter
(`legfem.mechanics.terms.muscle.StiffnessField`), whose coefficients have the spectral density at their wave number as
prior (A. Solin, S. Särkkä, Stat. Comput. 30 (2020) 419-446),

.. math:: \operatorname{var} a_{jk} = \frac{8 \pi}{L^2} \sigma^2 l^2 \exp(-\tfrac12 l^2 \pi^2 (j^2 + k^2) / L^2).

What is smaller than half a wave of the finest isn't resolved. What the sines leave of the process, and all that lies
outside the square, keeps its variance.
"""

from dataclasses import replace
from typing import Any

import numpy as np
import shapely
from scipy.spatial.distance import cdist

from legfem.common.units import FloatArray, mpa_to_kpa
from legfem.geometry.indenter import Site
from legfem.geometry.section import LegSection, first_crossing
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.fit import Fit
from legfem.inverse.outcome import JointForward
from legfem.inverse.parameter import Parameter, Prior
from legfem.inverse.problem import goodness_of
from legfem.inverse.searches import Found, Searches
from legfem.inverse.settings import SearchRequest
from legfem.legs.details import LegDetails, StiffnessMap
from legfem.legs.problem import LegProblem
from legfem.mechanics.terms.muscle import StiffnessField

LOG_SD, LENGTH_MM = 0.7, 5.0
""":math:`\\sigma`, as that of a region's factor in a diagnosis, and :math:`l`, near the radius of the smallest thing
that is looked for."""
SIDE_MM, FINEST, BELOW_MM = 64.0, 9, 24.0
"""The square's side, the greatest number of half waves along it, and its middle's depth below the fascia."""
_STEP_MM = 3.0
"""Between points at which the field is told."""
_TOLD = 0.7
"""Of the standard deviation before the test: below it the recordings take half of the variance, or more."""
_STANDS_OUT, _APART_MM = 2.0, 9.0
"""Standard deviations from the whole muscle's C10 at which a place stands out, and least distance to the next one."""
_MOST_SD = 6.0
"""Of a coefficient before the test, at which its search is bounded."""


def stiffness_map(problem: LegProblem, fit: Fit[LegDetails], request: SearchRequest) -> StiffnessMap:
    """Fit a field of the muscle's C10 to a section's recordings, about what was found of a muscle that is alike.

    Parameters
    ----------
    problem
        Of one site in plane strain.
    fit
        Its law's, where the search begins.
    request
        Its means.

    Raises
    ------
    SearchError
        If no full solve reaches the measured depth.
    """
    assert isinstance(problem.forward, JointForward)
    (model,), (site,), law = problem.forward.models, problem.leg.sites, problem.unknowns[fit.law]
    at = Site(site.section, site.indenter)
    fascia = first_crossing(site.section.polygon("fascia").exterior, at.touch, at.direction)
    corner = at.touch + (fascia + BELOW_MM) * at.direction - 0.5 * SIDE_MM
    left, bottom = map(float, corner)
    term = StiffnessField("deep", model.experiment.tissues.deep, left, bottom, SIDE_MM, FINEST)
    test = model.experiment.on_same_mesh(mechanisms=(*model.experiment.mechanisms, term))
    forward = JointForward((replace(model, experiment=test),))
    sds = zip(term.modes, map(float, prior_sds(term)), strict=True)
    modes = (Parameter(name, "-", (-_MOST_SD * sd, _MOST_SD * sd), Prior(0.0, sd), "nuisance") for name, sd in sds)
    start = {**{name: fit.values[name] for name in law.names}, **dict.fromkeys(term.modes, 0.0)}
    law = replace(law, parameters=(*law.parameters, *modes), nominal=forward.nominal, starts=(start,))
    problem = replace(problem, forward=forward, unknowns={fit.law: law})
    with request.solver(forward, problem.sensitivities) as solver:
        near = Searches(problem, solver, request.settings, refines=False).nearest([fit.law])
        (found,) = Searches(problem, solver, request.settings, near).find([fit.law])
    return map_of(found, term, site.section)


def prior_sds(term: StiffnessField) -> FloatArray:
    """Return the standard deviations (m,) of the sines' coefficients before the test."""
    waves = LENGTH_MM * np.pi / term.side * np.array(term.waves)
    return LOG_SD * LENGTH_MM / term.side * np.sqrt(8 * np.pi) * np.exp(-0.25 * np.sum(waves**2, axis=1))


def map_of(found: Found[Any], term: StiffnessField, section: LegSection) -> StiffnessMap:
    """Return what a finished search for the sines' coefficients says of points in a section."""
    law, best, points = found.search.law, found.best, _points(section)
    errors, whole, sines = found.search.misfit.covariance_at(best.values), best.values[DEEP_C10], term.sines(points)
    by, modes = np.zeros((len(points), len(law.names))), [law.names.index(name) for name in term.modes]
    by[:, modes] = sines
    if (k := law.index(DEEP_C10)) is not None:
        by[:, k] = 1 / whole
    process = LOG_SD**2 * np.exp(-0.5 * (cdist(points, points) / LENGTH_MM) ** 2)
    covariance = by @ found.linear.errors(errors) @ by.T + process - (sines * prior_sds(term) ** 2) @ sines.T
    field, sd = sines @ best.point[modes], np.sqrt(np.diag(covariance))
    told = sd <= _TOLD * LOG_SD
    away = np.where(told, np.abs(field) / sd, 0.0)
    most = np.max(np.where(cdist(points, points) < _APART_MM, away, 0.0), axis=1)
    means = {}
    for name in (*section.groups, *section.muscles):
        outlines = shapely.union_all([section.polygon(one) for one in section.muscles_of(name)])
        if (inside := shapely.contains_xy(outlines, *points.T)).any():
            share = inside / inside.sum()
            means[name] = mpa_to_kpa(whole * np.exp(share @ field)), float(np.sqrt(share @ covariance @ share))
    return StiffnessMap(
        points,
        mpa_to_kpa(whole * np.exp(field)),
        sd,
        told,
        np.flatnonzero((away >= most) & (away > _STANDS_OUT)),
        mpa_to_kpa(whole),
        means,
        LOG_SD,
        term.side / term.finest,
        goodness_of(found, errors).p_value,
        found.search.converged,
    )


def _points(section: LegSection) -> FloatArray:
    """Return points (n, 2) within the muscle, `_STEP_MM` apart, mm."""
    bones = shapely.union_all([section.polygon(bone) for bone in section.bones])
    muscle = section.polygon("fascia").buffer(-section.fascia_thickness).difference(bones)
    left, bottom, right, top = muscle.bounds
    x, y = np.meshgrid(np.arange(left, right, _STEP_MM), np.arange(bottom, top, _STEP_MM))
    points = np.column_stack([x.ravel(), y.ravel()])
    return points[shapely.contains_xy(muscle, *points.T)]
