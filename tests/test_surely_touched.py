"""First contact lies before readings that show one: by the recording alone, by a fit of a law, and by a diagnosis."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from making_specimens import BAR, compressed

import legfem as lf
from legfem.data import Recording, write_recording
from legfem.mechanics.materials import ExponentialStiffening
from legfem.specimens.course import read_specimen
from legfem.specimens.details import compared

AIR, DEPTH = 0.5, 3.0
SOFT_FIRST = ExponentialStiffening(0.3e-3, 1.0, C20=0.0, stiffening=0.5e-3, exponent=12.0)
"""Of a tissue whose toe is a thirtieth of the force at the end: a law without stiffening fits the end by more air."""


def toe(seed: int = 0, drift: float = 0.0) -> Recording:
    """Return a bar of it, pressed after some air, by a load cell whose zero drifts (N/s)."""
    time = np.linspace(0, 35.0, 700)
    d = 0.1 * time
    force = compressed(SOFT_FIRST, np.maximum(d - AIR, 0.0))
    noise = np.random.default_rng(seed).normal(0.0, 2e-4 * force[-1], len(time))
    return Recording(time, d, force + noise + drift * time, "toe")


@pytest.mark.parametrize("seed", range(5))
def test_the_first_contact_is_before_a_force_that_is_no_noise(seed: int) -> None:
    contact = read_specimen(toe(seed)).contact
    assert AIR < contact.latest < AIR + 0.35
    assert contact.estimate <= contact.latest


def test_a_zero_that_drifts_is_no_touch() -> None:
    made = toe(drift=4e-3)
    assert made.force[90:100].mean() > 10 * 2e-4 * 8.7
    assert read_specimen(made).contact.latest > AIR


def _folder(folder: Path) -> lf.SpecimenFolder:
    (folder / "recordings").mkdir(parents=True)
    write_recording(toe(), folder / "recordings" / "toe.csv")
    (folder / "specimen.toml").write_text(BAR.replace("[recordings]\nstarts_at_contact = true\n", ""))
    return lf.load_specimen(folder)


def test_neither_a_fit_nor_a_diagnosis_moves_first_contact_beyond_that(tmp_path: Path) -> None:
    folder = _folder(tmp_path / "bar")
    latest = folder.recordings[0].detected.latest
    (fitted,) = compared(lf.identify(folder, "neo-hookean")["neo-hookean"])
    assert fitted.recording.course.contact.displacement <= latest
    found = lf.diagnose(folder, library=tmp_path / "kept").specimens[0].diagnosis
    at, (low, high) = found.first_contact(0)
    print(latest, fitted.recording.course.contact.displacement, at, low, high)
    assert at <= latest and low < AIR + 0.2
