"""A subject folder's diagnosis, its library and solutions kept on disk."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from legfem.common.progress import Progress
from legfem.data import Instrument
from legfem.diagnose.diagnosis import Diagnosis, diagnose
from legfem.diagnose.fit import Fit, NuisanceEffect
from legfem.diagnose.leg import solved_responses
from legfem.diagnose.library import Library
from legfem.diagnose.library_build import WITHOUT_ENDS, build_library, shown_mechanisms, with_correction
from legfem.diagnose.measured import check_measured, measured_strengths
from legfem.diagnose.mechanisms import Mechanism, mechanisms
from legfem.diagnose.mechanisms.end_effects import EndEffects
from legfem.diagnose.mechanisms.muscle_fibres import MuscleFibres
from legfem.diagnose.nuisances import DRAWN, Accuracy, nuisance_effects
from legfem.diagnose.observations import Observations, observe
from legfem.diagnose.predict import LawName, Predictor
from legfem.diagnose.solved import SolvedResponses
from legfem.legs.correction import TabulatedCorrection
from legfem.legs.correction_of_leg import choose_correction, why_without_fibres
from legfem.legs.elastography import elastography_priors
from legfem.legs.subject import Subject

STIFFENING = {"neo-hookean": 0.0, "reduced-polynomial": 0.8}
"""ln(1 + C20 / C10) at which a leg's changes are tabulated, by its law."""


@dataclass(eq=False)
class Diagnoser:
    """Diagnoses subjects; legs with the same section share meshes, solutions and library.

    Parameters
    ----------
    folder
        Of the responses; see `legfem.diagnose.leg.library_folder`.
    correction
        Of 3D effects, for the mechanism ``end-effects``.
    jobs
        Processes that build a library.
    """

    folder: Path
    correction: TabulatedCorrection | None
    jobs: int = 1
    _legs: dict[str, tuple[SolvedResponses, SolvedResponses]] = field(default_factory=dict, repr=False)
    _libraries: dict[str, Library] = field(default_factory=dict, repr=False)

    def __getstate__(self) -> dict[str, Any]:
        """Leave meshes and libraries out: every process makes its own."""
        return {**self.__dict__, "_legs": {}, "_libraries": {}}

    def observations(self, subject: Subject) -> Observations:
        """Return a subject's recordings at their stations."""
        observed = observe(subject.trials)
        remarks = list(observed.remarks)
        if not subject.instrument.stated:
            remarks.append(
                "subject.toml states no instrument accuracy: errors are those seen from sample to "
                "sample and between repeats. What drifts slowly or is alike in all trials can't be "
                "told from physics; state the data sheet's figures under [instrument]."
            )
        if subject.plane_strain and not subject.plane_strain_stated:
            remarks.append(
                "subject.toml doesn't say whether the simulation had the cylinder's ends, so they "
                "are among what may be left out; state plane_strain under [recordings]."
            )
        if observed.repeats < 2:
            remarks.append(
                "No protocol was repeated: errors between trials aren't seen, and come from "
                "the instruments' figures alone."
            )
        return replace(observed, remarks=tuple(remarks))

    def library(self, subject: Subject, observed: Observations, progress: Progress) -> tuple[Library, SolvedResponses]:
        """Return the library for recordings, and full solutions of the leg."""
        fine, coarse = solved_responses(subject, observed, self.folder)
        leg = repr(sorted(fine.fingerprint.items()))
        fine, coarse = self._legs.setdefault(leg, (fine, coarse))
        keys = leg + "".join(sorted(stations.key for stations in observed.protocols))
        if keys not in self._libraries:
            able, _ = shown_mechanisms(observed, self.correction)
            self._libraries[keys] = build_library(
                fine, coarse, observed, able, self.jobs, progress, STIFFENING[subject.tissues["deep"].law]
            )
        return self._libraries[keys], fine

    def diagnose(self, subject: Subject, progress: Progress, seed: int = 0) -> Diagnosis:
        """Diagnose a subject's recordings."""
        observed, accuracy = self.observations(subject), accuracy_of(subject)
        library, solved = self.library(subject, observed, progress)
        law, ends = subject.tissues["deep"].law, choose_correction("auto", subject)
        return diagnose_body(
            observed,
            subject.instrument,
            law,
            library,
            solved,
            progress,
            accuracy,
            ends,
            seed,
            ruled_out_of(subject, ends),
            with_correction(mechanisms(), self.correction),
        )


def diagnose_body(
    observed: Observations,
    instrument: Instrument,
    law: LawName,
    library: Library,
    solved: SolvedResponses | None,
    progress: Progress,
    accuracy: Accuracy | None = None,
    ends: TabulatedCorrection | None = None,
    seed: int = 0,
    ruled_out: Mapping[str, str] | None = None,
    every: Sequence[Mechanism] | None = None,
) -> Diagnosis:
    """Diagnose recordings of a leg, or of another body whose responses are tabulated.

    Parameters
    ----------
    observed
        The recordings at their stations.
    instrument
        Stated errors.
    law
        Of the deep tissue in the base model.
    library
        Of the body's responses.
    solved
        Full solutions, to confirm what is reported; emulated ones stand without it.
    progress
        Receives the steps.
    accuracy
        How well the body is known.
    ends
        The correction for the cylinder's ends, where the recordings have them.
    seed
        Of the draws that windows are judged by.
    ruled_out
        See `legfem.diagnose.library_build.shown_mechanisms`.
    every
        Mechanisms that the body may have; all that legfem knows without it.
    """
    accuracy = accuracy or Accuracy()
    able, untested = shown_mechanisms(observed, None, ruled_out, every)
    able = [m for m in able if m.name not in library.missing]

    def nuisances(base: Fit) -> list[NuisanceEffect]:
        stiffness = base.values["C10"], base.values.get("C20", 0.0)
        return nuisance_effects(library.nuisances, observed, base.prediction, accuracy, ends, stiffness)

    return diagnose(
        Predictor(observed, library, law, ends, accuracy.deep_C10),
        instrument,
        able,
        nuisances,
        solved,
        progress,
        measured_strengths(accuracy, able),
        {**untested, **library.missing},
        seed,
    )


def ruled_out_of(subject: Subject, ends: TabulatedCorrection | None) -> dict[str, str]:
    """Return the mechanisms that can't be what was left out of a subject's model, and why."""
    if ends is None:
        if not (subject.plane_strain and subject.plane_strain_stated):
            return dict(WITHOUT_ENDS)
        why = "the folder says that the recordings are of plane strain, which has no ends"
        return dict.fromkeys((EndEffects.name, MuscleFibres.name), why)
    found = {EndEffects.name: "the base model has the cylinder's ends, with the errors of that correction"}
    why_not = why_without_fibres(subject)
    if why_not is None and subject.fibres is not None:
        why_not = f"the base model has fibres of a ratio of {subject.fibres}, with its errors"
    if why_not is not None:
        found[MuscleFibres.name] = why_not
    return found


def accuracy_of(subject: Subject) -> Accuracy:
    """Return how well a subject's leg is known: what its folder states, else what is usual.

    A leg that was drawn is known but for rounding, unless its folder says otherwise; what shear
    waves measured of its tissues counts as in an identification.

    Raises
    ------
    InputError
        If an effect was measured that legfem doesn't know, or that is impossible.
    """
    check_measured(subject.directory / "subject.toml", subject.measured)
    given = subject.accuracy
    usual = Accuracy() if subject.origin == "measured" or given.stated else DRAWN
    return Accuracy(
        usual.contour_sd if given.contour_sd is None else given.contour_sd,
        usual.aim_sd if given.aim_sd is None else given.aim_sd,
        usual.direction_sd if given.direction_sd is None else given.direction_sd,
        usual.assumed_sd if given.assumed_sd is None else given.assumed_sd,
        measured=elastography_priors(subject.elastography),
        effects=subject.measured,
    )
