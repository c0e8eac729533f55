"""The paper's four subjects, reconstructed: plausible calves, simulated and recorded with noise.

The paper publishes neither contours nor recordings. The tests are simulated with Table 5's
parameters on another discretisation than identification uses: a mesh twice as fine, the exponential
contact law, smaller steps.
"""

from __future__ import annotations

import tomllib
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import BaseModel, ConfigDict, ValidationError

from legfem.contact_settings import ContactSettings
from legfem.errors import InputError
from legfem.experiments.plane_strain import PlaneStrainSettings, Tissues
from legfem.geometry.calf import Calf, calf_section
from legfem.geometry.subject_folder import check_new_folder, write_subject_folder
from legfem.materials import NeoHookean, ReducedPolynomial
from legfem.meshing.section import SectionMeshSettings
from legfem.progress import Progress
from legfem.recording import Instrument
from legfem.recording.synthesis import InstrumentNoise, record_path
from legfem.shipped import STUDIES
from legfem.stepping import StepSettings
from legfem.study.sweep import Run, RunOutcome, simulate, sweep
from legfem.subject import Indenter
from legfem.units import kpa_to_mpa

DEFINITION = STUDIES / "frauziols" / "reconstruction.toml"
PAPER_D = 28.0
FAT_D = 22.5

GENERATOR_SETTINGS = PlaneStrainSettings(
    mesh=SectionMeshSettings(0.6, 0.11, 3.5, 1.5),
    contact=ContactSettings(normal="exponential", stiffness=4000.0, onset=0.01),
    steps=StepSettings(first=0.1, largest=0.6),
    quadrature_degree=5,
)


class _Entry(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True)


class ReconstructedSubject(_Entry):
    """One subject of the definition file."""

    C10_kPa: float
    C20_kPa: float
    depth_mm: float
    aim_mm: tuple[float, float]
    direction_deg: float
    calf: dict[str, float]


class Reconstruction(_Entry):
    """The definition file; tissues and instruments are the paper's."""

    seed: int
    rate_mm_per_s: float
    sampling_hz: float
    trials: int
    force_sd_N: float
    displacement_sd_mm: float
    diameter_mm: float
    length_mm: float
    superficial_C10_kPa: float
    fascia_C10_kPa: float
    subjects: dict[str, ReconstructedSubject]


def read_definition(path: Path = DEFINITION) -> Reconstruction:
    """Read the definition of the reconstruction.

    Raises
    ------
    InputError
        If the file is missing or a key is wrong.
    """
    if not path.is_file():
        raise InputError(path, "file", "not found", "give the path of a reconstruction.toml")
    try:
        with path.open("rb") as file:
            return Reconstruction(**tomllib.load(file))
    except tomllib.TOMLDecodeError as error:
        raise InputError(path, "TOML", str(error), "mend the line named") from None
    except ValidationError as error:
        first: Any = error.errors()[0]
        key = ".".join(str(part) for part in first["loc"])
        raise InputError(path, key, first["msg"], "compare with the shipped file") from None


def run_of(definition: Reconstruction, name: str) -> Run:
    """Return the simulation of one subject's test, with the true parameters and unloading."""
    subject = definition.subjects[name]
    deep = ReducedPolynomial(
        kpa_to_mpa(subject.C10_kPa), PAPER_D, kpa_to_mpa(subject.C20_kPa), PAPER_D
    )
    return Run(
        name,
        calf_section(Calf(**subject.calf)),  # type: ignore[arg-type]
        Indenter(
            definition.diameter_mm / 2,
            definition.length_mm,
            np.array(subject.aim_mm),
            subject.direction_deg,
        ),
        Tissues(
            deep,
            NeoHookean(kpa_to_mpa(definition.superficial_C10_kPa), FAT_D),
            NeoHookean(kpa_to_mpa(definition.fascia_C10_kPa), FAT_D),
        ),
        subject.depth_mm,
        GENERATOR_SETTINGS,
        turns=[0.0],
    )


def reconstruct(out: Path, definition: Reconstruction, progress: Progress, jobs: int = 1) -> Path:
    """Make one subject folder a subject under ``out``.

    Raises
    ------
    InputError
        If a folder exists already.
    RuntimeError
        If a simulation stops short.
    """
    runs = [run_of(definition, name) for name in sorted(definition.subjects)]
    for run in runs:
        check_new_folder(out / run.label)
    progress.stage("simulating loading and unloading on the fine mesh", len(runs))
    for outcome in sweep(runs, simulate, jobs):
        if not outcome.indentation.report.complete:
            raise RuntimeError(f"subject {outcome.run.label}: {outcome.indentation.report}")
        _write(out / outcome.run.label, definition, outcome)
        progress.advance(f"subject {outcome.run.label}: {outcome.indentation.report}")
    return out


def _write(out: Path, definition: Reconstruction, outcome: RunOutcome) -> None:
    run = outcome.run
    noise = InstrumentNoise(Instrument(definition.force_sd_N, definition.displacement_sd_mm))
    generator = np.random.default_rng([definition.seed, int(run.label)])
    recordings = [
        record_path(
            outcome.indentation.path.displacement,
            outcome.indentation.path.force,
            definition.rate_mm_per_s,
            definition.sampling_hz,
            noise,
            generator,
            f"trial{trial}",
        )
        for trial in range(1, definition.trials + 1)
    ]
    write_subject_folder(
        run.section,
        out,
        f"Subject {run.label} of Frauziols et al., reconstructed (not measured)",
        run.indenter.aim,
        run.indenter.direction_deg,
        origin="reconstructed",
        recordings=recordings,
        starts_at_contact=True,
    )
