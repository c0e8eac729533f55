"""Identification of a tissue's law from all recordings of a specimen folder together."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.stats import chi2

from legfem.common.errors import InputError
from legfem.common.progress import Progress, Silent
from legfem.identify.assess import versions
from legfem.identify.warnings import LEAST_CHANCE, of_compromise
from legfem.inverse.comparison import total_of
from legfem.inverse.estimates import Estimate, Optimum, correlations_of, estimates
from legfem.inverse.instrument import READINGS
from legfem.inverse.intervals import quantile
from legfem.inverse.laws import LawName, model_values
from legfem.inverse.outcome import FullSolver, Outcome
from legfem.inverse.search import Search
from legfem.inverse.settings import IdentificationSettings
from legfem.jobs.store import Store
from legfem.specimens.comparing import check_strained, misfit_of, seeks_ratio, untold
from legfem.specimens.contact_search import where_it_seems, with_contacts
from legfem.specimens.folder import SpecimenFolder, stiffness_doubts
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.laws import Asked, identified_law
from legfem.specimens.misfit import SpecimenMisfit
from legfem.specimens.prepared import Prepared, prepare
from legfem.specimens.recorded import SpecimenRecording
from legfem.specimens.relaxation import QUICKENING, shows_quickening
from legfem.specimens.result import ComparedRecording, SpecimenResult
from legfem.specimens.tissues import REFERENCE_MPA


def identify_specimen(
    folder: SpecimenFolder,
    laws: Sequence[LawName],
    asked: Asked | None = None,
    leave_out: Sequence[str] = (),
    settings: IdentificationSettings | None = None,
    out: Path | None = None,
    jobs: int = 1,
    progress: Progress | None = None,
) -> list[SpecimenResult]:
    """Identify laws from all recordings of a folder together.

    Parameters
    ----------
    folder : SpecimenFolder
        With recordings.
    laws : sequence of str
        ``neo-hookean``, ``reduced-polynomial``, ``yeoh``, ``exponential``.
    asked : Asked, optional
        What is to be free or held, in place of the laws' own.
    leave_out : sequence of str
        Names of recordings or specimens that are predicted, and not fitted.
    settings : IdentificationSettings, optional
        Of the search.
    out : Path, optional
        Folder in whose ``solves`` every full solve is kept; none is without it.
    jobs : int
        Processes.
    progress : Progress, optional
        Told of every full solve.

    Raises
    ------
    InputError
        If no recording can be modelled, or there is no parameter or recording of a name.
    SearchError
        If too few full solves reach the recordings' depth.
    """
    held = {one for name in leave_out for one in folder.named(name)}
    if len(held) == len(folder.recordings):
        raise InputError("--leave-out", ", ".join(leave_out), "leave nothing to fit", "name fewer")
    asked, progress = asked or Asked(), progress or Silent()
    relaxes = folder.relaxes
    for name in laws:
        free = identified_law(name, folder.tissues, REFERENCE_MPA, relaxes, asked)
        if seeks_ratio(free.names):
            check_strained(folder, [one for one in folder.recordings if one not in held])
    prepared = prepare(folder, held, out, jobs, progress)
    return [
        _identify(folder, name, prepared, held, asked, settings or IdentificationSettings(), out, jobs, progress)
        for name in laws
    ]


def _identify(
    folder: SpecimenFolder,
    name: LawName,
    prepared: Prepared,
    held: set[SpecimenRecording],
    asked: Asked,
    settings: IdentificationSettings,
    out: Path | None,
    jobs: int,
    progress: Progress,
) -> SpecimenResult:
    started = time.perf_counter()
    away = {one.name for one in held}
    fitted = [where_it_seems(one, folder.returns) for one in prepared.recordings if one.name not in away]
    predicted = [one for one in prepared.recordings if one.name in away]
    tissues = [one.of_law(name) for one in folder.tissues]
    if not shows_quickening([one.course.rate for one in fitted]):
        asked = _without(QUICKENING, asked)
    free = identified_law(name, tissues, prepared.c10, folder.relaxes, asked)
    depth_of = dict(zip(prepared.tests, prepared.depths, strict=True))
    tests = tuple(dict.fromkeys(one.sizes for one in fitted))
    model = SpecimenForward.of_tissues(tests, tuple(depth_of[sizes] for sizes in tests), tissues, prepared.c10)
    seeks = seeks_ratio(free.names)
    why = untold(folder, fitted) if seeks else ""
    misfit = misfit_of(fitted, model, folder, seeks)
    store = None if out is None else Store(out / "solves", Outcome, model.fingerprint())
    sensitivities = tuple(free.names[k] for k in free.of_model)
    progress.stage(f"identifying the {name} law")
    with FullSolver(model, store, jobs, progress, sensitivities) as solver:
        search = Search(free, misfit, settings, solver)
        search, fitted = with_contacts(search, fitted, model, folder, seeks)
    misfit, best = search.misfit, search.best
    linear = search.linearised(best)
    force = linear.prediction.force
    readings = free.readings(best.point)
    stiffness = misfit.stiffness(linear.prediction, readings)
    apart = 0 if misfit.own is None else misfit.own.degrees
    logs = np.log(list(stiffness.values()))
    spread = float(np.sqrt(np.sum(logs**2) / apart)) if apart else 0.0
    covariance = total_of(misfit.covariances_at(force))
    left = force - misfit.expected_force
    departures = free.priors.residual(best.point)
    chi_square = float(left @ np.linalg.solve(covariance, left) + departures @ departures)
    degrees = len(left) + len(departures) - len(free.parameters) - apart
    p_value = float(chi2.sf(chi_square, degrees))
    residual = search.emulated().residual
    optimum = Optimum(
        linear,
        residual,
        misfit.covariances_at(force, spread),
        quantile(apart or len(fitted) - 1),
        p_value >= LEAST_CHANCE,
        {},
        plane=False,
    )
    found = estimates(optimum)
    compared = [
        ComparedRecording(one.name, one.specimen, True, one.course, force[span])
        for one, span in zip(fitted, misfit.spans, strict=True)
    ]
    notes = []
    if predicted:
        others = tuple(dict.fromkeys(one.sizes for one in predicted))
        beside = SpecimenForward.of_tissues(others, tuple(depth_of[sizes] for sizes in others), tissues, prepared.c10)
        own = misfit_of(predicted, beside, folder, seeks, stiffness)
        outcome = beside.solve(model_values(best.values), ())
        if outcome.complete:
            seen = own.predict(outcome, readings).force
            compared += [
                ComparedRecording(one.name, one.specimen, False, one.course, seen[span])
                for one, span in zip(predicted, own.spans, strict=True)
            ]
        else:
            notes.append(f"What was left out can't be predicted: {outcome.reason}.")
    missing = away - {one.name for one in predicted}
    notes += [f"{name} was to be predicted, and can't be modelled." for name in sorted(missing)]
    values = model.with_compressibility(best.values)
    outcomes = {id(trial.outcome): trial.outcome for trial in search.trials}
    return SpecimenResult(
        law=name,
        parameters=found,
        correlations=correlations_of(optimum.spread),
        values=values,
        assumed={key: value for key, value in values.items() if key not in free.names and np.isfinite(value)},
        forward_solves=len(outcomes),
        reused_solves=sum(solver.was_reused(one.values) for one in outcomes.values()),
        wall_s=time.perf_counter() - started,
        seed=settings.seed,
        emulator_error=search.emulator_error,
        converged=search.converged,
        warnings=_warnings(folder, prepared, fitted, found, search, p_value, (why, *notes)),
        versions=versions(),
        folder=folder,
        recordings=tuple(compared),
        left_out=prepared.left_out,
        chi_square=chi_square,
        degrees_of_freedom=degrees,
        p_value=p_value,
        gain_sd=misfit.gain_sd(force),
        failed_solves=sum(not one.complete for one in outcomes.values()),
        stiffness=stiffness,
        stiffness_spread=spread,
        untold=why,
    )


def _without(name: str, asked: Asked) -> Asked:
    """Return the same with a parameter at its null, unless that is asked for."""
    if name in asked.names or name in asked.priors or name in asked.fixed:
        return asked
    return replace(asked, fixed={**asked.fixed, name: READINGS[name].null})


def _warnings(
    folder: SpecimenFolder,
    prepared: Prepared,
    fitted: Sequence[SpecimenRecording],
    found: Mapping[str, Estimate],
    search: Search[SpecimenMisfit],
    p_value: float,
    notes: Sequence[str],
) -> tuple[str, ...]:
    """Return a sentence a warning, the gravest first."""
    doubted = [
        one for one in (*prepared.doubts, *stiffness_doubts(folder, prepared.c10)) if one.field not in folder.confirmed
    ]
    texts = [f"DOUBTFUL INPUT: {doubt}" for doubt in (*folder.doubts, *doubted)]
    if not search.converged:
        texts.append("The search ended before it converged: rerun with another --seed.")
    texts += of_compromise(search.best.outcome.compromise)
    texts += [
        f"{name} stands at the {one.at_bound} bound of the search."
        for name, one in found.items()
        if one.at_bound and not (name == QUICKENING and one.at_bound == "lower")
    ]
    if p_value < LEAST_CHANCE:
        texts.append(
            "The law does not describe these recordings within their errors: the intervals hold "
            "for the law as fitted and understate what is unknown."
        )
    in_air = [one.name for one in fitted if one.course.in_air]
    if in_air:
        texts.append(
            f"{len(in_air)} recordings seem to begin in air ({', '.join(in_air)}): first contact "
            "was looked for. If displacement counts from first touch, say so in specimen.toml: "
            "[recordings] starts_at_contact = true."
        )
    failed = [trial for trial in search.trials if trial.prediction is None]
    if failed:
        texts.append(
            f"{len(failed)} of {len(search.trials)} full solves stopped short; the search kept "
            f"away from them ({failed[0].outcome.reason})."
        )
    return (*texts, *prepared.notes, *filter(None, notes))
