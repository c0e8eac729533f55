"""Shear-wave elastography and stated fibres: read, refused, and weighed against indentation."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making import TOML, write_subject
from making_diagnosed import diagnosed_of
from making_diagnosis import noisy, observations, ramps
from making_identification import AnalyticLeg, identify, pressed_leg

from legfem.common.errors import InputError
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, parameter_of
from legfem.inverse.correction import TabulatedCorrection
from legfem.inverse.elastography import FibreRatio, ShearModulus, elastography_priors
from legfem.inverse.parameter import Prior
from legfem.legs.diagnosis import accuracy_of, of_elastography
from legfem.legs.loading import load_subject
from legfem.legs.nuisances import DRAWN
from legfem.legs.plausibility import doubts_about
from legfem.report.answers import sentence_of, sentences_of

ACROSS = '[[elastography]]\ntissue = "deep"\nplane = "across"\nshear_modulus_kPa = {}\nsd_kPa = {}\n'
ALONG = ACROSS.replace('"across"', '"along"')
FAT = ACROSS.replace('"deep"', '"superficial"')


def loaded(folder: Path, more: str, deep: str = ""):
    return load_subject(write_subject(folder, TOML.replace("[tissues.deep]\n", f"[tissues.deep]\n{deep}") + more))


def test_muscle_across_is_a_prior_of_c10_and_fat_one_that_takes_its_place(tmp_path):
    more = ACROSS.format(1.9, 0.4) + 'source = "SSI, five frames"\n' + FAT.format(6.0, 1.0)
    subject = loaded(tmp_path / "leg", more)
    priors = elastography_priors(subject.elastography)
    assert set(priors) == {"deep.C10", "superficial.C10"}
    deep, fat = priors["deep.C10"], priors["superficial.C10"]
    assert (deep.centre, deep.sd) == pytest.approx((0.95e-3, 0.2e-3))
    assert (fat.centre, fat.sd) == pytest.approx((3e-3, 0.5e-3))
    assert deep.source == "SSI, five frames" and subject.fibres is None
    assert subject.tissues["superficial"].C10 == pytest.approx(3e-3)


def test_both_planes_make_the_ratio_with_its_error(tmp_path):
    subject = loaded(tmp_path / "leg", ACROSS.format(2.0, 0.2) + ALONG.format(5.0, 1.0))
    relative = math.hypot(0.1, 0.2)
    assert subject.fibres == FibreRatio(2.5, pytest.approx(2.5 * relative), "measured", "shear-wave elastography")
    assert set(elastography_priors(subject.elastography)) == {"deep.C10"}


def test_a_stated_ratio_is_a_prior_or_assumed(tmp_path):
    found = loaded(tmp_path / "leg", "", "fibre_ratio = 2.0\nfibre_ratio_sd = 0.5\n").fibres
    assert found == FibreRatio(2.0, 0.5, "prior", "subject.toml")
    assert str(found) == "2 ± 0.5"
    exact = loaded(tmp_path / "exact", "", "fibre_ratio = 2.0\n").fibres
    assert exact == FibreRatio(2.0, 0.0, "assumed", "subject.toml") and str(exact) == "2"


@pytest.mark.parametrize(
    ("more", "deep", "said"),
    [
        (ACROSS.format(1900, 400), "", "elastography.0.shear_modulus_kPa.*in Pa"),
        (ACROSS.format(0.1, 0.05), "", "elastography.0.shear_modulus_kPa"),
        (ACROSS.format(2, 0), "", "elastography.0.sd_kPa: 0.* above 0"),
        (ACROSS.format(2, 1).replace("sd_kPa", "sd_Pa"), "", "did you mean 'sd_kPa'"),
        (ACROSS.format(2, 1).replace('"across"', '"cross"'), "", "did you mean 'across'"),
        (ACROSS.format(2, 1).replace('"deep"', '"fascia"'), "", "elastography.0.tissue"),
        (ACROSS.format(2, 1) * 2, "", "elastography.1.*given twice"),
        (FAT.format(2, 1) + FAT.format(2, 1).replace("across", "along"), "", "given twice"),
        (ALONG.format(5, 1), "", "elastography.0.plane.*across"),
        (ACROSS.format(2, 1) + ALONG.format(5, 1), "fibre_ratio = 2.0\n", "fibre_ratio"),
        (ACROSS.format(5, 0.3) + ALONG.format(2, 0.3), "", "which plane is which"),
        ("", "fibre_ratio = 0.5\n", "tissues.deep.fibre_ratio: 0.5 is out of range"),
        ("", "fibre_ratio_sd = 0.5\n", "fibre_ratio_sd: is given without"),
        ("", "fibre_ratios = 2.0\n", "did you mean 'fibre_ratio'"),
    ],
)
def test_what_can_t_be_is_one_line(tmp_path, more, deep, said):
    with pytest.raises(InputError, match=said) as caught:
        loaded(tmp_path / "leg", more, deep)
    assert "\n" not in str(caught.value) and "subject.toml" in str(caught.value)


def test_a_ratio_a_little_under_one_is_taken_as_one_and_doubted(tmp_path):
    subject = loaded(tmp_path / "leg", ACROSS.format(2.1, 0.3) + ALONG.format(2.0, 0.3))
    assert subject.fibres.value == 1.0
    assert any("which plane is which" in str(doubt) for doubt in doubts_about(subject))


def corrected(relative: float) -> TabulatedCorrection:
    """Return a correction that does nothing, but errs."""
    grid = np.linspace(0.0, 25.0, 26)
    return TabulatedCorrection(
        "none but errors",
        grid,
        np.array([1e-3]),
        np.array([0.0]),
        np.zeros((1, 1, 26)),
        {"leg length": np.full(26, relative)},
    )


def waved(subject, c10: float, sd: float):
    """Return a subject with elastography of its muscle: C10 and its error in kPa."""
    modulus = ShearModulus("deep", "across", 2e-3 * c10, 2e-3 * sd, "shear waves")
    return replace(subject, elastography=(modulus,), plane_strain=False)


def test_elastography_narrows_what_the_ends_leave_open(tmp_path):
    """Recordings are exact but for a factor of 20 %: the two make the mean by their precisions."""
    subject = pressed_leg(tmp_path, 1.0, 0.0, seed=3)
    given = {"correction": corrected(0.2), "laws": ("neo-hookean",)}
    alone = identify(subject, **given)[0].estimates["deep.C10"]
    (found,) = identify(waved(subject, 1.3, 0.15), **given)
    both = found.estimates["deep.C10"]
    assert both.standard_error < 0.8 * alone.standard_error
    first, second = alone.standard_error**-2, 0.15e-3**-2
    expected = (first * alone.value + second * 1.3e-3) / (first + second)
    assert both.value == pytest.approx(expected, rel=0.02)
    assert both.standard_error == pytest.approx((first + second) ** -0.5, rel=0.06)
    assert found.weighting == "covariance" and found.log.converged
    assert not any("Elastography finds" in text for text in sentences_of([found]))
    assert both.error_shares["priors"] > 0.4


def test_what_is_asked_on_the_command_line_rules_over_the_folder(tmp_path):
    subject = waved(pressed_leg(tmp_path, 1.0, 0.0, seed=3), 1.3, 0.15)
    (held,) = identify(subject, laws=("reduced-polynomial",), fixed={"deep.C10": 1e-3})
    assert set(held.estimates) == {"deep.C20"}
    own = replace(parameter_of("deep.C10", AnalyticLeg().nominal), prior=Prior(1e-3, 1e-5, "linear", "mine"))
    (found,) = identify(subject, laws=("neo-hookean",), parameters=[own])
    assert found.estimates["deep.C10"].parameter.prior.source == "mine"


@pytest.mark.parametrize(("c10", "said"), [(1.6, "Elastography finds"), (0.5, "Indentation finds")])
def test_a_disagreement_is_told(tmp_path, c10, said):
    subject = waved(pressed_leg(tmp_path, 1.0, 0.0, seed=3), c10, 0.12)
    (found,) = identify(subject, correction=corrected(0.1), laws=("neo-hookean",))
    (told,) = [text for text in sentences_of([found]) if said in text]
    # The fat in series makes the force rise by 0.86 of C10's rise.
    apart = abs(c10 - 1.0) / math.hypot(0.12, 0.1 / 0.86)
    assert float(told.partition(" by ")[2].split()[0]) == pytest.approx(apart, rel=0.15)
    assert "shear waves" in told.lower()


def test_a_diagnosis_weighs_elastography_as_an_identification_does(tmp_path):
    subject = loaded(tmp_path / "leg", ACROSS.format(2.0, 0.2) + FAT.format(6.0, 0.6))
    accuracy = accuracy_of(subject)
    assert accuracy.log_sd("superficial.C10") == pytest.approx(0.1)
    assert accuracy.log_sd("fascia.C10") == DRAWN.assumed_sd
    observed, predictor = observations(ramps())
    observed = noisy(observed, predictor({DEEP_C10: 0.001, DEEP_C20: 0.0006}), 1)
    without, right = (
        diagnosed_of(observed, ["force-drift"], accuracy=known)
        for known in (None, replace(accuracy, measured={"deep.C10": Prior(1e-3, 2e-5)}))
    )
    assert without.verdict == right.verdict == "consistent"
    both = [one.intervals[DEEP_C10] for one in (without, right)]
    assert all(low < 1e-3 < high for low, high in both)
    # The gain of the trials is what C10 isn't known better by, without the waves.
    widths = [high - low for low, high in both]
    combined = 1 / math.hypot(3.92 / widths[0], 1 / 2e-5)
    assert widths[1] == pytest.approx(3.92 * combined, rel=0.1)
    assert not list(of_elastography(right, replace(subject, elastography=())))


def test_a_diagnosis_says_that_shear_waves_disagree(tmp_path):
    subject = loaded(tmp_path / "leg", ACROSS.format(2.8, 0.14))
    observed, predictor = observations(ramps())
    observed = noisy(observed, predictor({DEEP_C10: 0.001, DEEP_C20: 0.0006}), 1)
    found = diagnosed_of(observed, ["force-drift"], accuracy=accuracy_of(subject))
    (said,) = map(sentence_of, of_elastography(found, subject))
    assert said.startswith("Elastography finds a higher c10_deep") and "1.4 ± 0.07 kPa" in said
