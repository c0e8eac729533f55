"""A specimen's diagnosis: its recordings and library, what is weighed, and what several specimens say together.

First every test is solved once (`prepare`): what can't be modelled is left out or shortened.
"""

import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from itertools import product
from pathlib import Path

import numpy as np

from legfem.common.errors import Argument, Doubt, InputError
from legfem.common.progress import Progress
from legfem.common.units import mpa_to_kpa
from legfem.data import Instrument
from legfem.inverse.accuracy import SIZE_LOG_SD, Accuracy
from legfem.inverse.answer import FitNotice, Notice, doubted
from legfem.inverse.catalogue import DEEP_C10, RATIO, LawName
from legfem.inverse.diagnose import DiagnosisInput, diagnose
from legfem.inverse.fit import Identity
from legfem.inverse.library import Detail
from legfem.inverse.library_build import build_library
from legfem.inverse.library_tasks import LOGS, STIFFENING, middle_of, nearest_stiffening
from legfem.inverse.mechanism import shown_mechanisms
from legfem.inverse.observations import Observations, observe
from legfem.inverse.outcome import Outcome, solve_test
from legfem.inverse.responses import PLAIN, SolvedResponses
from legfem.inverse.verdict import Diagnosis, probable_laws
from legfem.jobs.pool import Workers
from legfem.jobs.store import Store, code_fingerprint, finish
from legfem.specimens.details import SpecimenNotice, cut_short
from legfem.specimens.folder import FILE, SpecimenFolder, doubts_of, tissue_asked_for
from legfem.specimens.forward import SpecimenForward
from legfem.specimens.laws import REFERENCE_MPA, begin_at
from legfem.specimens.mechanisms import Scale, mechanisms_of
from legfem.specimens.model_discrepancy import TestsAgreement, agreement_of_tests
from legfem.specimens.nuisances import deepest_of
from legfem.specimens.sizes import LeftOut, Sizes, SpecimenRecording, differing_doubts
from legfem.specimens.thickness import SizeDependence, begun_share, size_dependence
from legfem.specimens.variants import SpecimenVariants

_ABOVE = 1.02
# Of the depth that was reached: short of where a solution stopped.
_SHORT_OF = 0.97
_LEAST_SHARE = 0.3


@dataclass(frozen=True, eq=False)
class Prepared:
    """Recordings that can be modelled, how deep their tests are solved, and how stiff they seem."""

    recordings: tuple[SpecimenRecording, ...]
    left_out: tuple[LeftOut, ...]
    notices: tuple[Notice, ...]
    depths: Mapping[Sizes, float]
    """mm that each test is solved to."""
    c10: float
    """MPa: the middle of what each recording asks for by itself, neo-Hookean."""
    doubts: tuple[Doubt, ...]
    """About recordings beside others."""


def prepare(
    folder: SpecimenFolder, held: set[SpecimenRecording], out: Path | None, jobs: int, progress: Progress
) -> Prepared:
    """Solve every test once, and leave out or shorten what can't be modelled.

    Raises
    ------
    InputError
        If nothing that is to be fitted is left.
    """
    deepest: dict[Sizes, float] = {}
    for one in folder.recordings:
        deepest[one.sizes] = max(deepest.get(one.sizes, 0.0), _ABOVE * deepest_of(one.course))
    usual = begin_at(folder.tissues, REFERENCE_MPA)
    tissues = tuple(one.of_law("neo-hookean") for one in folder.tissues)
    models = [SpecimenForward(sizes, depth, tissues, usual) for sizes, depth in deepest.items()]
    outcomes = _solved_once(models, out, jobs, progress)
    used, left, notices = list[SpecimenRecording](), list(folder.left_out), [*cut_short(folder.recordings)]
    within = dict[Sizes, float]()
    for one in folder.recordings:
        outcome = outcomes[one.sizes]
        reached = outcome.curve.depth * (1.0 if outcome.complete else _SHORT_OF)
        within[one.sizes] = reached
        if one.course.depth <= reached:
            used.append(one)
        elif reached < _LEAST_SHARE * one.course.depth:
            reason = f"its test can't be solved beyond {reached:.3g} mm: {outcome.reason}"
            left.append(LeftOut(one.name, reason))
        else:
            used.append(one.to(reached))
            told = {"name": one.name, "used": reached, "depth": one.course.depth, "reason": outcome.reason}
            notices.append(Notice.of(SpecimenNotice.USED_IN_PART, **told))
    fitted = [one for one in used if one.name not in {other.name for other in held}]
    if not fitted:
        problem = f"none can be modelled: {left[0].reason}"
        raise InputError(folder.directory, "recordings", problem, "check the sizes, or record less deep")
    depths = dict[Sizes, float]()
    for one in used:
        needed = min(deepest_of(one.course), within[one.sizes])
        depths[one.sizes] = max(depths.get(one.sizes, 0.0), needed, one.course.depth)
    stiffness = dict[SpecimenRecording, float]()
    for one in fitted:
        course = one.course
        unit = outcomes[one.sizes].curve(course.displacement)
        stiffness[one] = usual * float(course.force @ unit / (unit @ unit))
    return Prepared(
        tuple(used),
        tuple(left),
        tuple(notices),
        depths,
        max(float(np.median(list(stiffness.values()))), 1e-9),
        tuple(differing_doubts(stiffness)),
    )


def _solved_once(
    models: Sequence[SpecimenForward], out: Path | None, jobs: int, progress: Progress
) -> dict[Sizes, Outcome]:
    store = None if out is None else Store(out / "solves", Outcome)
    with Workers(solve_test, models, jobs) as workers:
        found = finish(
            workers,
            [(k, one.nominal, ()) for k, one in enumerate(models)],
            store,
            progress,
            "solving every test once; on a machine's first run, compiling",
            lambda task, outcome: f"{type(models[task[0]].sizes).__name__} to {outcome.curve.depth:.3g} mm",
            lambda task: ("once", models[task[0]].fingerprint()),
        )
    return dict(zip((one.sizes for one in models), found, strict=True))


_POINTS = 60
_SOME_C10 = 1e-3
"""MPa: whether a test can be solved doesn't depend on it."""
_BEYOND = 1.04
"""Depth to which responses are solved, over the greatest recorded."""
_STIFFENINGS = (0.03, 0.1, 0.3, 0.8, 1.6)
_LATTICE = tuple(product(LOGS, (0.0, *_STIFFENINGS)))
"""ln C10 over the middle's and ln(1 + C20 / C10) of the elastic curves: a bench's repeats tell a little stiffening from
none."""
_REACH = 3.5
"""Reach of the library in ln C10: what relaxes fast hides how little lasts."""
_OTHERWISE = 1.1
"""Factor by which an end of C10's interval differs where laws do."""


@dataclass(frozen=True, eq=False)
class DiagnosedSpecimen:
    """One specimen's diagnosis."""

    id: str
    diagnosis: Diagnosis | None
    """None where there is none; the problem says why."""
    left_out: tuple[LeftOut, ...] = ()
    """Its recordings that can't be used."""
    problem: InputError | None = None
    seconds: float = 0.0
    extent: float | None = None
    """Size in the direction of the displacement (mm), of a kind that has one."""
    test: str = ""
    """Its test's name, where the folder has several."""


def thickness_finding(found: Sequence[DiagnosedSpecimen]) -> SizeDependence | None:
    """Return how the specimens' own C10 goes with their thickness; None where it doesn't, or isn't known."""
    for test in dict.fromkeys(one.test for one in found):
        known = [(one.id, one.diagnosis.base_model, one.extent) for one in found if one.diagnosis and one.test == test]
        extent = {name: size for name, base, size in known if size is not None and DEEP_C10 in base.fit.free}
        seen = size_dependence({name: base.value(DEEP_C10) for name, base, _ in known if name in extent}, extent)
        if seen is not None:
            return seen
    return None


def tests_finding(found: Sequence[DiagnosedSpecimen], after: bool = False) -> TestsAgreement | None:
    """Return how several tests agree on C10, before or after what was found to be left out; None where none is known.

    Specimens err by their intervals, or by as much as those of one test differ.
    """
    each = [
        (one.test, one.diagnosis.estimates if after else one.diagnosis.base.estimates)
        for one in found
        if one.diagnosis is not None
    ]
    known = [(test, parameters[DEEP_C10]) for test, parameters in each if DEEP_C10 in parameters]
    names = np.array([test for test, _ in known])
    tests = {name: np.flatnonzero(names == name) for name in dict.fromkeys(names.tolist())}
    if len(tests) < 2:
        return None
    c10 = np.array([one.value for _, one in known])
    c10 = c10 / np.exp(np.mean(np.log(c10)))
    errors = c10 * [np.log(one.ci95[1] / one.ci95[0]) / 3.92 for _, one in known]
    left = np.concatenate([c10[places] - c10[places].mean() for places in tests.values()])
    spread = float(np.sqrt(left @ left / max(len(left) - len(tests), 1)))
    alike = np.ones((len(c10), 1))
    covariance = np.diag(np.maximum(errors, spread) ** 2)
    return agreement_of_tests(c10 - 1, alike[:, 0], alike, alike, covariance, tests)


def said_together(found: Sequence[DiagnosedSpecimen]) -> tuple[Notice, ...]:
    """Return what specimens say together that no diagnosis of one of them can."""
    thickness, tests = thickness_finding(found), tests_finding(found)
    told = [Notice.of(SpecimenNotice.GOES_WITH_THICKNESS, text=thickness.text)] if thickness else []
    return (*told, *([Notice.of(SpecimenNotice.TESTS_DISAGREE, text=tests.text)] if tests and tests.disagree else []))


@dataclass(frozen=True)
class SpecimenDiagnoser:
    """Diagnoses specimens.

    Parameters
    ----------
    responses : Path, optional
        Folder in which solutions are kept.
    jobs : int
        Processes.
    progress : Progress
        Told of every solution.
    seed : int
        Of the draws that windows are judged by.
    """

    responses: Path | None
    jobs: int
    progress: Progress
    seed: int = 0

    def diagnosed(self, folder: SpecimenFolder, names: Sequence[str] = ()) -> Iterator[DiagnosedSpecimen]:
        """Yield the diagnoses of a folder's specimens, of all without names, each as it is made.

        A specimen whose recordings can't be used, or whose test can't be solved, costs itself alone.

        Raises
        ------
        InputError
            If there is no specimen of a name.
        """
        every = folder.specimens
        for name in names:
            if name not in every:
                remedy = f"give one of {', '.join(every)}"
                raise InputError(Argument("specimen"), name, "is not a specimen of the folder", remedy)
        for name in names or every:
            started = time.perf_counter()
            title = folder.title if len(every) == 1 else f"{folder.title}: {name}"
            whose = Identity(name, title, folder.origin, folder.directory)
            first = every[name][0]
            try:
                found, left = self._diagnosed(folder.test_of(first), whose, every[name])
            except InputError as error:
                yield DiagnosedSpecimen(name, None, problem=error, test=first.test)
            else:
                seconds, extent = time.perf_counter() - started, first.sizes.kind.extent(first.sizes.body)
                yield DiagnosedSpecimen(name, found, left, seconds=seconds, extent=extent, test=first.test)

    def _diagnosed(
        self, folder: SpecimenFolder, whose: Identity, recordings: Sequence[SpecimenRecording]
    ) -> tuple[Diagnosis, tuple[LeftOut, ...]]:
        asked = tissue_asked_for(folder)
        _check_fibres(folder, recordings)
        used, left = list[SpecimenRecording](), list[LeftOut]()
        for one in recordings:
            try:
                _observed(folder, [one])
            except InputError as error:
                left.append(LeftOut(one.name, str(error)))
            else:
                used.append(one)
        if not used:
            problem = f"no recording can be used: {left[0].reason}"
            raise InputError(folder.directory, left[0].name, problem, "correct them")
        observed, sizes = _observed(folder, used), used[0].sizes
        solved = solved_responses(folder, sizes, observed, self.responses)
        self.progress.stage(f"how stiff {used[0].specimen} is, roughly")
        if np.isnan(solved.curve(_SOME_C10, 0.0)).any():
            problem = f"its test can't be solved to {solved.depth:.3g} mm"
            raise InputError(folder.directory, used[0].specimen, problem, "check the sizes, or record less deep")
        last = max(float(s.protocol.time[-1]) for s in observed.protocols)
        begun = float(np.mean([begun_share(folder, one) * one.course.depth for one in used]))
        size_sd = folder.sizes_sd if used[0].recording.timed else SIZE_LOG_SD
        accuracy = Accuracy(size_sd=size_sd, contact_sd=begun, tared=True)
        shown = [(one.course.instrument.force_sd, one.course.instrument.displacement_sd) for one in used]
        force_sd, displacement_sd = map(float, np.sqrt(np.mean(np.square(shown), axis=0)))
        instrument = folder.instrument or Instrument(force_sd, displacement_sd, stated=False)

        def by_law(law: LawName) -> Diagnosis:
            among = (0.0,) if law == "neo-hookean" else _STIFFENINGS
            stiffening = nearest_stiffening(observed, solved, middle_of(observed, solved, 0.0), among)
            middle = middle_of(observed, solved, stiffening)
            scale = Scale(observed.depth, float(observed.force.max()), last, middle, asked.bulk_ratio)
            every, unable = mechanisms_of(sizes, scale, used[0].recording.timed)
            able, _ = shown_mechanisms(every, observed, {})
            detail = Detail.of_all(able, pairs=False)
            tables = build_library(
                solved, observed, able, self.jobs, self.progress, middle, stiffening, detail, _LATTICE
            )
            library = replace(tables, missing={**unable, **tables.missing}, reach=_REACH)
            seen = observed.with_channels(library.beside.names)
            seen = replace(seen, notices=(*doubted(doubts_of(folder, middle)), *seen.notices))
            given = DiagnosisInput(seen, instrument, law, library, every, whose, "specimens", accuracy=accuracy)
            return diagnose(given, solved, self.progress, self.seed)

        found = by_law(folder.base_law)
        if found.verdict != "consistent":
            # What one law leaves out another may have: where nothing is missing, stiffening is among what may hide.
            found = found.over_laws([by_law(law) for law in STIFFENING if law != folder.base_law])
            found = found.told(tuple(laws_told(found)))
        return found, tuple(left)


def laws_told(found: Diagnosis) -> Iterator[Notice]:
    """Yield what laws make of C10, where they differ."""
    given = [(one, chance, one.own_intervals.get(DEEP_C10, ())) for one, chance in probable_laws(found)]
    if any(max(ends) / min(ends) > _OTHERWISE for ends in zip(*(own for *_, own in given), strict=False)):
        each = [(one.law.replace("-", " "), *map(mpa_to_kpa, own), chance) for one, chance, own in given]
        yield Notice.of(SpecimenNotice.LAW_DECIDES, each=each)


def _observed(folder: SpecimenFolder, used: Sequence[SpecimenRecording]) -> Observations:
    observed = observe([one.trial for one in used])
    told, timed = [*observed.notices, *cut_short(used)], used[0].recording.timed
    if folder.instrument is None:
        told.append(Notice.of(FitNotice.NO_ACCURACY_STATED, file=FILE))
    if not timed:
        told.append(Notice.of(SpecimenNotice.UNTIMED))
    if note := used[0].sizes.kind.note:
        told.append(Notice.of(SpecimenNotice.KIND, text=note))
    if folder.alternatives:
        told.append(Notice.of(SpecimenNotice.ALTERNATIVE_ASSUMED, first=folder.alternatives[0]))
    if len(folder.tissues) > 1:
        told.append(Notice.of(SpecimenNotice.LAYER_ASKED, layer=tissue_asked_for(folder).name, timed=timed))
    if observed.repeats < 2:
        told.append(Notice.of(FitNotice.NOT_REPEATED))
    return replace(observed, notices=tuple(told))


def _check_fibres(folder: SpecimenFolder, recordings: Sequence[SpecimenRecording]) -> None:
    refused = partial(InputError, folder.directory / FILE)
    if len({one.sizes.fibres_text for one in recordings}) > 1:
        remedy = "give each a name of its own, for a diagnosis"
        raise refused(f"specimen {recordings[0].specimen}", "was tested in several directions of its fibres", remedy)
    if any(one.fibrous and RATIO not in one.stated for one in folder.tissues):
        raise refused("fibres.ratio", "is open", "state it, such as legfem.identify found, for a diagnosis")


def solved_responses(
    folder: SpecimenFolder, sizes: Sizes, observed: Observations, responses: Path | None
) -> SolvedResponses:
    """Return a specimen's responses by full solutions, a little deeper than was recorded."""
    depth = float(f"{_BEYOND * observed.depth:.3g}")
    variants = SpecimenVariants(sizes, depth, folder.tissues)
    code = code_fingerprint("legfem.specimens.forward", type(sizes.kind).__module__)
    depends_on = {"model": "specimen with mechanisms", "given": variants.described(PLAIN.variant), "code": code}
    return SolvedResponses(variants, depth, responses, depends_on, step=depth / _POINTS)
