"""A leg's diagnosis: its recordings, library, mechanisms and accuracy, and what is unlikely of what was found."""

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from legfem.common.errors import Argument, Doubt, InputError, UnsolvedError
from legfem.common.numbers import share
from legfem.common.progress import NEVER, Deadline, Progress, Silent, TimeIsUpError, Until
from legfem.data import Recording
from legfem.inverse.accuracy import check_measured
from legfem.inverse.answer import FitNotice, Notice, doubted
from legfem.inverse.catalogue import DEEP_C10, LAWS, deep_stiffness
from legfem.inverse.channel_readings import not_read
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.diagnose import DiagnosisInput, Identified, diagnose
from legfem.inverse.elastography import disagreement, elastography_priors
from legfem.inverse.explanation import ADDS_FROM, log_bayes_factor
from legfem.inverse.fit import Identity
from legfem.inverse.library import UNTRIED, Detail, Library
from legfem.inverse.library_build import base_library, build_library, geometric_changes
from legfem.inverse.library_tasks import ROUND, STIFFENING, STIFFENINGS, middle_of, rounded, stiffness_at
from legfem.inverse.mechanism import shown_mechanisms
from legfem.inverse.observations import Observations, observe
from legfem.inverse.problem import fit
from legfem.inverse.responses import SolvedResponses
from legfem.inverse.screening import Complete
from legfem.inverse.settings import SearchRequest
from legfem.inverse.trial_noise import trial_covariance
from legfem.inverse.verdict import Diagnosis, solution_notices
from legfem.legs.correction_of_leg import choose_correction, why_without_fibres
from legfem.legs.finite_element_models import solved_responses
from legfem.legs.identification import as_leg
from legfem.legs.notices import LegNotice
from legfem.legs.nuisances import ShapeAccuracy, accuracy_of_shape
from legfem.legs.plausibility import doubts_about, doubts_about_stiffness
from legfem.legs.problem import leg_problem
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import Subject
from legfem.legs.unknowns import Geometry
from legfem.mechanisms import OCCURRENCES, Mechanism, mechanisms_of
from legfem.mechanisms.muscle import MuscleFibres
from legfem.mechanisms.rig import EndEffects


@dataclass(eq=False)
class Diagnoser:
    """Diagnoses subjects; legs with the same section share meshes, solutions and library.

    Parameters
    ----------
    folder
        Of the responses; see `legfem.legs.finite_element_models.library_folder`.
    correction
        Of 3D effects, for the mechanism ``end-effects``.
    jobs
        Processes that build a library.
    deadline
        After which nothing more is solved.
    """

    folder: Path
    correction: TabulatedCorrection | None
    jobs: int = 1
    deadline: Deadline = NEVER
    _legs: dict[str, tuple[SolvedResponses, SolvedResponses]] = field(default_factory=dict, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Leave meshes out: every process makes its own."""
        return {**self.__dict__, "_legs": {}}

    def observations(self, subject: Subject) -> Observations:
        """Return a subject's recordings at their stations."""
        observed = observe(subject.trials)
        told = [*observed.notices, *not_read(subject.recordings)]
        if not subject.instrument.stated:
            told.append(Notice.of(FitNotice.NO_ACCURACY_STATED, file=SUBJECTS.file))
        if subject.plane_strain and not subject.plane_strain_stated:
            told.append(Notice.of(LegNotice.ENDS_NOT_STATED))
        if (ends := choose_correction("auto", subject)) and ends.beyond:
            told.append(Notice.of(LegNotice.CORRECTION_BEYOND, **ends.beyond))
        if observed.repeats < 2:
            told.append(Notice.of(FitNotice.NOT_REPEATED))
        return replace(observed, notices=tuple(told))

    def mechanisms_of(self, subject: Subject) -> list[Mechanism]:
        """Return all mechanisms, those of a subject's leg."""
        return with_correction(mechanisms_of(subject.section), self.correction)

    def _responses(self, subject: Subject, observed: Observations) -> tuple[SolvedResponses, SolvedResponses]:
        """Return a leg's full solutions, on the default mesh and on coarser ones."""
        made = solved_responses(subject, observed, self.folder)
        return self._legs.setdefault(repr(sorted(made[0].fingerprint.items())), made)

    def tabulating(
        self,
        subject: Subject,
        observed: Observations,
        middle: float,
        progress: Progress,
        asked: Sequence[Mechanism] | None = None,
    ) -> tuple[partial[Library], SolvedResponses]:
        """Return what solves the library for recordings about a middle C10 (MPa), and full solutions of the leg.

        Parameters
        ----------
        subject, observed
            The leg and its recordings.
        middle
            MPa.
        progress
            Told of solutions.
        asked
            Mechanisms that are tabulated; all that the recordings can show without it.
        """
        if asked is None:
            asked, _ = shown_mechanisms(self.mechanisms_of(subject), observed, ruled_out_of(subject, None))
        asked = sorted(asked, key=lambda one: (*FIRST, one.name).index(one.name))
        fine, coarse = self._responses(subject, observed)
        stiffening = STIFFENING[subject.tissues["deep"].law]
        there = coarse.elastic(stiffness_at(middle, stiffening))["force"]
        solved = fine if np.isnan(there).any() else coarse
        return partial(build_library, solved, observed, asked, self.jobs, progress, middle, stiffening), fine

    def identified(
        self,
        subject: Subject,
        progress: Progress,
        start: Mapping[str, float] | None = None,
        geometry: Geometry | None = None,
    ) -> Identified:
        """Return the base model's fit, as an identification has it, looked for first at values (MPa).

        What errors of the geometry do may be known; see `legfem.legs.problem.leg_problem`.
        """
        law = subject.tissues["deep"].law
        request = SearchRequest(
            out=self.folder, responses=self.folder, start=start or {}, jobs=self.jobs, progress=progress
        )
        # A neo-Hookean fit is weighed by errors about one with C20, as where both laws are identified.
        laws, corrections = LAWS if law == LAWS[0] else [law], [choose_correction("auto", subject)]
        (found,) = fit(leg_problem(as_leg(subject), laws, request, corrections, geometry=geometry), [law], request)
        return Identified(found, found.details.stations[0])

    def diagnose(self, subject: Subject, progress: Progress, seed: int = 0) -> Diagnosis:
        """Diagnose a subject's recordings.

        By the base model on a coarse mesh first, which is told. What the deadline leaves is provisional: effects beside
        one solution of the base model, else that first answer.

        Raises
        ------
        UnsolvedError
            If too few solutions come as far as was recorded.
        """
        observed = self.observations(subject)
        first, screened = self.by_base_model(subject, observed, seed), None
        c10, c20 = deep_stiffness(first.base_model.fit.values)
        low, high = first.shown_interval(DEEP_C10)
        progress.stage(f"by the base model alone C10 is {low:.2g} to {high:.2g} kPa; no effect is weighed yet")
        told = Until(progress, self.deadline)
        library = first.base_model.problem.predictor.library
        # What the first answer was solved of serves on where it is near.
        middle = library.middle if abs(math.log(c10 / library.middle)) < ROUND else rounded(c10)
        complete, solved = self.tabulating(subject, observed, middle, told)
        centre = stiffness_at(middle, STIFFENING[subject.tissues["deep"].law])
        coarse = self._responses(subject, observed)[1]
        try:
            self.deadline.check()
            if self.deadline != NEVER:
                nearest = min(STIFFENINGS, key=lambda one: abs(one - math.log1p(c20 / c10)))
                screened = self.given(subject, observed, partial(complete, lattice=[(0.0, nearest)]), None)
                self.deadline.check()
            identified = self.identified(
                subject,
                told,
                first.base_model.fit.values,
                lambda *_: geometric_changes(coarse, observed, centre, self.jobs, told),
            )
            given = self.given(subject, observed, complete, identified)
        except TimeIsUpError:
            if screened is None:
                return first
            return replace(diagnose(screened, None, progress, seed, self.deadline), provisional=True)
        return diagnose(given, solved, progress, seed, self.deadline)

    def by_base_model(self, subject: Subject, observed: Observations, seed: int = 0) -> Diagnosis:
        """Diagnose the force alone by the base model on the coarsest mesh that does, with no effect weighed."""
        stiffening, forces = STIFFENING[subject.tissues["deep"].law], replace(observed, channels=())

        def answer(library: Library) -> Diagnosis:
            alone = replace(library, missing=dict.fromkeys((one.name for one in self.mechanisms_of(subject)), UNTRIED))
            given = self.given(subject, forces, lambda _: alone, None)
            return replace(diagnose(given, None, Silent(), seed), provisional=True)

        for solved in reversed(self._responses(subject, observed)):
            middle = middle_of(observed, solved, stiffening)
            for derivatives in (False, True):
                if (library := base_library(solved, observed, middle, stiffening, derivatives)) is None:
                    break
                found = answer(library)
                middle = rounded(deep_stiffness(found.base_model.fit.values)[0])
            else:
                return found
        raise UnsolvedError(f"the model stops before {observed.depth:.1f} mm; use less of the recordings' depth")

    def given(
        self, subject: Subject, observed: Observations, complete: Complete, identified: Identified | None
    ) -> DiagnosisInput:
        """Return what a subject's diagnosis is given: recordings at their stations, mechanisms screened."""
        ends, library = choose_correction("auto", subject), complete(Detail())
        return DiagnosisInput(
            observed.with_channels(library.beside.names),
            subject.instrument,
            subject.tissues["deep"].law,
            library,
            self.mechanisms_of(subject),
            Identity(subject.id, subject.title, subject.origin, subject.directory),
            "leg",
            identified,
            accuracy_of(subject),
            ends,
            ruled_out_of(subject, ends),
            OCCURRENCES,
            complete,
            subject.at_rest,
        )


def ruled_out_of(subject: Subject, ends: TabulatedCorrection | None) -> dict[str, str]:
    """Return the mechanisms that can't be what was left out of a subject's model, and why."""
    limb, lacks = mechanisms_of(subject.section), subject.section.lacks
    absent = {one.name: f"the limb has no {one.needs}" for one in limb if one.needs in lacks}
    if ends is None:
        if not (subject.plane_strain and subject.plane_strain_stated):
            return {**WITHOUT_ENDS, **absent}
        why = "the folder says that the recordings are of plane strain, which has no ends"
        return dict.fromkeys((EndEffects.name, MuscleFibres.name), why) | absent
    found = {EndEffects.name: "the base model has the cylinder's ends, with the errors of that correction"}
    why_not = why_without_fibres(subject)
    if why_not is None and subject.fibres is not None:
        why_not = f"the base model has fibres of a ratio of {subject.fibres}, with its errors"
    if why_not is not None:
        found[MuscleFibres.name] = why_not
    return found | absent


def accuracy_of(subject: Subject) -> ShapeAccuracy:
    """Return how well a subject's leg is known; what shear waves measured of it counts as in an identification.

    Raises
    ------
    InputError
        If an effect was measured that legfem doesn't know, or that is impossible.
    """
    check_measured(subject.directory / "subject.toml", subject.measured, mechanisms_of(subject.section))
    known = accuracy_of_shape(subject)
    measured = elastography_priors(subject.elastography)
    if (prior := subject.stiffness_prior) is not None:
        if DEEP_C10 in measured:
            raise InputError(
                Argument("prior"), DEEP_C10, "was measured by shear waves, in subject.toml", "leave one out"
            )
        measured[DEEP_C10] = prior
    return replace(known, measured=measured, effects=subject.measured)


FIRST = ("prestress", "uneven-muscle", "superficial-stiffness", "fascia-stiffness", "strain-stiffening", "dermis")
"""Mechanisms that are solved before others: those that move the C10 of a calf most, if they are as usual."""
WITHOUT_ENDS: Mapping[str, str] = {
    MuscleFibres.name: "the base model has no ends of the cylinder, at which fibres would bend"
}
"""What can't be left out of a base model without the cylinder's ends, and why."""


def with_correction(every: Sequence[Mechanism], correction: TabulatedCorrection | None) -> list[Mechanism]:
    """Return mechanisms, the cylinder's ends with a leg's correction where there is one."""
    ends = EndEffects(correction)
    return [ends if isinstance(one, EndEffects) else one for one in every]


def notices_of(found: Diagnosis, subject: object) -> tuple[Notice, ...]:
    """Return what a reader must know of a diagnosis: doubts, where shear waves disagree, and the others."""
    of_input = (*doubted(doubts_of(found, subject)), *of_elastography(found, subject))
    return (*of_input, *found.observed.notices, *solution_notices(found))


def of_elastography(found: Diagnosis, subject: object) -> Iterator[Notice]:
    """Yield where the base model and shear waves ask for another stiffness."""
    known = elastography_priors(subject.elastography).get(DEEP_C10) if isinstance(subject, Subject) else None
    if known is not None:
        alone = found.weighted_base
        yield from disagreement(DEEP_C10, known, alone.value(DEEP_C10), alone.fit.sd(DEEP_C10))


def doubts_of(found: Diagnosis, subject: object) -> tuple[Doubt, ...]:
    """Return what is unlikely in recordings, in a leg's folder and in the stiffness of a leg."""
    of_repeats = () if found.aside is not None else tuple(_doubts_about_repeats(found))
    if not isinstance(subject, Subject):
        return of_repeats
    subject = _rest_of(subject, found)
    # As far as all explanations leave it open.
    known = {
        name: found.best.estimate(name, ends) for name, ends in found.intervals.items() if name in found.best.fit.free
    }
    of_stiffness = doubts_about_stiffness(subject, known)
    return (*doubts_about(subject), *of_repeats, *of_stiffness)


def _rest_of(subject: Subject, found: Diagnosis) -> Subject:
    """Return a subject whose recordings end where a part was set aside, which isn't doubted as well."""
    if found.aside is None:
        return subject
    observed, kept = found.observed, list[Recording]()
    for number, (one, trial) in enumerate(zip(subject.recordings, subject.trials, strict=True)):
        touched = found.aside.readings & (observed.trial[observed.nearest] == number)
        end = trial.touched + observed.time[observed.nearest][touched].min(initial=np.inf)
        if not (touched.any() and found.aside.whole):
            kept.append(one.part(one.time < end))
    return replace(subject, recordings=tuple(kept))


def _doubts_about_repeats(found: Diagnosis) -> Iterator[Doubt]:
    """Yield a doubt where repeats differ by more than the stated instruments make.

    A ripple over the drive and a leg that moves would pass for noise, whose size comes from the
    repeats.
    """
    noise, base = found.errors.noise, found.weighted_base
    none = replace(noise, slow_sd=0.0, wander_sd=0.0)
    told = (
        (noise.beyond_force, noise.slow_sd, "force_N", "N", replace(none, slow_sd=noise.beyond_force)),
        (noise.beyond_way, noise.wander_sd, "displacement_mm", "mm", replace(none, wander_sd=noise.beyond_way)),
    )
    odds = max((log_bayes_factor(one, base) for one in found.explained.every if not one.is_base), default=0.0)
    for size, most, column, unit, seen in told:
        if size > 0:
            slow = trial_covariance(found.observed, seen) - trial_covariance(found.observed, none)
            moves = base.moved_by(slow, DEEP_C10) if DEEP_C10 in base.fit.free else None
            # Were it noise, what speaks against the base model would count the less.
            unsure = found.verdict != "consistent" and odds * (most / size) ** 2 < ADDS_FROM
            by = f", which moves C10 by {share(moves)} at most" if moves is not None else ""
            problem = f"trials differ slowly by {size:.2g} {unit} beside gain, zero and first contact, where noise of "
            problem += f"the stated accuracy makes {most:.2g} {unit} at most{by}"
            mend = "lay the trials over each other: did leg or rig move, the drive ripple? or state the rig's accuracy"
            trials, effect = ", ".join(found.observed.trials), None if unsure else moves
            yield Doubt(trials, column, problem, mend, effect_on_C10=effect)
