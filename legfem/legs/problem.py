"""A leg as a problem: one or several sites, in plane strain or in 3D, with what is unknown of its tissues."""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import TYPE_CHECKING

import numpy as np

from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.common.wording import Argument, Remedy
from legfem.inverse.catalogue import DEEP_D2, IdentifiedLaw, LawName, Values, deep_stiffness
from legfem.inverse.comparison import Covariances, ErrorSource, JointComparison, Weighting, total_of
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.fit import ChannelFit, Fit, Identity, TestFit, versions
from legfem.inverse.intervals import IDENTIFIABLE_WITHIN, NUMERICAL_ERROR, NUMERICAL_LENGTH_MM, WEAKLY_WITHIN, quantile
from legfem.inverse.outcome import Forward, JointForward
from legfem.inverse.parameter import Parameter
from legfem.inverse.problem import SingleTests, cost_of, goodness_of, held_values, log_of, optimum_of, search_settings
from legfem.inverse.readings import INSTRUMENT
from legfem.inverse.search import Search
from legfem.inverse.searches import Found
from legfem.inverse.settings import SearchRequest, free_of_model
from legfem.legs.correction_of_leg import Correction
from legfem.legs.details import AppliedCorrection, LegDetails, SpatialSites
from legfem.legs.forward import PlaneStrainForward, laws_of
from legfem.legs.notices import notices_about
from legfem.legs.site_channels import site_channels
from legfem.legs.site_test import SiteTest, beyond_of, measured_curve, source_of_mode, with_instrument_errors
from legfem.legs.subject import SitedLeg, Subject

if TYPE_CHECKING:
    from legfem.experiments.plane_strain import PlaneStrainSettings

ALIKE: frozenset[ErrorSource] = frozenset({"ends", "fibres", "shape"})
"""Sources of error that all sites of a leg have alike: they make none differ from another."""
_ALWAYS_BY = ("deep.C10", "deep.C20", "superficial.C10", "fascia.C10")
_ASSUMED = ("superficial.C10", "fascia.C10")


@dataclass(frozen=True, eq=False)
class LegProblem:
    """A leg's sites beside its model; a `legfem.inverse.problem.Problem`.

    Parameters
    ----------
    leg : SitedLeg
        One leg pressed in one way is a leg of one site.
    tests : tuple of SiteTest
        One a site.
    forward : Forward
        Of all sites, in their order.
    unknowns : Mapping[str, IdentifiedLaw]
        By law.
    weighting : {"paper", "covariance"}, optional
        What to minimise; see `weighting_of`.
    own_errors : Mapping[str, float]
        Standard deviations by which each site's instrument errs, which the curves' errors have.
    spatial : callable, optional
        What is known of solves in 3D beside a finished search; of a search that goes on these.
    """

    leg: SitedLeg
    tests: tuple[SiteTest, ...]
    forward: Forward
    unknowns: Mapping[LawName, IdentifiedLaw]
    weighting: Weighting | None = None
    own_errors: Values = field(default_factory=dict)
    spatial: Callable[[Found[JointComparison]], SpatialSites] | None = None

    @property
    def weighs_shared_errors(self) -> bool:
        """Whether the correction's error is weighed against what was known beforehand."""
        known = any(len(law.priors) for law in self.unknowns.values())
        return known and any(test.correction is not None for test in self.tests)

    @property
    def _joint(self) -> bool:
        """Whether readings have to be weighed by their errors, and an instrument's numbers are among these."""
        return len(self.tests) > 1 or self.spatial is not None

    def comparison(self, law: IdentifiedLaw, near: tuple[Values, FloatArray] | None = None) -> JointComparison:
        """Corrected forces beside the recordings, as the instrument of one site shows them."""
        if self._joint:
            return JointComparison(self.tests, "covariance", near)
        (test,) = self.tests
        weighting = weighting_of(law, self.weighting, bool(test.beside))
        beyond = beyond_of(law.parameters, law.fixed)
        read = replace(test, beyond=beyond, by_instrument=law.reads, finds_contact=weighting == "covariance")
        return JointComparison((read,), weighting, near)

    @property
    def sensitivities(self) -> tuple[str, ...]:
        """What solves are differentiated by; the stiffnesses always, since back-substitutions cost next to nothing."""
        return tuple(dict.fromkeys((*_ALWAYS_BY, *free_of_model(self.unknowns))))

    def refined(self, search: Search[JointComparison]) -> JointComparison | None:
        """Comparison with what images do that lie elsewhere, as the best solve shows it; None where that is known."""
        comparison, curves = search.misfit, search.best.outcome.curves
        sites = [test for test in comparison.tests if isinstance(test, SiteTest)]
        seen = [test.seen_in(curve) for test, curve in zip(sites, curves, strict=True)]
        if all(one is None for one in seen):
            return None
        return replace(comparison, tests=tuple(one or test for one, test in zip(seen, sites, strict=True)))

    def corrected(self, corrections: Sequence[Correction | None]) -> "LegProblem":
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
        # The sites' repeats say how well their errors are known; the fewest count.
        times = quantile(min(test.curve.noise.repeat_dof for test in self.tests))
        spatial = None if self.spatial is None else self.spatial(found)
        estimates, correlations = optimum_of(
            found,
            _widened(covariances, agreement.birge_ratio),
            times,
            goodness,
            _assumed_stiffness(law),
            spatial is None,
        )
        corrections = tuple(_applied(test.correction, test.curve.displacement, best.values) for test in self.tests)
        result = Fit(
            kind="leg",
            subject=Identity(self.leg.id, self.leg.title, self.leg.origin),
            law=law.name,
            estimates=estimates,
            correlations=correlations,
            values=MappingProxyType(dict(best.values)),
            assumed=held_values(law),
            goodness=goodness,
            cost=cost_of(found, self._per_length(found)),
            agreement=agreement,
            tests=tuple(_test_fits(found, single)),
            log=log_of(found),
            neo_hookean_limit=found.neo_hookean_limit,
            weighting=comparison.weighting,
            settings=self._settings(found, times),
            versions=versions(),
            details=LegDetails(self.leg, self.own_errors, corrections, spatial),
        )
        return replace(result, notices=notices_about(result))

    def _per_length(self, found: Found[JointComparison]) -> float:
        """Sum of squared differences of forces per unit length of the cylinder, (N/mm)2; NaN of other indenters."""
        left = found.linear.prediction.values - found.search.misfit.measured
        forces = [test.data.spans[0] for test in self.tests]
        lengths = [test.subject.indenter.length for test in self.tests]
        spans = found.search.misfit.spans
        every = zip(spans, forces, lengths, strict=True)
        return math.fsum(float(np.sum(left[span][force] ** 2)) / one**2 for span, force, one in every)

    def _settings(self, found: Found[JointComparison], times: float) -> dict[str, object]:
        law = found.search.law
        return {
            "depth_mm": [float(test.curve.displacement[-1]) for test in self.tests],
            "deep_D2_per_MPa": {**law.nominal, **law.fixed}.get(DEEP_D2, math.inf),
            "fascia_thickness_mm": [test.subject.section.fascia_thickness for test in self.tests],
            **search_settings(found.search),
            "numerical_error_relative": NUMERICAL_ERROR,
            "numerical_error_length_mm": NUMERICAL_LENGTH_MM,
            "interval": f"95 %, profile of the cost, t quantile {times:.2f}, covariance of recordings and "
            "numerical error",
            "identifiable_within_relative_half_width": IDENTIFIABLE_WITHIN,
            "weakly_identifiable_within_relative_half_width": WEAKLY_WITHIN,
        }


def leg_problem(
    leg: SitedLeg,
    laws: Sequence[LawName],
    request: SearchRequest,
    corrections: Sequence[TabulatedCorrection | None] | None = None,
    forward: Forward | None = None,
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

    Raises
    ------
    InputError
        If the recordings can't be used, or there is no parameter of a name.
    """
    several = len(leg.sites) > 1
    parameters, fixed, own_errors = request.parameters, request.fixed, dict[str, float]()
    if several:
        parameters, own_errors = split_instrument(parameters, fixed)
    curves = [with_instrument_errors(measured_curve(site, request.depth), own_errors) for site in leg.sites]
    forward = forward or section_forward(leg, request)
    tests = tuple(
        SiteTest(site, curve, correction, beside=site_channels(site, curve))
        for site, curve, correction in zip(leg.sites, curves, corrections or [None] * len(curves), strict=True)
    )
    unknowns = laws_of(leg.sites[0], laws, forward.nominal, parameters, fixed)
    if not several:
        for law in unknowns.values():
            weighting_of(law, request.settings.weighting, bool(tests[0].beside))
    return LegProblem(leg, tests, forward, unknowns, request.settings.weighting, own_errors)


def section_forward(
    leg: SitedLeg, request: SearchRequest, settings: "PlaneStrainSettings | None" = None
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
    beyond = beyond_of(request.parameters or (), request.fixed) if with_offset else 0.0
    return float(measured_curve(site, request.depth).displacement[-1]) + beyond


def weighting_of(law: IdentifiedLaw, asked: Weighting | None, channels: bool = False) -> Weighting:
    """What is minimised: the plain sum where nothing else is asked for or needed.

    Raises
    ------
    InputError
        If the plain sum is asked for and there are priors, or channels beside the force.
    """
    if channels and asked == "paper":
        raise InputError(
            Argument("weighting"),
            "paper",
            "has no errors by which newtons and millimetres could be weighed against each other",
            "leave it out, or take the channels out of the recordings",
        )
    if len(law.priors) == 0 and not channels:
        return asked or "paper"
    if asked == "paper":
        raise InputError(
            Argument("weighting"),
            "paper",
            "has no errors that a prior could be weighed against",
            "leave it out, or give covariance",
        )
    return "covariance"


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
            raise InputError(
                Argument("prior"),
                one.name,
                f"is not about {null:g}",
                Remedy("correct the recordings, or identify a site by itself with ", Argument("site")),
            )
        own[one.name] = prior.sd
    if parameters is None:
        return None, own
    return tuple(one for one in parameters if one.name not in INSTRUMENT), own


def _widened(covariances: Covariances, ratio: float) -> Covariances:
    """Larger errors, but for those that all sites have alike."""
    return {source: part if source in ALIKE else ratio**2 * part for source, part in covariances.items()}


def _assumed_stiffness(law: IdentifiedLaw) -> dict[str, float]:
    """Stiffnesses of fat and fascia that were held, MPa."""
    every = {**law.nominal, **law.fixed}
    return {name: every[name] for name in _ASSUMED if name in every and name not in law.names}


def _applied(correction: Correction | None, displacement: FloatArray, values: Values) -> AppliedCorrection | None:
    """What a correction is at displacements (n,), mm, and the model's values."""
    if correction is None:
        return None
    c10, c20 = deep_stiffness(values)
    factor = correction.factor(displacement, np.asarray(c10), np.asarray(c20))
    modes = correction.relative_errors(displacement, c10, c20)
    sd = factor * np.sqrt(sum(mode**2 for mode in modes.values()))
    fibrous = any(source_of_mode(name) == "fibres" for name in modes)
    return AppliedCorrection(correction.name, 1 - factor, sd, fibrous)


def _test_fits(found: Found[JointComparison], single: SingleTests) -> list[TestFit]:
    """Every site beside the joint fit."""
    prediction, joint = found.linear.prediction, found.search.misfit
    every = zip(joint.tests, joint.spans, single.goodness(), single.by_itself(), strict=True)
    return [
        TestFit(
            test,
            tuple(
                ChannelFit(
                    channel,
                    prediction.values[span][own],
                    MappingProxyType({name: by[span][own] for name, by in prediction.sensitivities.items()}),
                )
                for channel, own in zip(test.data.channels, test.data.spans, strict=True)
            ),
            goodness,
            by_itself=MappingProxyType(own),
        )
        for test, span, goodness, own in every
    ]
