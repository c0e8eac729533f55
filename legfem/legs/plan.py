"""Plans for a subject: after an ambiguous diagnosis, and before any test."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.linalg import inv

from legfem.channels.kind import FramesFile
from legfem.channels.kinds import FILE_OF, plans
from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.data.phases import UNLOADING
from legfem.geometry.indenter import Site
from legfem.inverse.advice import HOLD_A_MINUTE, TWO_RATES
from legfem.inverse.averaging import POWER, variance_beside, weights_of
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20
from legfem.inverse.channel_readings import PlannedChannel, StationChannel
from legfem.inverse.errors import NuisanceEffect, error_model
from legfem.inverse.library import Detail
from legfem.inverse.library_tasks import rounded
from legfem.inverse.linearised import LinearisedProblem, nuisance_effects
from legfem.inverse.map_fit import fit
from legfem.inverse.mechanism import Mechanism, TissueMechanism, null_of, prior_of, shown_mechanisms
from legfem.inverse.observations import Observations, blank_observations
from legfem.inverse.plan import (
    Candidate,
    Design,
    DesignValue,
    evaluate_design,
    evaluate_readings,
    expected_log_factor,
    prior_candidates,
    ranked,
)
from legfem.inverse.posterior import Mixture
from legfem.inverse.predictor import Predictor
from legfem.inverse.trial_noise import Noise
from legfem.inverse.verdict import Diagnosis
from legfem.legs.correction_of_leg import choose_correction
from legfem.legs.diagnosis import Diagnoser, accuracy_of, ruled_out_of
from legfem.legs.subject import Subject
from legfem.mechanisms import mechanisms
from legfem.mechanisms.muscle import NamedMuscle
from legfem.solve.protocol import Protocol

USUAL_GAIN_SD = 0.01
_OPEN = 1e-4
"""Weight of what is known of a muscle's stiffness beforehand: nothing within a factor of a million."""
REPEATS = 3


@dataclass(frozen=True)
class Expected:
    """What a plan before any test is made for.

    Parameters
    ----------
    c10, c20
        Stiffness of the deep tissue that is expected (MPa).
    depth, rate
        Of the test that is meant (mm, mm/s).
    """

    c10: float
    c20: float
    depth: float
    rate: float


def plan_after(found: Diagnosis, subject: Subject, diagnoser: Diagnoser, progress: Progress) -> list[DesignValue]:
    """Return what could be done next, the best first; nothing unless the verdict is ambiguous.

    Parameters
    ----------
    found
        The diagnosis.
    subject
        Whose.
    diagnoser
        That made it.
    progress
        Told of solutions.
    """
    if found.verdict != "ambiguous":
        return []
    models = found.models
    library = found.base_model.problem.predictor.library
    # Responses reach beyond a test: one to their end would ask for deeper ones.
    deepest, site = float(library.grid[-2]), Site(subject.section, subject.indenter)
    tests = designs(found.observed.depth, found.observed.rates[0], deepest, site, found.observed)
    tests = _beside(tests, found.observed.channels)
    asked = list(dict.fromkeys(m for model in models for m in model.fit.mechanisms))
    complete, _ = diagnoser.tabulating(subject, _at_all(tests), library.middle, progress, asked)
    plain = replace(found.base_model.problem.predictor, responses=complete(library.detail), offset=0.0)
    told = [(" + ".join(one.names) or "something unknown", one, one.posterior) for one in models]
    candidates = [Candidate(name, one.fit, own.mean, own.covariance, one.probability) for name, one, own in told]
    found_by_tests = _reckoned(tests, candidates, plain, subject, found.errors.noise, found.best.posterior.gain_sd)
    accuracy = accuracy_of(subject)
    known = {one.effect for one in accuracy.effects}
    untold = [m for m in asked if m.name not in known]
    return ranked([*found_by_tests, *evaluate_readings(untold, candidates, accuracy)])


def bought_in_visit(found: Diagnosis, subject: Subject, can: Collection[str]) -> dict[str, float]:
    """Return factors on C10's interval that one more trial is expected to bring, by what to do, the best first.

    Explanations that it tells apart weigh less by then, and by each C10 is known better. Nothing is solved for it: what
    follows a path, as relaxation does, tells nothing here.

    Parameters
    ----------
    found, subject
        The diagnosis, and whose.
    can
        What a visit allows.
    """
    observed, problem = found.observed, found.weighted_base.problem
    along = {m.name for m in mechanisms() if isinstance(m, TissueMechanism) and m.along_path}
    told = [one for one in weights_of(found.explained, DEEP_C10) if not along & {*one[0].names}][:6]
    candidates = [Candidate(str(e.names), e.fit, e.posterior.mean, e.posterior.covariance, w) for e, w in told]
    weights, every = np.array([weight for _, weight in told]), [e.distribution(DEEP_C10) for e, _ in told]
    depth, rate, same = observed.depth, observed.rates[0], Protocol.ramp(observed.depth, observed.rates[0])
    tests = [Design("press again", (same,)), *with_channels(same, Site(subject.section, subject.indenter), 1)]
    held, faster = (Protocol.cycle(depth, rate, _HOLD_S),), (Protocol.ramp(depth, _FASTER * rate),)
    ways = (
        ("hold", HOLD_A_MINUTE, Design(f"hold at {depth:.0f} mm for {_HOLD_S:g} s", held)),
        ("rates", TWO_RATES, Design(f"press at {_FASTER * rate:.2g} mm/s", faster)),
    )
    tests += [design for way, step, design in ways if way in can and not step.taken(observed)]
    seen = {kind for kind, file in FILE_OF.items() if (file.entry if isinstance(file, FramesFile) else kind) in can}
    tests = [one for one in tests if all(sight.name in seen for sight in one.channels)]
    bought, noise, gain_sd = {}, found.errors.noise, found.best.posterior.gain_sd
    for one in _reckoned(_beside(tests, observed.channels), candidates, problem.predictor, subject, noise, gain_sd):
        further = one.design.protocols if isinstance(one.design, Design) else ()
        blank = blank_observations([*(own.protocol for own in observed.protocols), *further])
        told_from = [[one.chances.get((a.name, b.name), 0.0) for b in candidates] for a in candidates]
        less = np.exp(-POWER * expected_log_factor(np.array(told_from)))
        narrower = [own.narrowed(factor) for own, factor in zip(every, one.narrows, strict=True)]
        then = [Mixture.joined([*(weights * left)], narrower).moments[1] for left in less]
        stays = [u for u in problem.unseen if u.mechanism.hides_in_stiffness or u.mechanism.untestable(blank)]
        hidden, left = (variance_beside(found.explained, each) for each in (problem.unseen, stays))
        now, after = Mixture.joined([*weights], every).moments[1] + hidden, np.average(then, weights=weights) + left
        bought[one.design.name] = float(np.sqrt(after / now))
    return dict(sorted(bought.items(), key=lambda pair: pair[1]))


def _beside(tests: Sequence[Design], channels: Sequence[StationChannel]) -> list[Design]:
    """Return tests in which channels that were recorded are recorded again; those that add none of theirs are left."""
    again = tuple(PlannedChannel(one.name, places=one.places) for one in channels)
    recorded = {one.name for one in channels}
    news = [tuple(one for one in test.channels if one.name not in recorded) for test in tests]
    return [
        replace(test, channels=(*again, *new))
        for test, new in zip(tests, news, strict=True)
        if new or not test.channels
    ]


@dataclass(frozen=True, eq=False)
class MusclesTold:
    """How well a test is expected to tell how stiff muscles are that are known by name, all of them unknown at once.

    Parameters
    ----------
    test
        In words.
    names
        ``deep``, for the rest of the muscle, then the k muscles and groups.
    covariance
        (k + 1, k + 1): of the logarithms of their C10.
    """

    test: str
    names: tuple[str, ...]
    covariance: FloatArray

    @property
    def sd(self) -> dict[str, float]:
        """Standard deviation of each one's C10, over it."""
        return dict(zip(self.names, map(float, np.sqrt(np.diag(self.covariance))), strict=True))

    @property
    def alike(self) -> list[tuple[str, str]]:
        """Pairs that aren't told apart: of which one may be twice as stiff as the other within two standard errors."""
        own = np.diag(self.covariance)
        of_ratios = own[:, None] + own - 2 * self.covariance
        return [(self.names[i], self.names[j]) for i, j in np.argwhere(np.triu(of_ratios, 1) > (0.5 * np.log(2)) ** 2)]


def plan_before(
    subject: Subject,
    others: Sequence[Subject],
    diagnoser: Diagnoser,
    expected: Expected,
    progress: Progress,
    asked: Sequence[Mechanism] = (),
) -> tuple[list[DesignValue], list[MusclesTold]]:
    """Return what tests of a leg would tell, the most telling first, and of muscles that are known by name.

    Parameters
    ----------
    subject
        The leg, without recordings.
    others
        The same at its other sites.
    diagnoser
        Whose folder keeps the leg's responses.
    expected
        Stiffness and test.
    progress
        Told of solutions.
    asked
        Mechanisms that are weighed; all that the leg may have without them.
    """
    site = Site(subject.section, subject.indenter)
    tests = designs(expected.depth, expected.rate, expected.depth, site)
    ends = choose_correction("auto", subject)
    every = _at_all(tests)
    able, _ = shown_mechanisms(asked or diagnoser.mechanisms_of(subject), every, ruled_out_of(subject, ends))
    complete, _ = diagnoser.tabulating(subject, every, rounded(expected.c10), progress, able)
    # Usual effects are far from those at nodes.
    near = [m for m in able if isinstance(m, TissueMechanism) and not m.nodes]
    library = complete(Detail.of_all(near, pairs=False))
    able = [m for m in able if m.name not in library.missing]
    law = subject.tissues["deep"].law
    observed = blank_observations([Protocol.ramp(expected.depth, expected.rate)] * 3)
    predictor = Predictor(observed, library, law, ends, accuracy_of(subject).measured.get(DEEP_C10))
    noise = _stated(subject, observed)
    values = {DEEP_C10: expected.c10, DEEP_C20: expected.c20}
    force = predictor(values)
    problem = LinearisedProblem(predictor, error_model(observed.with_force(force), noise, force))
    candidates = prior_candidates(fit(problem, (), values, evaluations=0), able)
    found = ranked(_reckoned(tests, candidates, predictor, subject, noise, USUAL_GAIN_SD))
    muscles = [m for m in able if isinstance(m, NamedMuscle)]
    if not muscles:
        return found, []
    names, same = ("deep", *(m.muscle for m in muscles)), tests[0]
    told = [
        MusclesTold(test.name, names, _left_by(muscles, values, test, predictor, subject))
        for test in _solved([same, *(test for test in tests if test.channels)], predictor)
    ]
    if others:
        # Sites share nothing but their tissues.
        each = (plan_before(one, (), diagnoser, expected, progress, muscles)[1][:1] for one in others)
        elsewhere = [one for first in each for one in first if one.names == names]
        left = inv(sum(inv(one.covariance) for one in (told[0], *elsewhere)))
        told.append(MusclesTold(f"{same.name}, at {', '.join(one.site for one in others)}, too", names, left))
    return found, told


def _left_by(
    muscles: Sequence[NamedMuscle], values: Mapping[str, float], test: Design, predictor: Predictor, subject: Subject
) -> FloatArray:
    """Return the covariance of ln C10 of the deep tissue and of muscles that a test leaves, nothing known of them."""
    start = {**values, **{m.strength_name: null_of(m.parameters[0]) for m in muscles}}
    new = replace(predictor, observed=blank_observations(test.protocols, test.channels), measured=None)
    readings = new(start, muscles)
    effects = nuisance_effects(new.library.nuisances, new.observed, readings, accuracy_of(subject))
    observed, images = new.observed.with_values(readings), new.images_elsewhere(start, muscles)
    errors = error_model(observed, _stated(subject, observed), readings, effects, images=images)
    fitted = fit(LinearisedProblem(replace(new, observed=observed), errors), muscles, start, evaluations=0)
    own = [fitted.free.index(name) for name in (DEEP_C10, *(m.strength_name for m in muscles))]
    known = np.diag(np.where(np.isin(np.arange(len(fitted.free)), own), _OPEN, 1.0))
    # C10 of a muscle is its factor times that of the rest.
    scale = np.diag([prior_of(fitted.parameters[k]).sd for k in own])
    scale[:, 0] = scale[0, 0]
    return np.asarray(scale @ inv(fitted.jacobian.T @ fitted.jacobian + known)[np.ix_(own, own)] @ scale.T)


def _reckoned(
    tests: list[Design],
    candidates: list[Candidate],
    predictor: Predictor,
    subject: Subject,
    noise: Noise,
    gain_sd: float,
) -> list[DesignValue]:
    """Return what tests are worth whose responses are known."""
    known, library = accuracy_of(subject), predictor.library

    def nuisances(test: Design, blank: Observations, readings: FloatArray) -> list[NuisanceEffect]:
        accuracy = replace(known, contour_sd=0.0) if test.outlines_known else known
        return nuisance_effects(library.nuisances, blank, readings, accuracy)

    able = _solved(tests, predictor)
    found = [evaluate_design(test, candidates, predictor, nuisances, noise, gain_sd) for test in able]
    return [one for one in found if one is not None]


def _solved(tests: Sequence[Design], predictor: Predictor) -> list[Design]:
    """Return the tests of which all that they read is known."""
    blank = [blank_observations(test.protocols, test.channels) for test in tests]
    known = predictor.library.beside.names
    return [test for test, one in zip(tests, blank, strict=True) if one.with_channels(known) is one]


def _at_all(tests: Sequence[Design]) -> Observations:
    """Return observations of nothing in the protocols of all tests."""
    return blank_observations(list(dict.fromkeys(p for test in tests for p in test.protocols)))


def _stated(subject: Subject, observed: Observations) -> Noise:
    instrument = subject.instrument
    each = instrument.force_sd / float(np.sqrt(2))
    return Noise(
        each,
        each,
        observed.slowest,
        instrument.force_sd,
        instrument.displacement_sd,
        "the instrument's stated accuracy only (nothing was recorded)",
    )


def designs(
    depth: float, rate: float, deepest: float, site: Site, recorded: Observations | None = None
) -> list[Design]:
    """Return the tests that are weighed.

    Parameters
    ----------
    depth, rate
        Of the test that was made, or is meant to be made (mm, mm/s).
    deepest
        That the leg's responses reach (mm).
    site
        Where the leg is pressed.
    recorded
        Of the test that was made: what it had, air above the skin among it, tells nothing more.
    """
    same = Protocol.ramp(depth, rate)
    held = Protocol.cycle(depth, rate, _HOLD_S)
    fast = Protocol.cycle(depth, _FASTER * rate, _HOLD_S)
    cycles = [
        Design(f"hold the deepest position for {_HOLD_S:g} s, and record the unloading", (held,) * REPEATS),
        Design(
            f"press at two rates ({rate:.2g} and {_FASTER * rate:.2g} mm/s), each with a hold and unloading",
            (held,) * REPEATS + (fast,) * REPEATS,
        ),
    ]
    if recorded is not None and HOLD_A_MINUTE.taken(recorded) and UNLOADING in recorded.phases:
        cycles = [] if TWO_RATES.taken(recorded) else cycles[1:]
    found = [
        Design(f"repeat the same test {REPEATS} times", (same,) * REPEATS),
        *cycles,
        Design(
            "measure the outlines of skin and fascia under the indenter (ultrasound), and press again",
            (same,) * REPEATS,
            outlines_known=True,
        ),
        Design("press with a cylinder of twice the length", (same,) * REPEATS, length_factor=2.0),
        Design(
            "press half as deep, with the same cylinder and more repeats",
            (Protocol.ramp(0.5 * depth, rate),) * (2 * REPEATS),
        ),
    ]
    found += with_channels(same, site)
    if recorded is None or not recorded.shows_air:
        told = "begin 2 mm above the skin, slowly, so that first contact is seen"
        found.append(Design(told, (same,) * REPEATS, contact_known=True))
    deeper = min(depth + _DEEPER_MM, deepest)
    if deeper > depth + 1.0:
        found.append(Design(f"press {deeper:.0f} mm deep", (Protocol.ramp(deeper, rate),) * REPEATS))
    return found


def with_channels(same: Protocol, site: Site, repeats: int = REPEATS) -> list[Design]:
    """Return the same test of a site with further channels than the force."""
    depth = float(max(same.displacement))
    frames = 0.5 * depth, depth
    at = f"{frames[0]:.0f} and {frames[1]:.0f} mm"
    return [
        Design(
            f"{plan.asks.format(at=at)}, in the same test",
            (same,) * repeats,
            channels=tuple(
                PlannedChannel(one.name, frames if plan.frames else (), one.places) for one in plan.channels
            ),
            effort=plan.effort,
        )
        for plan in plans(site)
    ]


_FASTER = 5.0


_HOLD_S = 60.0


_DEEPER_MM = 5.0
