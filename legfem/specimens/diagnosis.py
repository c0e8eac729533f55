"""What the model leaves out of a specimen's test: the diagnosis' mechanisms, brought to its sizes, and weighed."""

import math
import time
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from legfem.channels.kinds.face_strain import FACE_STRAIN
from legfem.common.errors import InputError, doubt_lines
from legfem.common.progress import Progress
from legfem.common.units import FloatArray
from legfem.data import Instrument
from legfem.data.folder import RESOURCES
from legfem.data.recording import Origin
from legfem.inverse.catalogue import DEEP_C10, RATIO
from legfem.inverse.library_build import build_library
from legfem.inverse.library_tasks import middle_of
from legfem.inverse.mechanism import factor, prior_of, strength
from legfem.inverse.observations import Observations, observe
from legfem.inverse.parameter import Parameter, Prior
from legfem.inverse.responses import PLAIN, SolvedResponses
from legfem.inverse.verdict import Diagnosis
from legfem.jobs.store import code_fingerprint
from legfem.legs.diagnosis import STIFFENING, diagnose_body, shown_mechanisms
from legfem.legs.mechanisms import Mechanism, TissueMechanism, Values, mechanisms
from legfem.legs.mechanisms.rig import ContactSlip, SupportCompliance
from legfem.legs.nuisances import Accuracy
from legfem.specimens.agreement import TestsAgreement, agreement_of_tests
from legfem.specimens.artefacts import SizeDependence, size_dependence
from legfem.specimens.folder import FILE, SpecimenFolder, stiffness_doubts, tissue_asked_for
from legfem.specimens.forward import SpecimenVariants
from legfem.specimens.sizes import LeftOut, Sizes, SpecimenRecording, bare, fibres_text, kind_in, layers_of, slipping


@dataclass(frozen=True)
class RigCompliance(Mechanism):
    r"""Springs in series: :math:`d_{tissue} = d - c F`; a specimen has no bones."""

    name: ClassVar[str] = SupportCompliance.name
    statement: ClassVar[str] = "the rig or the base gave way with the force"
    parameters: ClassVar[tuple[Parameter, ...]] = SupportCompliance.parameters[:1]
    next_experiment: ClassVar[str] = "press a rigid block on the same rig, and subtract what that yields"

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return what the rig takes up."""
        return values["compliance"] * force


@dataclass(frozen=True)
class GripSlip(Mechanism):
    r"""From a displacement on a share of the travel is lost: :math:`d_{tissue} = d - s \max(\hat d - d_0, 0)`.

    With :math:`\hat d` the farthest so far: what slipped doesn't come back.
    """

    name: ClassVar[str] = "grip-slip"
    statement: ClassVar[str] = "the grips slipped: a part of the travel did not reach the specimen"
    parameters: ClassVar[tuple[Parameter, ...]] = (
        strength("share", "-", "share of the travel that is lost", 0.15, (0.0, 0.9)),
        Parameter(
            "onset",
            "-",
            (0.0, 0.95),
            Prior(0.3, 0.3, "linear", "any time"),
            statement="from which displacement on, over the greatest",
        ),
    )
    next_experiment: ClassVar[str] = "mark the specimen at the grips and film it, hold it in sandpaper, and repeat"

    def untestable(self, observed: Observations) -> str | None:
        """Return whether nothing but the force was recorded."""
        if any(one.name == FACE_STRAIN.name for one in observed.channels):
            return None
        return "grips that slip look like a softer tissue by the force alone: track points on the face"

    def starts(self, observed: Observations) -> tuple[Values, ...]:
        """Return slips that begin early and late."""
        return tuple({"share": 0.1, "onset": onset} for onset in (0.05, 0.3, 0.6))

    def displacement_loss(self, values: Values, observed: Observations, force: FloatArray) -> FloatArray:
        """Return what has slipped."""
        lost = np.zeros(len(force))
        for mine in (observed.trial == k for k in range(len(observed.trials))):
            farthest = np.maximum.accumulate(observed.displacement[mine])
            lost[mine] = values["share"] * np.maximum(farthest - values["onset"] * observed.depth, 0.0)
        return lost


def mechanisms_on_a_rig() -> tuple[Mechanism, ...]:
    """Return all mechanisms for a body that gives way with its rig or its grips, not with two bones."""
    return (*(RigCompliance() if m.name == RigCompliance.name else m for m in mechanisms()), GripSlip())


_LEG_MM, _LEG_N, _LEG_S, _LEG_C10 = 20.0, 20.0, 100.0, 1e-3
_TEXTS = tomllib.loads((RESOURCES / "specimens" / "mechanisms.toml").read_text(encoding="utf-8"))
_TOLD: Mapping[str, Mapping[str, str]] = _TEXTS["told"]
"""What a specimen's diagnosis says of mechanisms in place of what it says of a leg."""
_NONE: Mapping[str, str] = _TEXTS["none"]
_OF_LAYERS: Mapping[str, str] = _TEXTS["none_of_layers"]
"""Why specimens, and those of layers, don't have a mechanism; empty where they do."""
_WITHOUT_TIME = ("viscoelasticity", "force-drift", "leg-movement", "preconditioning")
_LEAST_BULK = 5.0
"""Bulk over shear modulus down to which compressibility is tabulated: Poisson's ratio 0.41."""
_LEAST_FACTOR = 3.0
_RIG = 0.2
"""Usual drift of a bench's load cell over that of a leg's, as a share of the greatest force."""


@dataclass(frozen=True)
class Scale:
    """What a specimen's test is like.

    Parameters
    ----------
    depth
        mm.
    force
        Greatest, N.
    duration
        s.
    c10
        Roughly, MPa.
    bulk
        Modulus over the shear modulus, as given.
    """

    depth: float
    force: float
    duration: float
    c10: float
    bulk: float

    @property
    def over_a_leg(self) -> dict[str, float]:
        """Usual strengths over those of a leg, by mechanism."""
        depth, force = self.depth / _LEG_MM, self.force / _LEG_N
        return {
            "strain-stiffening": self.c10 / _LEG_C10,
            RigCompliance.name: depth / force,
            "contact-onset": depth,
            "leg-movement": depth,
            "force-drift": _RIG * force * _LEG_S / self.duration,
        }


def mechanisms_of(sizes: Sizes, scale: Scale, timed: bool = True) -> tuple[list[Mechanism], dict[str, str]]:
    """Return the mechanisms that a specimen may have, and why it can't have the others.

    Parameters
    ----------
    sizes
        Of the test.
    scale
        Of the recordings.
    timed
        Whether they have a time, which tables of stretch and stress haven't.
    """
    able: list[Mechanism] = []
    unable: dict[str, str] = {}
    kind = kind_in(sizes)
    for mechanism in mechanisms_on_a_rig():
        why = _NONE.get(mechanism.name, "")
        if layers_of(sizes) is not None:
            why = _OF_LAYERS.get(mechanism.name, why)
        if mechanism.name == ContactSlip.name and slipping(sizes) is None:
            why = kind.no_slip
        if mechanism.name == GripSlip.name and (kind.presses(bare(sizes)) or kind.face(bare(sizes)) is None):
            why = "nothing pulls the specimen by grips"
        if isinstance(mechanism, TissueMechanism) and mechanism.name not in (*_TOLD, *_NONE):
            why = "it doesn't say what it does to a specimen"
        if not timed and mechanism.name in _WITHOUT_TIME:
            why = "a table of stretch and stress has no time"
        if why:
            unable[mechanism.name] = why
        else:
            able.append(_of_specimen(mechanism, scale))
    return able, unable


def _of_specimen(mechanism: Mechanism, scale: Scale) -> Mechanism:
    told = _TOLD.get(mechanism.name, {})
    first, *rest = mechanism.parameters
    strengths = mechanism.strengths if isinstance(mechanism, TissueMechanism) else None
    if mechanism.name == "compressibility":
        most = max(_LEAST_FACTOR, scale.bulk / _LEAST_BULK)
        first = factor(
            "factor",
            "D1 over the assumed one",
            (0.1, 1.5 * most),
            max(1.3, 0.5 * math.log(most)),
            "gels hardly lose volume, foams and drained tissues lose much",
        )
        strengths = (most ** (1 / 3), most ** (2 / 3), most)
    over = scale.over_a_leg.get(mechanism.name, 1.0)
    return mechanism.restated(
        told.get("statement", mechanism.statement),
        told.get("next_experiment", mechanism.next_experiment),
        (_times(first, over), *rest),
        None if strengths is None else tuple(over * value for value in strengths),
    )


def _times(parameter: Parameter, over: float) -> Parameter:
    if over == 1.0:
        return parameter
    prior, (low, high) = prior_of(parameter), parameter.bounds
    return replace(parameter, bounds=(over * low, over * high), prior=replace(prior, sd=over * prior.sd))


_POINTS = 60
_BEYOND = 1.04
"""Of the greatest depth, to which responses are solved."""
_STIFFENINGS = (0.0, 0.03, 0.1, 0.3, 0.8, 1.6)
"""ln(1 + C20 / C10) of the elastic curves: a bench's repeats tell a little stiffening from none."""
_REACH = 3.5
"""Of ln C10: the force is in proportion to it, and what relaxes fast hides how little lasts."""
_DRAWN = Accuracy(size_sd=1e-3)
"""Of a specimen that was simulated."""


@dataclass(frozen=True, eq=False)
class DiagnosedSpecimen:
    """One specimen's diagnosis, a `legfem.report.diagnosis_document.Recorded`."""

    id: str
    title: str
    origin: Origin
    diagnosis: Diagnosis | None
    """None where there is none; the problem says why."""
    left_out: tuple[LeftOut, ...]
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
        known = [(one.id, one.diagnosis.base, one.extent) for one in found if one.diagnosis and one.test == test]
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
        (one.test, one.diagnosis.estimates if after else one.diagnosis.estimates_of(one.diagnosis.base, False))
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


def diagnose_specimens(
    folder: SpecimenFolder, names: Sequence[str], responses: Path | None, jobs: int, progress: Progress, seed: int = 0
) -> Iterator[DiagnosedSpecimen]:
    """Yield the diagnoses of a folder's specimens, each as it is made.

    A specimen whose recordings can't be used, or whose test can't be solved, costs itself alone.

    Parameters
    ----------
    folder : SpecimenFolder
        With recordings.
    names : sequence of str
        Of specimens; all without any.
    responses : Path, optional
        Folder in which solutions are kept.
    jobs : int
        Processes.
    progress : Progress
        Told of every solution.
    seed : int
        Of the draws that windows are judged by.

    Raises
    ------
    InputError
        If there is no specimen of a name.
    """
    every = folder.specimens
    for name in names:
        if name not in every:
            raise InputError("--specimen", name, "is not a specimen of the folder", f"give one of {', '.join(every)}")
    for name in names or every:
        started = time.perf_counter()
        title = folder.title if len(every) == 1 else f"{folder.title}: {name}"
        own = folder.test_of(every[name][0])
        found = DiagnosedSpecimen(name, title, folder.origin, None, (), test=every[name][0].test)
        try:
            diagnosis, left = _diagnosed(own, every[name], responses, jobs, progress, seed)
        except InputError as error:
            yield replace(found, problem=error)
        else:
            sizes = every[name][0].sizes
            yield replace(
                found,
                diagnosis=diagnosis,
                left_out=left,
                seconds=time.perf_counter() - started,
                extent=kind_in(sizes).extent(bare(sizes)),
            )


def _diagnosed(
    folder: SpecimenFolder,
    recordings: Sequence[SpecimenRecording],
    responses: Path | None,
    jobs: int,
    progress: Progress,
    seed: int,
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
        raise InputError(folder.directory, left[0].name, f"no recording can be used: {left[0].reason}", "correct them")
    observed, sizes = _observed(folder, used), used[0].sizes
    solved = solved_responses(folder, sizes, observed, responses)
    progress.stage(f"how stiff {used[0].specimen} is, roughly")
    stiffening = STIFFENING[folder.base_law]
    if np.isnan(solved.curve(_LEG_C10, 0.0)).any():
        raise InputError(
            folder.directory,
            used[0].specimen,
            f"its test can't be solved to {solved.depth:.3g} mm",
            "check the sizes, or record less deep",
        )
    middle = middle_of(observed, solved, stiffening)
    last = max(float(s.protocol.time[-1]) for s in observed.protocols)
    scale = Scale(observed.depth, float(observed.force.max()), last, middle, asked.bulk_ratio)
    every, unable = mechanisms_of(sizes, scale, used[0].recording.timed)
    able, _ = shown_mechanisms(observed, None, every=every)
    library = build_library(solved, solved, observed, able, jobs, progress, stiffening, middle, _STIFFENINGS, False)
    library = replace(library, missing={**unable, **library.missing}, reach=_REACH)
    observed, stiff = observed.with_channels(library.beside.names), stiffness_doubts(folder, middle)
    doubts = (*folder.doubts, *(one for one in stiff if one.field not in folder.confirmed))
    observed = replace(observed, remarks=(*doubt_lines(doubts), *observed.remarks))
    accuracy = Accuracy() if folder.origin == "measured" else _DRAWN
    diagnosis = diagnose_body(
        observed,
        _instrument(folder, used),
        folder.base_law,
        library,
        solved,
        progress,
        accuracy,
        seed=seed,
        every=every,
    )
    return diagnosis, tuple(left)


def _observed(folder: SpecimenFolder, used: Sequence[SpecimenRecording]) -> Observations:
    observed = observe([one.trial for one in used])
    remarks = list(observed.remarks)
    if folder.instrument is None:
        remarks.append(
            "specimen.toml states no instrument accuracy: the errors are those from sample to "
            "sample and between repeats. What drifts slowly, or is the same in all trials, cannot be "
            "distinguished from physics. State the data sheet's figures under [instrument]."
        )
    if not used[0].recording.timed:
        remarks.append(
            "The recordings are tables of stretch and stress: forces and displacements are those of a body of the "
            "stated size, or of a cube of 10 mm, and nothing is known of time."
        )
    if note := kind_in(used[0].sizes).note:
        remarks.append(note)
    if folder.alternatives:
        first = folder.alternatives[0]
        remarks.append(
            f"The folder leaves open how the test was done: {first} is assumed, and slip at the faces is weighed."
        )
    if len(folder.tissues) > 1:
        still = (
            ", and they are taken not to relax: if they do, the error goes into C10" if used[0].recording.timed else ""
        )
        remarks.append(
            f"C10 is that of the layer {tissue_asked_for(folder).name}, whose stiffness "
            f"specimen.toml leaves open; the others' is as stated there{still}."
        )
    if observed.repeats < 2:
        remarks.append("No protocol was repeated, so the errors between trials are the instruments' figures alone.")
    return replace(observed, remarks=tuple(remarks))


def _check_fibres(folder: SpecimenFolder, recordings: Sequence[SpecimenRecording]) -> None:
    if len({fibres_text(one.sizes) for one in recordings}) > 1:
        raise InputError(
            folder.directory / FILE,
            f"specimen {recordings[0].specimen}",
            "was tested in several directions of its fibres",
            "give each a name of its own, for a diagnosis",
        )
    if any(one.fibrous and RATIO not in one.stated for one in folder.tissues):
        raise InputError(
            folder.directory / FILE,
            "fibres.ratio",
            "is open",
            "state it, such as legfem.identify found, for a diagnosis",
        )


def _instrument(folder: SpecimenFolder, used: Sequence[SpecimenRecording]) -> Instrument:
    if folder.instrument is not None:
        return folder.instrument
    force = [one.course.instrument.force_sd for one in used]
    displacement = [one.course.instrument.displacement_sd for one in used]
    return Instrument(
        float(np.sqrt(np.mean(np.square(force)))), float(np.sqrt(np.mean(np.square(displacement)))), stated=False
    )


def solved_responses(
    folder: SpecimenFolder, sizes: Sizes, observed: Observations, responses: Path | None
) -> SolvedResponses:
    """Return a specimen's responses by full solutions, a little deeper than was recorded."""
    depth = float(f"{_BEYOND * observed.depth:.3g}")
    variants = SpecimenVariants(sizes, depth, folder.tissues)
    return SolvedResponses(
        variants,
        depth,
        responses,
        {
            "model": "specimen with mechanisms",
            "given": variants.described(PLAIN.variant),
            "code": code_fingerprint("legfem.specimens.forward", type(kind_in(sizes)).__module__),
        },
        step=depth / _POINTS,
    )
