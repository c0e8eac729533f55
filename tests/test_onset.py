"""First contact's interval holds the truth, for presses that the detector's own shapes don't describe."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from making import CROSSCHECK, press

from legfem.data import Instrument, Scales, among_repeats, segment
from legfem.data.contact import LEG, Contact
from studies.making.recording import Course, LabErrors, record

type Curve = Callable[[np.ndarray], np.ndarray]
"""Force (N) over the displacement after contact (mm)."""


def _febio(name: str) -> Curve:
    table = pd.read_csv(CROSSCHECK / name / "clean.csv")
    return lambda d: np.interp(d, table["displacement_mm"], table["force_N"])


def _ball(d: np.ndarray) -> np.ndarray:
    """On a layer of 8 mm: Dimitriadis et al. 2002, Biophys. J. 82, Eq. 11, a ball of radius 4 mm."""
    chi = np.sqrt(4.0 * d) / 8.0
    layer = 1 + 1.133 * chi + 1.283 * chi**2 + 0.769 * chi**3 + 0.0975 * chi**4
    return 16 / 9 * 0.02 * 2.0 * d**1.5 * layer


def _plates(d: np.ndarray) -> np.ndarray:
    """On a cylinder of neo-Hookean rubber, 12 mm high."""
    stretch = 1 - d / 12
    return 1.5 * (1 / stretch**2 - stretch)


def _line(d: np.ndarray) -> np.ndarray:
    """A cylinder of radius 6 mm pressed from its side: Johnson, Contact Mechanics, Eq. 5.57, with a logarithm."""
    load = np.geomspace(1e-9, 20.0, 4000)
    by_length = load / (np.pi * 0.05 * 20.0)
    return np.interp(d, by_length * (2 * np.log(4 * 6.0 / np.sqrt(4 * 6.0 * by_length)) - 1), load)


LEGS = {name: (_febio(name), 20.0, 0.4, LEG) for name in ("neo-hookean", "reduced-polynomial")}
SPECIMENS = {name: (curve, 4.0, 0.1, None) for name, curve in (("ball", _ball), ("plates", _plates), ("line", _line))}
NUMBER = 20


def _contacts(curve: Curve, depth: float, rate: float, scales: Scales | None) -> Iterator[tuple[float, Contact]]:
    """Yield the truth and what is found, with errors of a lab: flicker, heavy tails, an encoder's steps."""
    time = np.arange(0.0, depth / rate, 0.1)
    course = Course(time, rate * time, curve(rate * time))
    peak = float(course.force[-1])
    for seed in range(NUMBER):
        drawn = np.random.default_rng([seed, 5])
        share = 10 ** drawn.uniform(-3, -2)
        instrument = Instrument(share * peak, 0.02) if scales else Instrument(share * peak, 0.015)
        air = 0.2 * depth
        (made,) = record([course], LabErrors(0.01, air), np.random.default_rng(seed), instrument)
        truth = float(np.random.default_rng(seed).uniform(0.0, 1.0, 1)[0]) * air
        yield truth, segment(made, instrument, scales=scales or Scales.of_specimen(made)).contact


@pytest.mark.parametrize("name", [*LEGS, *SPECIMENS])
def test_contact_lies_in_its_interval_for_curves_of_other_sources(name: str) -> None:
    found = list(_contacts(*(LEGS | SPECIMENS)[name]))
    off = np.array([(c.expected[0] - truth) / c.expected[1] for truth, c in found])
    held, widths = int(np.sum(np.abs(off) < 1.96)), [2 * c.expected[1] for _, c in found]
    seen = sum(c.in_air for _, c in found)
    print(
        f"{name}: {held} of {len(found)} within 95 %, median half-width {np.median(widths):.3f} mm, air seen in {seen}"
    )
    assert held >= 0.85 * NUMBER
    assert np.abs(off).max() < 4.0


def test_contacts_of_repeats_that_disagree_are_known_no_better_than_that() -> None:
    """One trial's force begins with a dead way, as a slack drive has it: it seems to touch later than it does."""
    instrument = Instrument(0.02, 0.02)
    alike = [press(air=1.5, force_sd=0.02, displacement_sd=0.02, seed=k) for k in range(3)]
    plain = [segment(one, instrument) for one in alike]
    agreeing = among_repeats(plain)
    assert [one.contact for one in agreeing] == [one.contact for one in plain]
    off = plain[1].contact
    wrong = plain[1].touching(replace(off, displacement=off.displacement + 0.8, estimate=off.estimate + 0.8))
    repeats = [plain[0], wrong, plain[2]]
    errors = [one.contact.displacement_error for one in among_repeats(repeats)]
    assert 0.5 < errors[1] < 1.0
    assert errors[0] < errors[1]
