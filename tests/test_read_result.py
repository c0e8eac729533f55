"""A folder of results is read back to the values that were written, whatever kind of problem they are of."""

from __future__ import annotations

import json
import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import making_pages as pages
import numpy as np
import pytest
from making import write_subject
from making_diagnosed import diagnosed
from making_results import law_document, result
from test_diagnosis_report import CASES

import legfem as lf
from legfem.common.documents import write_document
from legfem.inverse.catalogue import key_of
from legfem.inverse.document import fit_document
from legfem.inverse.fit import Fit
from legfem.inverse.stored import StoredModel, StoredResult
from legfem.inverse.verdict import answer_of
from legfem.legs.diagnosis import notices_of
from legfem.legs.loading import load_subject
from legfem.report.answers import headline_of
from legfem.report.diagnosis_document import document, versions


def same(one: float, other: float) -> bool:
    """Tell whether two numbers are the same as far as JSON has them: it knows none that isn't finite."""
    return one == other or not (math.isfinite(one) or math.isfinite(other))


def test_costs_and_stiffnesses_of_solves_have_their_own_units():
    search = law_document(result("reduced-polynomial"))["search"]
    assert search["solves"][0].keys() > {"c10_kPa", "c20_kPa", "cost_N2"}


def assert_same_fit(back: StoredModel, fit: Fit[Any]) -> None:
    assert list(back.parameters) == [key_of(name) for name in fit.estimates]
    for one, estimate in zip(back.parameters.values(), fit.estimates.values(), strict=True):
        shown = estimate.shown
        assert (one.unit, one.identifiability) == (shown.unit, estimate.identifiability)
        assert (one.role, one.at_bound) == (estimate.parameter.role, estimate.at_bound)
        numbers = ((one.value, shown.value), (one.standard_error, shown.standard_error))
        assert all(same(*pair) for pair in (*numbers, *zip(one.ci95, shown.ci95, strict=True)))
        assert one.share_of_squared_error == estimate.error_shares
    assert back.law == fit.law and back.identifiability == fit.identifiability
    for mine, theirs in ((back.goodness, fit.goodness), (back.agreement, fit.agreement)):
        assert mine.degrees_of_freedom == theirs.degrees_of_freedom
        assert same(mine.chi_square, theirs.chi_square) and same(mine.p_value, theirs.p_value)
    assert [(one.code, dict(one.parameters)) for one in back.notices] == [
        (one.code, dict(one.parameters)) for one in fit.notices
    ]
    assert [one.name for one in back.tests] == [one.name for one in fit.tests]
    for one, test in zip(back.tests, fit.tests, strict=True):
        assert one.fitted == test.fitted and same(one.goodness.chi_square, test.goodness.chi_square)
        readings = next(values for name, values in one.curve.items() if name.startswith("measured_"))
        np.testing.assert_array_equal(np.array(readings, dtype=float), test.force.channel.values)
    assert {key: one.value for key, one in back.computed.items()} == {
        key: one.value for key, one in fit.computed.items()
    }


def assert_comes_back(fits: list[Fit[Any]], folder: Path) -> StoredResult:
    write_document(folder / "result.json", fit_document(fits))
    back = lf.read_result(folder)
    assert (back.kind, back.subject, back.title) == (fits[0].kind, fits[0].subject.id, fits[0].subject.title)
    assert back.origin == fits[0].subject.origin and back.versions == fits[0].versions
    assert headline_of(back.answer).said == headline_of(fits[0].details.chosen(fits).answer).said
    assert list(back.laws) == [fit.law for fit in fits]
    for fit in fits:
        assert_same_fit(back.laws[fit.law], fit)
    return back


def test_a_leg_fitted_with_both_laws_comes_back(tmp_path: Path) -> None:
    assert_comes_back([result("neo-hookean"), result("reduced-polynomial")], tmp_path)


def test_what_was_not_found_comes_back_as_unknown(tmp_path: Path) -> None:
    fit = result("neo-hookean")
    ((name, known),) = fit.estimates.items()
    open_ = replace(known, ci95=(known.ci95[0], math.inf), standard_error=math.inf, identifiability="not identifiable")
    back = assert_comes_back([replace(fit, estimates={name: open_})], tmp_path)
    assert math.isnan(back.laws["neo-hookean"].parameters["c10_deep"].ci95[1])


def test_specimens_come_back(tmp_path: Path) -> None:
    assert_comes_back(pages.specimens(tmp_path), tmp_path / "out")


def test_a_leg_in_its_stocking_comes_back_with_its_pressures(tmp_path: Path) -> None:
    back = assert_comes_back([pages.stocking()], tmp_path)
    assert back.answer.parameters["mean"] > 0


@pytest.mark.parametrize("verdict", CASES)
def test_a_diagnosis_comes_back_with_its_verdict_and_explanations(verdict: str, tmp_path: Path) -> None:
    effects, bump, asked = CASES[verdict]
    found, subject = diagnosed(effects, bump=bump, asked=asked), load_subject(write_subject(tmp_path / "leg"))
    write_document(tmp_path / "diagnosis.json", document(found, subject, 1.0))
    back = lf.read_result(tmp_path)
    assert back.verdict == found.verdict and back.answer == answer_of(found, back.answer.doubts)
    assert [one.code for one in back.every_notice] == list(
        dict.fromkeys(one.code for one in notices_of(found, subject))
    )
    assert back.base_model is not None and same(back.base_model.p_value, found.assessment.p_value)
    shown = found.base_model.shown("deep.C10")
    assert back.base_model.parameters["c10_deep"].value == pytest.approx(shown.value, rel=1e-12)
    probable = [one for one in found.explained.every if one.probability > 1e-4]
    assert [one.mechanisms for one in back.explanations] == [tuple(one.names) for one in probable]
    assert [one.probability for one in back.explanations] == [one.probability for one in probable]
    assert back.versions == versions()


def test_a_folder_without_results_and_one_of_another_version_are_refused(tmp_path: Path) -> None:
    with pytest.raises(lf.InputError, match=r"contains no result\.json or diagnosis\.json"):
        lf.read_result(tmp_path)
    older = fit_document([result("neo-hookean")]) | {"schema": "legfem.identify/1"}
    (tmp_path / "result.json").write_text(json.dumps(older))
    with pytest.raises(lf.InputError, match=r"its schema is legfem.identify/1.*run it again"):
        lf.read_result(tmp_path)
    (tmp_path / "result.json").write_text('{"schema": ')
    with pytest.raises(lf.InputError, match="cannot be read"):
        lf.read_result(tmp_path)
