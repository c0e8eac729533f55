"""A leg as a problem: one or several sites, in plane strain or in 3D, with what is unknown of its tissues."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from types import MappingProxyType

import numpy as np
from scipy.special import stdtrit

from legfem.common.errors import Argument, InputError, Remedy
from legfem.common.units import FloatArray
from legfem.data import LoadingCurve
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.inverse.accuracy import GEOMETRY_DOF, MATERIAL_DOF, MATERIAL_LOG_SD
from legfem.inverse.catalogue import DEEP_D2, IdentifiedLaw, LawName, Values, deep_stiffness
from legfem.inverse.comparison import Covariances, ErrorSource, Weighting, total_of
from legfem.inverse.correction import TabulatedCorrection, corrected
from legfem.inverse.estimates import Optimum, estimates
from legfem.inverse.fit import ChannelFit, Cost, Fit, Identity, TestFit, r_squared, versions
from legfem.inverse.intervals import IDENTIFIABLE_WITHIN, NUMERICAL_ERROR, PRIOR_DOF, WEAKLY_WITHIN, effective_degrees
from legfem.inverse.joint_comparison import JointComparison, SingleTests
from legfem.inverse.outcome import Forward, JointForward
from legfem.inverse.parameter import Parameter
from legfem.inverse.problem import cost_of, goodness_of, held_values, log_of, search_settings
from legfem.inverse.readings import INSTRUMENT
from legfem.inverse.search import Search
from legfem.inverse.searches import Found
from legfem.inverse.settings import SearchRequest, free_of_model
from legfem.inverse.station_test import StationTest
from legfem.inverse.trial_noise import estimate_noise
from legfem.legs.details import AppliedCorrection, LegDetails, SpatialSites
from legfem.legs.forward import PlaneStrainForward, laws_of
from legfem.legs.notices import notices_about
from legfem.legs.site import SiteFit, beyond_of, mean_force, measured_curve, site_test
from legfem.legs.solver_3d import of_search
from legfem.legs.subject import SitedLeg, Subject
from legfem.legs.unknowns import Geometry, SectionGeometry, unknowns_at

ALIKE: frozenset[ErrorSource] = frozenset({"ends", "fibres", "assumed"})
"""Sources of error that all sites of a leg have alike: they make none differ from another."""
_ALWAYS_BY = ("deep.C10", "deep.C20", *MATERIAL_LOG_SD)
_ASSUMED = ("superficial.C10", "fascia.C10")
_STAYS = 0.05
"""Share of a first contact's standard deviation by which it may move, and of a misfit, before all is made anew."""


@dataclass(frozen=True, eq=False)
class LegProblem:
    """A leg's sites beside its model; a `legfem.inverse.problem.Problem`.

    A first search weighs the readings of a channel equally. About its optimum the errors of all readings are found,
    of which some are shares of what the model predicts, and by these the search is repeated. Where a law misses the
    recordings by more than their errors, it is shown as near to them as equal weights bring it.

    Parameters
    ----------
    leg : SitedLeg
        One leg pressed in one way is a leg of one site.
    tests : tuple of StationTest
        One a site.
    curves : tuple of LoadingCurve
        Mean of each site's loadings, which people are shown.
    forward : Forward
        Of all sites, in their order.
    unknowns : Mapping[str, IdentifiedLaw]
        By law.
    geometry : Geometry
        What outlines, aim and direction that are off do at each site.
    weighting : {"paper", "covariance"}, optional
        What to minimise; see `weighting_of`.
    own_errors : Mapping[str, float]
        Standard deviations by which each site's instrument errs beside what all have.
    spatial : SpatialSites, optional
        What is known of solves in 3D before a search that goes on these.
    """

    leg: SitedLeg
    tests: tuple[StationTest, ...]
    curves: tuple[LoadingCurve, ...]
    forward: Forward
    unknowns: Mapping[LawName, IdentifiedLaw]
    geometry: Geometry
    weighting: Weighting | None = None
    own_errors: Values = field(default_factory=dict)
    spatial: SpatialSites | None = None

    weighs_shared_errors = True

    def comparison(self, law: IdentifiedLaw, near: Found[JointComparison] | None = None) -> JointComparison:
        """Corrected forces beside the recordings, as the instruments show them; by their errors about a search."""
        weighting = weighting_of(law, self.weighting, any(test.observed.channels for test in self.tests))
        if near is None:
            return JointComparison(self._read_by(law, self.tests), "paper" if weighting == "paper" else "equal")
        best, tests = near.best, list[StationTest]()
        every = zip(self._read_by(law, near.search.misfit.tests), self.tests, best.outcome.curves, strict=True)
        for number, (test, own, curve) in enumerate(every):
            subject, observed = self.leg.sites[number], test.observed
            moved = replace(test, correction=own.correction).about(curve, best.values, test.contacts)
            left = observed.force - moved.every_reading(curve, best.values)[: len(observed.force)]
            noise = estimate_noise(observed, subject.instrument, left, subject.at_rest)
            changes = self.geometry(number, deep_stiffness(best.values))
            unknowns = list(unknowns_at(moved, subject, curve, best.values, changes, law, self.own_errors))
            tests.append(moved.about(curve, best.values, test.contacts, noise, unknowns))
        return JointComparison(tuple(tests), weighting, (best.values, near.linear.prediction.values))

    def _read_by(self, law: IdentifiedLaw, tests: Sequence[StationTest]) -> tuple[StationTest, ...]:
        """Return tests on a grid that goes as deep as a law's instrument may show them."""
        beyond = beyond_of(law.parameters, law.fixed)
        return tuple(replace(one, beyond=beyond) for one in tests)

    @property
    def sensitivities(self) -> tuple[str, ...]:
        """What solves are differentiated by; the stiffnesses always, since back-substitutions cost next to nothing."""
        known = [name for name in _ALWAYS_BY if name in self.forward.nominal]
        return tuple(dict.fromkeys((*known, *free_of_model(self.unknowns))))

    def refined(self, search: Search[JointComparison]) -> JointComparison | None:
        """Comparison about the contacts that a search leads to, or by equal weights where errors don't explain it."""
        now, best = search.misfit, search.best
        if now.weighting == "paper":
            return None
        weighting = "equal" if now.contradicts(best.objective) else now.weighting
        moved = replace(now, weighting=weighting)
        predicted = search.linearised(best).prediction.values
        left = np.linalg.solve(moved.weighing_covariance, predicted - moved.measured)
        pairs = zip(now.tests, best.outcome.curves, now.spans, strict=True)
        tests = tuple(test.about(curve, best.values, test.contacts_of(left[span])) for test, curve, span in pairs)
        stays = all(
            one.slopes is not None and np.all(np.abs(one.contacts - then.contacts) <= _STAYS * then.onset_priors[1])
            for one, then in zip(now.tests, tests, strict=True)
        )
        return None if stays and weighting == now.weighting else replace(moved, tests=tests)

    def corrected(self, corrections: Sequence[TabulatedCorrection | None]) -> "LegProblem":
        """The same with other corrections, one a site."""
        pairs = zip(self.tests, corrections, strict=True)
        return replace(self, tests=tuple(replace(test, correction=one) for test, one in pairs))

    def assessed(self, found: Found[JointComparison]) -> Fit[LegDetails]:
        """Fit of a finished search."""
        search, best = found.search, found.best
        law, comparison = search.law, search.misfit
        covariances = comparison.covariances_at(best.values)
        covariance = total_of(covariances)
        goodness = goodness_of(found, covariance)
        single = SingleTests(found, covariance)
        agreement = single.agreement
        times = self._quantile(found, covariances)
        spatial = None if self.spatial is None else of_search(self.spatial, self.leg, found)
        # What is alike for all sites can't make them disagree.
        wider = {
            source: part if source in ALIKE else agreement.birge_ratio**2 * part for source, part in covariances.items()
        }
        given = {**law.nominal, **law.fixed}
        assumed = {name: given[name] for name in _ASSUMED if name in given and name not in law.names}
        optimum = Optimum(found, wider, times, goodness.fits, assumed)
        corrections = tuple(
            _applied(test.correction, curve.displacement, best.values)
            for test, curve in zip(self.tests, self.curves, strict=True)
        )
        tests = tuple(self._test_fits(found, single))
        pairs = zip(comparison.tests, best.outcome.curves, strict=True)
        stations = tuple(one.fitted(curve, best.values) for one, curve in pairs)
        result = Fit(
            kind="leg",
            subject=Identity(self.leg.id, self.leg.title, self.leg.origin, self.leg.directory),
            law=law.name,
            estimates=MappingProxyType(estimates(optimum)),
            correlations=optimum.correlations,
            values=MappingProxyType(dict(best.values)),
            assumed=held_values(law),
            goodness=goodness,
            cost=self._cost(found, tests),
            agreement=agreement,
            tests=tests,
            log=log_of(found),
            neo_hookean_limit=found.neo_hookean_limit,
            weighting=comparison.weighting,
            settings=self._settings(found, times),
            versions=versions(),
            details=LegDetails(self.leg, self.own_errors, corrections, stations, spatial),
        )
        return replace(result, notices=notices_about(result))

    def _cost(self, found: Found[JointComparison], tests: Sequence[TestFit]) -> Cost:
        """Return the plain sum of squares over the mean loading curves, Eq. 12."""
        squares = np.array([np.sum(one.force.residual**2) for one in tests])
        lengths = np.array([site.indenter.length for site in self.leg.sites])
        measured, value = np.concatenate([curve.force for curve in self.curves]), float(squares.sum())
        spread, per_length = r_squared(value, measured), float(np.sum(squares / lengths**2))
        return replace(cost_of(found), value=value, points=len(measured), per_length=per_length, r_squared=spread)

    def _quantile(self, found: Found[JointComparison], covariances: Covariances) -> float:
        """Return Student's two-sided 95 % quantile for the first parameter, by how well its errors are known."""
        gain = found.linear.gain()[0, : len(found.search.misfit)]
        parts = {source: float(gain @ part @ gain) for source, part in covariances.items()}
        # The sites' repeats say how well their errors are known; the fewest count.
        repeats = min(curve.n_trials for curve in self.curves) - 1
        degrees = {"recordings": PRIOR_DOF + repeats, "shape": GEOMETRY_DOF, "assumed": MATERIAL_DOF}
        known = [(part, float(degrees[source])) for source, part in parts.items() if source in degrees]
        return float(stdtrit(effective_degrees(sum(parts.values()), known), 0.975))

    def _settings(self, found: Found[JointComparison], times: float) -> dict[str, object]:
        law = found.search.law
        return {
            "depth_mm": [float(curve.displacement[-1]) for curve in self.curves],
            "deep_D2_per_MPa": {**law.nominal, **law.fixed}.get(DEEP_D2, math.inf),
            "fascia_thickness_mm": [site.section.fascia_thickness for site in self.leg.sites],
            **search_settings(found.search),
            "numerical_error_relative": NUMERICAL_ERROR,
            "t_quantile": times,
            "interval": f"95 %, profile of the cost, t quantile {times:.2f}, covariance of recordings, numerical "
            "error, first contact, outlines, aim, direction and assumed tissues",
            "identifiable_within_relative_half_width": IDENTIFIABLE_WITHIN,
            "weakly_identifiable_within_relative_half_width": WEAKLY_WITHIN,
        }

    def _test_fits(self, found: Found[JointComparison], single: SingleTests) -> Iterator[SiteFit]:
        """Every site's mean loading curve, and what else was recorded there, beside the joint fit."""
        joint, values = found.search.misfit, found.best.values
        curves = found.best.outcome.curves
        every = zip(joint.tests, joint.spans, self.curves, curves, single.goodness(), single.by_itself(), strict=True)
        for test, span, curve, solved, goodness, own in every:
            at, prediction = curve.displacement, found.linear.prediction.part(span)
            rates = {name: solved.sensitivity(name, at) for name in solved.sensitivities}
            force, by = corrected(test.correction, at, solved(at), rates, values)
            channels = [ChannelFit(mean_force(curve), force, MappingProxyType(by))]
            for channel, rows in zip(test.data.channels[1:], test.data.spans[1:], strict=True):
                slopes = {name: rate[rows] for name, rate in prediction.sensitivities.items()}
                channels.append(ChannelFit(channel, prediction.values[rows], MappingProxyType(slopes)))
            yield SiteFit(test.name, tuple(channels), goodness, by_itself=MappingProxyType(own), curve=curve)


def leg_problem(
    leg: SitedLeg,
    laws: Sequence[LawName],
    request: SearchRequest,
    corrections: Sequence[TabulatedCorrection | None] | None = None,
    forward: Forward | None = None,
    geometry: Geometry | None = None,
) -> LegProblem:
    """A leg's sites in plane strain, with corrections for 3D.

    Parameters
    ----------
    leg : SitedLeg
        With recordings at every site.
    laws : sequence of str
        Of the deep tissue: ``neo-hookean``, ``reduced-polynomial``.
    request : SearchRequest
        What to identify. Of several sites the instrument's numbers, with a prior, are each site's own.
    corrections : sequence of TabulatedCorrection, optional
        One a site.
    forward : Forward, optional
        Of all sites, one curve each; see `section_forward`, which makes it otherwise.
    geometry : Geometry, optional
        What outlines, aim and direction that are off do; by solves of the sections without it.

    Raises
    ------
    InputError
        If the recordings can't be used, or there is no parameter of a name.
    """
    several = len(leg.sites) > 1
    parameters, fixed, own_errors = request.parameters, request.fixed, dict[str, float]()
    if several:
        parameters, own_errors = split_instrument(parameters, fixed)
    curves = tuple(measured_curve(site, request.depth) for site in leg.sites)
    paper = request.settings.weighting == "paper"
    tests = tuple(
        site_test(site, request.depth, correction, loading_alone=paper)
        for site, correction in zip(leg.sites, corrections or [None] * len(curves), strict=True)
    )
    forward = forward or section_forward(leg, request)
    unknowns = laws_of(leg.sites[0], laws, forward.nominal, parameters, fixed)
    begun = {
        name: replace(law, starts=(request.start,))
        for name, law in unknowns.items()
        if {*law.names} <= {*request.start}
    }
    unknowns |= begun
    if not several:
        for law in unknowns.values():
            weighting_of(law, request.settings.weighting, bool(tests[0].observed.channels))
    geometry = geometry or SectionGeometry(leg, tests, request)
    return LegProblem(leg, tests, curves, forward, unknowns, geometry, request.settings.weighting, own_errors)


def section_forward(
    leg: SitedLeg, request: SearchRequest, settings: PlaneStrainSettings | None = None
) -> JointForward[PlaneStrainForward]:
    """Forward model of a leg's sites in plane strain, every one pressed as deep as its recordings ask.

    Raises
    ------
    InputError
        If the recordings can't be used, or what presses doesn't lie along the leg.
    """
    several = len(leg.sites) > 1
    return JointForward(
        tuple(
            PlaneStrainForward.of_subject(site, pressed_depth(site, request, not several), settings)
            for site in leg.sites
        )
    )


def pressed_depth(site: Subject, request: SearchRequest, with_offset: bool = True) -> float:
    """How deep (mm) a model of a site is pressed: as its recordings ask, and as far as contact may have begun earlier.

    Raises
    ------
    InputError
        If the recordings can't be used.
    """
    measured_curve(site, request.depth)
    beyond = beyond_of(request.parameters or (), request.fixed) if with_offset else 0.0
    return float(replace(site_test(site, request.depth), beyond=beyond).grid[-1])


def weighting_of(law: IdentifiedLaw, asked: Weighting | None, channels: bool = False) -> Weighting:
    """What is minimised: the sum weighted by the errors, unless the paper's plain sum is asked for.

    Raises
    ------
    InputError
        If the plain sum is asked for and there are priors, or channels beside the force.
    """
    refused = partial(InputError, Argument("weighting"), "paper")
    if channels and asked == "paper":
        problem = "has no errors by which newtons and millimetres could be weighed against each other"
        raise refused(problem, "leave it out, or take the channels out of the recordings")
    if asked == "paper" and len(law.priors):
        raise refused("has no errors that a prior could be weighed against", "leave it out, or give covariance")
    return asked or "covariance"


def split_instrument(
    parameters: Sequence[Parameter] | None, fixed: Values
) -> tuple[tuple[Parameter, ...] | None, dict[str, float]]:
    """Split parameters into those that all sites share and errors that each site's instrument has of its own.

    Raises
    ------
    InputError
        If a number of the instrument is to be identified or held: each site has its own.
    """
    remedy = Remedy(
        "each site has its own: let it err by ",
        Argument("prior"),
        ", as in 'instrument.gain=1±0.01', or identify a site by itself with ",
        Argument("site"),
    )
    for name in fixed:
        if name in INSTRUMENT:
            raise InputError(Argument("fix"), name, "is not one for all sites", remedy)
    own = {}
    for one in parameters or ():
        if one.name not in INSTRUMENT:
            continue
        if one.role != "nuisance" or one.prior is None:
            raise InputError(Argument("identify"), one.name, "is not one for all sites", remedy)
        null, prior = INSTRUMENT[one.name].null, one.prior
        if not np.isclose(prior.centre, null):
            remedy = Remedy("correct the recordings, or identify a site by itself with ", Argument("site"))
            raise InputError(Argument("prior"), one.name, f"is not about {null:g}", remedy)
        own[one.name] = prior.sd
    if parameters is None:
        return None, own
    return tuple(one for one in parameters if one.name not in INSTRUMENT), own


def _applied(
    correction: TabulatedCorrection | None, displacement: FloatArray, values: Values
) -> AppliedCorrection | None:
    """What a correction is at displacements (n,), mm, and the model's values."""
    if correction is None:
        return None
    P = correction.correction(displacement, *map(np.asarray, deep_stiffness(values)))
    sd, fibrous = correction.standard_deviation(displacement), "fibres" in correction.sources.values()
    return AppliedCorrection(correction.name, P, sd, fibrous, correction.beyond)
