"""What fibres make of the 3D correction: the table, its errors, and where they enter."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from making import TOML, write_subject
from making_diagnosis import observations, ramps
from making_identification import DEPTH, identify, pressed_leg
from making_results import law_document

from legfem.inverse.correction import FIBRES, FibreTable, TabulatedCorrection, read_fibres, with_fibres
from legfem.inverse.elastography import FibreRatio
from legfem.legs.correction_of_leg import choose_correction, correction_of, why_without_fibres
from legfem.legs.loading import load_subject
from legfem.legs.solver_3d import fibre_errors
from legfem.mechanisms import mechanism_named
from legfem.report.answers import sentences_of
from legfem.report.kinds import page_of
from legfem.report.render import plain_page
from legfem.solve.path import ForceCurve

GRID = np.linspace(0.0, 25.0, 26)
NOTHING = np.asarray(1e-3), np.asarray(0.0)
KNOWN = FibreRatio(2.5, 0.4, "measured", "shear waves")


def power(errors: dict[str, float] | None = None) -> FibreTable:
    """Return a table whose factor is a power of the ratio that grows with the depth."""
    ratio = np.array([1.2, 1.5, 2.0, 3.0, 5.0, 8.0])
    rise = 0.1 + 0.01 * GRID
    shares = {name: np.full(26, share) for name, share in (errors or {"girth": 0.1}).items()}
    given = {"cylinder": {"radius": 15.0, "length": 50.0}}
    return FibreTable(ratio, GRID, np.log(ratio)[:, None] * rise, shares, given)


def plain(P: float = -0.2) -> TabulatedCorrection:
    return TabulatedCorrection(
        "a leg",
        GRID,
        np.array([0.2e-3, 5e-3]),
        np.array([0.0, 0.5]),
        np.full((2, 2, 26), P),
        {"mesh": np.full(26, 0.012)},
    )


def test_between_its_ratios_the_table_is_smooth_and_nothing_at_one():
    table = power()
    for ratio in (1.1, 1.7, 2.5, 4.0, 7.0):
        np.testing.assert_allclose(table.log_at(ratio, GRID), np.log(ratio) * (0.1 + 0.01 * GRID), rtol=1e-10)
        step = 1e-5
        slope = (table.log_at(ratio * np.exp(step), GRID) - table.log_at(ratio, GRID)) / step
        np.testing.assert_allclose(table.slope_at(ratio, GRID), slope, rtol=1e-4)
    np.testing.assert_array_equal(table.log_at(1.0, GRID), 0.0)


def test_a_file_holds_the_table(tmp_path: Path):
    found = read_fibres(power().write(tmp_path / "fibres.json"))
    np.testing.assert_allclose(found.log_at(2.2, GRID), power().log_at(2.2, GRID), atol=2e-5)
    assert found.given["cylinder"]["length"] == 50.0 and "girth" in found.errors


def test_the_corrected_force_is_multiplied_and_keeps_its_errors():
    table, before = power(), plain()
    after = with_fibres(before, table, KNOWN)
    d = np.array([3.0, 12.0, 20.0])
    factor = 2.5 ** (0.1 + 0.01 * d)
    np.testing.assert_allclose(after.factor(d, *NOTHING), 1.2 * factor)
    modes = after.relative_errors(d, 1e-3, 0.0)
    np.testing.assert_allclose(modes["mesh"], 0.01)
    # d ln F / d r = (0.1 + 0.01 d) / r
    np.testing.assert_allclose(np.abs(modes[f"{FIBRES}ratio"]), 0.4 * (0.1 + 0.01 * d) / 2.5)
    np.testing.assert_allclose(np.abs(modes[f"{FIBRES}girth"]), 0.1 * np.log(factor))
    assert "2.5 ± 0.4" in after.name


def test_at_a_ratio_of_one_nothing_changes_but_the_ratio_may_be_off():
    one = with_fibres(plain(), power(), replace(KNOWN, value=1.0))
    np.testing.assert_allclose(one.values, plain().values, rtol=1e-12)
    modes = one.relative_errors(GRID, 1e-3, 0.0)
    assert np.all(modes[f"{FIBRES}girth"] == 0.0) and np.all(modes[f"{FIBRES}ratio"] < 0.0)


def test_legfem_s_table_is_whole_and_plausible():
    table = read_fibres()
    d = np.linspace(0.0, 20.0, 21)
    logs = np.array([table.log_at(r, d) for r in (1.0, 1.5, 2.0, 3.0, 5.0, 8.0)])
    assert np.all(np.diff(logs, axis=0) > 0), "stiffer fibres, more force"
    assert 0.08 < logs[3, 2] < 0.2 and 0.15 < logs[3, -1] < 0.3
    assert len(table.errors) > 5
    assert 0.05 < np.sqrt(np.sum([e[10] ** 2 for e in table.errors.values()])) < 0.6


STATED = "[tissues.deep]\nfibre_ratio = 2.5\nfibre_ratio_sd = 0.4\n"


def leg(folder: Path, deep: str = "[tissues.deep]\n"):
    text = TOML.replace('"simulated"', '"measured"').replace("[tissues.deep]\n", deep)
    return load_subject(write_subject(folder, text))


def test_a_measured_leg_s_correction_has_its_fibres_by_default(tmp_path: Path):
    bare, fibrous = leg(tmp_path / "bare"), leg(tmp_path / "fibrous", STATED)
    d = np.linspace(0.0, 20.0, 5)
    ratio = choose_correction("auto", fibrous).factor(d, *NOTHING) / choose_correction("auto", bare).factor(d, *NOTHING)
    np.testing.assert_allclose(ratio, np.exp(read_fibres().log_at(2.5, d)), rtol=1e-6)
    written = correction_of(bare).write(tmp_path / "own.json")
    given = choose_correction(str(written), fibrous).factor(d, *NOTHING)
    np.testing.assert_allclose(given, choose_correction("own", fibrous).factor(d, *NOTHING), rtol=1e-5)
    assert choose_correction("none", fibrous) is None
    longer = replace(fibrous, indenter=replace(fibrous.indenter, length=80.0))
    assert "50" in why_without_fibres(longer) and why_without_fibres(fibrous) is None
    assert "fibres" not in "".join(correction_of(longer).errors)


def test_a_leg_simulated_in_plane_strain_knows_no_fibres(tmp_path: Path):
    flat = load_subject(write_subject(tmp_path, TOML.replace("[tissues.deep]\n", STATED)))
    assert flat.fibres is not None and choose_correction("auto", flat) is None


def recorded_with_fibres(folder: Path, c10: float, factor: np.ndarray):
    """Return a subject whose recordings are the analytic leg's times a factor of the depth."""
    subject = pressed_leg(folder, c10, 0.0, seed=2)
    at = np.linspace(0.0, DEPTH, len(factor))
    trials = tuple(
        replace(one, force=one.force * np.interp(one.displacement, at, factor)) for one in subject.recordings
    )
    return replace(subject, recordings=trials, plane_strain=False)


def test_a_known_ratio_takes_its_part_of_the_force_out_of_c10(tmp_path: Path):
    factor = np.exp(power().log_at(2.5, np.linspace(0.0, DEPTH, 41)))
    subject = recorded_with_fibres(tmp_path, 1.0, 1.2 * factor)
    known = replace(subject, fibres=KNOWN)
    laws = ("neo-hookean",)
    (without,) = identify(subject, laws=laws, correction=plain())
    corrected = with_fibres(plain(), power(), KNOWN)
    (found,) = identify(known, laws=laws, correction=corrected)
    exact = replace(KNOWN, sd=0.0)
    (sure,) = identify(replace(known, fibres=exact), laws=laws, correction=with_fibres(plain(), power(), exact))
    high, c10 = without.estimates["deep.C10"], found.estimates["deep.C10"]
    assert high.value > 1.2e-3 and not high.ci95[0] < 1e-3 < high.ci95[1]
    assert c10.value == pytest.approx(1e-3, rel=0.02) and c10.ci95[0] < 1e-3 < c10.ci95[1]
    assert c10.relative_half_width > 1.2 * sure.estimates["deep.C10"].relative_half_width
    assert max(c10.error_shares, key=c10.error_shares.get) == "fibres"
    assert any("equally stiff in all directions" in text for text in sentences_of([without]))
    (said,) = [text for text in sentences_of([found]) if "times as stiff in shear" in text]
    assert "2.5 ± 0.4" in said and "measured: shear waves" in said
    assert any("stated without" in text for text in sentences_of([sure]))
    document = law_document(found)
    assert document["fibres"] == {
        "ratio": 2.5,
        "sd": 0.4,
        "provenance": "measured",
        "source": "shear waves",
        "in_correction": True,
    }
    assert law_document(without)["fibres"] is None
    page = " ".join(plain_page(page_of([found]), []).split())
    assert "shear moduli along the leg over across: 2.5 ± 0.4" in page


def test_errors_of_fibres_in_3d_follow_the_chain_of_the_ratio():
    """Of a force that is a power of shear and extension, by exact derivatives."""
    c10, ratio = 1.2e-3, 2.5
    d = np.linspace(0.0, 20.0, 81)

    def force(r: float, tension: float = 1.0) -> np.ndarray:
        shear = 2 * c10 * (r - 1)
        return d**1.5 * (1 + 40 * shear + 9 * 4 * shear * tension)

    curve = ForceCurve(d, force(ratio), {"deep.fibres.shear": 40 * d**1.5, "deep.fibres.extension": 9 * d**1.5})
    found = fibre_errors(curve, KNOWN, {"deep": c10}, d)
    step = 1e-6
    slope = (force(ratio + step) - force(ratio - step))[40] / (2 * step) / force(ratio)[40]
    assert found[f"{FIBRES}ratio"][40] == pytest.approx(0.4 * slope, rel=1e-5)
    doubled = (force(ratio, 1 + step) - force(ratio, 1 - step))[40] / (2 * step) / force(ratio)[40]
    assert found[f"{FIBRES}stiffness in tension"][40] == pytest.approx(np.log(2) * doubled, rel=1e-5)
    assert np.all(np.isfinite(found[f"{FIBRES}ratio"])), "level where there is no force"


def test_the_mechanism_is_the_table_and_its_errors():
    observed, _ = observations(ramps())
    mechanism = mechanism_named("muscle-fibres")
    values = {"ratio": 3.0, "size": 0.0, "course": 0.0}
    log = read_fibres().log_at(3.0, observed.displacement)
    np.testing.assert_allclose(mechanism.force_factor(values, observed), np.exp(log))
    spread = np.sqrt(
        sum(
            (mechanism.force_factor({**values, name: 1.0}, observed) / np.exp(log) - 1) ** 2
            for name in ("size", "course")
        )
    )
    whole = np.sqrt(sum(e**2 for e in read_fibres().errors_at(observed.displacement).values()))
    deep = observed.displacement > 5
    np.testing.assert_allclose(spread[deep], (whole * log)[deep], rtol=0.35)
