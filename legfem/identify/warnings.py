"""What a reader of a result must be told."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from legfem.common.doubts import Doubt
from legfem.common.units import mpa_to_kpa
from legfem.correction.choice import why_uncorrected, why_without_fibres
from legfem.data import LoadingCurve
from legfem.identify.applied_correction import AppliedCorrection
from legfem.identify.result import Cost
from legfem.identify.usual_stiffness import doubts_about_stiffness
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, key_of
from legfem.inverse.estimates import Estimate
from legfem.inverse.laws import LawName
from legfem.inverse.parameter import Prior
from legfem.inverse.search_log import FullSolve
from legfem.legs.elastography_priors import elastography_priors
from legfem.legs.plausibility import doubts_about, poisson_ratio
from legfem.legs.subject import Subject

LEAST_CHANCE = 1e-3
"""Chance of so large a misfit, were the law right, below which the law is doubted."""

# Standard deviations from a prior's centre that chance doesn't explain, and that two ways of
# measuring shouldn't lie apart.
_FAR, _DISAGREES = 3.0, 2.0


@dataclass(frozen=True, eq=False)
class Finding:
    """What warnings are drawn from."""

    subject: Subject
    law: LawName
    parameters: Mapping[str, Estimate]
    cost: Cost
    neo_hookean_limit: bool
    converged: bool
    solves: tuple[FullSolve, ...]
    correction: AppliedCorrection | None
    measured: LoadingCurve
    compromise: str
    """Of the best solve; see `legfem.inverse.outcome.Outcome`."""


def warnings_about(found: Finding) -> tuple[str, ...]:
    """Return one sentence a warning, the gravest first."""
    texts = [*(() if found.converged else (UNCONVERGED,))]
    if found.cost.p_value < LEAST_CHANCE:
        noise = float(found.measured.force_sd.mean())
        texts.append(
            f"The {found.law} law does not describe these recordings: the fit misses by "
            f"{found.cost.rms:.2g} N rms where their mean is known to {noise:.2g} N "
            f"(chi-square {found.cost.chi_square:.4g} for {found.cost.degrees_of_freedom} degrees "
            "of freedom). The intervals hold for the law as fitted and understate what is unknown."
        )
    texts += [
        *of_compromise(found.compromise),
        *begun_in_air(found.measured),
        *at_limits(found.law, found.parameters, found.neo_hookean_limit),
    ]
    failed = [solve for solve in found.solves if not solve.complete]
    if failed:
        texts.append(
            f"{len(failed)} of {len(found.solves)} full solves stopped short of "
            f"{found.measured.displacement[-1]:g} mm; the search kept away from them (C10 "
            + ", ".join(f"{mpa_to_kpa(solve.values[DEEP_C10]):.3g}" for solve in failed)
            + " kPa)."
        )
    texts += [
        *far_from_priors(found.parameters),
        *of_ends(found.subject, found.correction),
        *of_elastography(found.subject, found.parameters),
    ]
    for name, tissue in found.subject.tissues.items():
        if name != "deep" and (ratio := poisson_ratio(tissue)) is not None and ratio < 0:
            texts.append(
                f"The {name}'s Poisson's ratio is {ratio:.2f} with its C10 and D1 as given: its "
                "bulk modulus lies below 2/3 of its shear modulus."
            )
    return tuple(texts)


UNCONVERGED = (
    "The search ended before it converged: the optimum may lie elsewhere. Rerun with another --seed or narrower bounds."
)


def of_compromise(compromise: str) -> Iterator[str]:
    """Yield what the best solve's model gave up to go on, if anything."""
    if compromise:
        yield (
            f"The model of the best fit went on only with {compromise}: its force may be off by "
            "some percent, over very soft fat by more. Use less of the recordings' depth, and see "
            "whether C10 stays."
        )


def begun_in_air(measured: LoadingCurve) -> Iterator[str]:
    """Yield that first contact was looked for, where it was."""
    in_air = [contact.displacement for contact in measured.contacts if contact.in_air]
    if in_air:
        at = ", ".join(f"{displacement:.2f}" for displacement in in_air)
        yield (
            f"{len(in_air)} of {measured.n_trials} recordings seem to begin in air: "
            f"first contact is put at {at} mm. Very soft tissue that stiffens looks alike; if "
            "displacement counts from first touch, say so in subject.toml: [recordings] "
            "starts_at_contact = true."
        )


def at_limits(law: LawName, parameters: Mapping[str, Estimate], neo_hookean_limit: bool) -> Iterator[str]:
    """Yield which parameters stand at a bound of the search."""
    for name, one in parameters.items():
        if one.at_bound and not (name == DEEP_C20 and neo_hookean_limit):
            yield f"{key_of(name)} stands at the {one.at_bound} bound of the search."
    if law == "reduced-polynomial" and neo_hookean_limit:
        yield (
            "The reduced polynomial's optimum is its neo-Hookean limit (C20 = 0): these recordings "
            "show no stiffening of the deep tissue beyond it."
        )


def far_from_priors(parameters: Mapping[str, Estimate]) -> Iterator[str]:
    """Yield what the recordings say otherwise than was known beforehand."""
    for name, one in parameters.items():
        prior = one.parameter.prior
        if prior is not None and abs(prior.departure(one.value)) > _FAR:
            yield (
                f"The recordings put {key_of(name)} {abs(prior.departure(one.value)):.1f} standard "
                "deviations from the centre of its prior: one of the two is wrong, or the model is."
            )


def of_ends(subject: Subject, correction: AppliedCorrection | None) -> Iterator[str]:
    """Yield what is to be known of the cylinder's ends, and of fibres under them."""
    if correction is None:
        yield f"No 3D correction is applied: {_without_correction(subject)}"
    elif not subject.plane_strain:
        yield from _of_fibres(subject, correction.with_fibres)


def of_elastography(subject: Subject, parameters: Mapping[str, Estimate]) -> Iterator[str]:
    """Yield where elastography and indentation disagree."""
    for name, prior in elastography_priors(subject.elastography).items():
        one = parameters.get(name)
        if one is not None and one.parameter.prior == prior:
            yield from disagreement(name, prior, one.value, one.standard_error)


def disagreement(
    name: str, prior: Prior, value: float, standard_error: float, found_by: str = "indentation"
) -> Iterator[str]:
    r"""Yield that a stiffness found with a prior from elastography is far from that.

    Where both are right, an optimum departs from a prior of standard deviation :math:`s_0` by one
    of :math:`\sqrt{s_0^2 - s^2}`, with its own error s.

    Parameters
    ----------
    name
        Full name, of a stiffness in MPa as all numbers here.
    found_by
        What the stiffness was found from, with the prior.
    """
    if not standard_error < prior.sd:
        return
    apart = (value - prior.centre) / math.sqrt(prior.sd**2 - standard_error**2)
    if abs(apart) > _DISAGREES:
        higher, lower = (found_by, "elastography") if apart > 0 else ("elastography", found_by)
        yield (
            f"{higher[0].upper()}{higher[1:]} finds a higher {key_of(name)} than {lower} does, by "
            f"{abs(apart):.1f} standard deviations ({prior.source}: C10 "
            f"{mpa_to_kpa(prior.centre):.3g} ± {mpa_to_kpa(prior.sd):.2g} kPa). Shear waves of "
            "100 Hz and more meet a stiffer tissue than a slow test does: a wider sd_kPa should "
            "hold that, or one of the two is wrong."
        )


def doubts_of(found: Finding) -> tuple[Doubt, ...]:
    """Return what is unlikely in the input, and in stiffnesses that nobody has found so."""
    return (*doubts_about(found.subject), *doubts_about_stiffness(found.subject, found.parameters))


def _of_fibres(subject: Subject, in_correction: bool) -> Iterator[str]:
    if subject.fibres is None:
        yield _NO_FIBRES
        return
    known = (
        f"Muscle is taken to be {subject.fibres} times as stiff in shear along the leg as across "
        f"({subject.fibres.provenance}: {subject.fibres.source})"
    )
    if not in_correction:
        why = why_without_fibres(subject) or "it was given by itself"
        yield f"{known}, but the 3D correction has no fibres: {why}. --model 3d has them."
        return
    error = "and C10's interval has the error of that"
    if not subject.fibres.sd:
        error += ", but none of the ratio, which is stated without (fibre_ratio_sd)"
    yield f"{known}: the 3D correction has what fibres do, {error}."


_NO_FIBRES = (
    "The 3D correction takes muscle to be alike in all directions. Where its shear modulus along "
    "the leg is three times that across, a cylinder of 50 mm meets 13 to 27 % more force "
    "(studies/fibres), and C10 is about as much too high. State fibre_ratio under [tissues.deep], "
    "or [[elastography]] along and across."
)


def _without_correction(subject: Subject) -> str:
    if subject.plane_strain:
        return (
            "these recordings are simulated in plane strain and hold no end effects. Recordings of "
            "a leg get one by default."
        )
    other = why_uncorrected(subject)
    return (
        "a constant factor on the force can't be told from C10, so end effects are part of the "
        f"stiffness given here.{'' if other is None else f' There is none by default: {other}.'}"
    )
