"""Several tests of one material, fitted by one law: narrower where they agree, and what they disagree on is said."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from making_several_tests import C10, HEAD, described, write_tests
from making_stress_tables import (
    TRELOAR_BIAXIAL,
    TRELOAR_BIAXIAL_STRETCH,
    TRELOAR_UNIAXIAL,
    TRELOAR_UNIAXIAL_STRETCH,
    write_table,
)
from typer.testing import CliRunner

import legfem as lf
from legfem.cohort.members import find_members
from legfem.commands.identify import app
from legfem.inverse.fit import Fit
from legfem.report.answers import sentences_of
from legfem.report.preview import preview_of
from legfem.specimens.details import SpecimenDetails
from legfem.specimens.model_discrepancy import agreement_of_tests

FOAM = Path(__file__).parents[2] / "shared" / "files" / "08_foam_tension_compression_shear_xlsx"


def fitted(folder: Path, law: str = "neo-hookean") -> Fit[SpecimenDetails]:
    fit = lf.identify(lf.load_specimen(folder), law)[law]
    estimate = fit.estimates["deep.C10"]
    print(folder.name, law, estimate.value, estimate.ci95, fit.details.agreement and fit.details.agreement.text)
    return fit


def width(fit: Fit[SpecimenDetails], name: str = "deep.C10") -> float:
    low, high = fit.estimates[name].ci95
    return high - low


def holds(fit: Fit[SpecimenDetails], truth: float, name: str = "deep.C10") -> bool:
    low, high = fit.estimates[name].ci95
    return low < truth < high


@pytest.mark.slow
def test_tension_shear_and_another_code_s_plates_give_one_constant_narrower_than_each(tmp_path: Path) -> None:
    tests = ("tension", "shear", "plates")
    folder = write_tests(tmp_path / "gel", tests)
    toml = folder / "plates" / "specimen.toml"
    toml.write_text(toml.read_text().replace("height_mm", 'ends = "bonded"\nheight_mm'))
    together, alone = fitted(folder), [fitted(folder / name) for name in tests]
    assert holds(together, C10) and together.goodness.fits
    assert width(together) < min(map(width, alone))
    agreement = together.details.agreement
    assert agreement is not None and not agreement.disagree and agreement.one_law_for_all > 0.6
    shares = together.estimates["deep.C10"].information_shares
    assert set(shares) == set(tests) and sum(shares.values()) == pytest.approx(1.0) and min(shares.values()) > 0.1


@pytest.mark.slow
def test_other_tests_tell_what_the_ends_between_plates_do(tmp_path: Path) -> None:
    folder = write_tests(tmp_path / "gel", ("tension", "shear", "plates"))
    together, alone = fitted(folder), fitted(folder / "plates")
    chances = [{one.name: one.probability for one in fit.details.alternatives} for fit in (together, alone)]
    print(chances)
    assert holds(together, C10) and width(together) < width(alone)
    assert chances[0]["bonded"] > max(0.9, chances[1]["bonded"])


def test_tests_together_tell_stiffness_better_than_each_and_stiffening_as_the_best(tmp_path: Path) -> None:
    tests, law, name = ("tension", "shear"), "reduced-polynomial", "deep.C20"
    folder = write_tests(tmp_path / "gel", tests, c20=5e-4)
    together, alone = fitted(folder, law), [fitted(folder / test, law) for test in tests]
    print([width(one, name) for one in (together, *alone)])
    assert holds(together, C10) and holds(together, 5e-4, name)
    assert width(together) < min(map(width, alone))
    # Tension alone tells the stiffening, which shear hardly does.
    assert width(together, name) < 1.15 * width(alone[0], name) < 0.5 * width(alone[1], name)
    found = lf.identify(lf.load_specimen(folder))
    assert found.best.law == law and not found["neo-hookean"].goodness.fits
    assert "describes the 2 recordings together" in " ".join(found.summary().split())


def test_a_material_that_resists_pressing_more_than_pulling_is_said_to(tmp_path: Path) -> None:
    own = {"tension": C10, "compression": 1.35 * C10}
    fit = fitted(write_tests(tmp_path / "gel", tuple(own), own.__getitem__))
    agreement = fit.details.agreement
    assert agreement is not None and agreement.one_law_for_all < 0.05 and agreement.apart is None
    pulled, pressed = agreement.tests
    assert pressed.ci95[0] < 1.35 < pressed.ci95[1] and pulled.ci95[0] < 1 / 1.35 < pulled.ci95[1]
    # Nobody can say which is the material's.
    assert all(holds(fit, truth) for truth in own.values())
    assert sentences_of([fit])[0] == agreement.text


@pytest.mark.slow
@pytest.mark.parametrize("compliance", [0.3, 1.5])
def test_a_rig_that_yields_in_one_test_is_named_and_the_constant_is_that_of_the_others(
    tmp_path: Path, compliance: float
) -> None:
    folder = write_tests(tmp_path / "gel", compliance=compliance)
    runner, out = CliRunner(), tmp_path / "out"
    done = runner.invoke(app, ["--specimen-dir", str(folder), "--out", str(out), "--jobs", "1"])
    said = " ".join(done.output.split())
    assert done.exit_code == 0 and "READ WITH CAUTION" in said and "The test compression stands apart" in said
    assert (
        "It is predicted here, and not fitted." in said and "Check the rig, sizes and specimens of compression" in said
    )
    assert "C10 by tension" in said and "left out, compression/a: predicted" in said
    found = lf.identify(lf.load_specimen(folder))
    for fit in found.fits:
        assert holds(fit, C10) and fit.goodness.fits, fit.law
        assert [one.name for one in fit.tests if not one.fitted] == ["compression/a"]
    agreement = found.document()["laws"]["neo-hookean"]["agreement_of_tests"]
    chances = {one["name"]: one["stands_apart"] for one in agreement["tests"]}
    assert agreement["one_law_for_all"] < 0.05 and chances["compression"] > 0.7
    alone = fitted(folder / "compression").estimates["deep.C10"]
    assert alone.value < 0.9 * C10


@pytest.mark.slow
def test_a_diagnosis_names_the_rig_of_that_test_after_which_all_agree(tmp_path: Path) -> None:
    folder = write_tests(tmp_path / "gel", compliance=0.5)
    found = lf.diagnose(lf.load_specimen(folder), library=tmp_path / "kept")
    said = " ".join(found.summary().split())
    print(said)
    assert found.verdicts["tension"] == found.verdicts["shear"] == "consistent"
    assert found["compression"].diagnosis.models[0].names == ("support-compliance",)
    assert "WARNING: The tests disagree" in said and "The test compression stands apart" in said
    # Which law the compressed one follows is open, and widens what it tells of the others.
    repaired = said.partition("With what each diagnosis found to be left out: ")[2]
    assert repaired.startswith(
        ("One set of constants serves", "The tests leave open whether one set of constants serves")
    )
    factors = re.findall(r"([\d.]+) \(([\d.]+) to ([\d.]+)\) times", repaired)
    assert len(factors) == 3
    assert all(float(low) < 1 < float(high) and 0.97 < float(factor) < 1.03 for factor, low, high in factors)
    found.write(tmp_path / "out")
    assert (tmp_path / "out" / "compression" / "report.html").is_file()


def test_false_alarms_are_rare_and_a_test_that_is_off_is_found() -> None:
    """Constants known to 3 % by each of four tests, without a recording."""
    drawn, names = np.random.default_rng(1), ("a", "b", "c", "d")
    tests = {name: np.array([k]) for k, name in enumerate(names)}
    one, covariance = np.ones((4, 1)), 0.03**2 * np.eye(4)

    def seen(factor: float) -> list:
        found = []
        for _ in range(300):
            left = 0.03 * drawn.normal(size=4) + np.array([0.0, 0.0, factor - 1, 0.0])
            found.append(agreement_of_tests(left, one[:, 0], one, one, covariance, tests))
        return found

    assert np.mean([found.disagree for found in seen(1.0)]) < 0.1
    named = [found.apart.name if found.apart else "" for found in seen(0.8)]
    print({name: named.count(name) for name in set(named)})
    assert named.count("c") > 0.9 * len(named)
    assert all(
        found.one_law_for_all + found.each + sum(t.stands_apart for t in found.tests) < 1 + 1e-9 for found in seen(1.1)
    )


@pytest.mark.slow
@pytest.mark.parametrize("off", [1.0, 0.85])
def test_recordings_of_many_seeds_are_judged_as_they_are_and_the_interval_holds_the_truth(
    tmp_path: Path, off: float
) -> None:
    """Compression off by a factor, or sound; sizes off by 1 %, gains by 0.4 %, errors as nothing here assumes."""
    fits = []
    for seed in range(30):
        folder = write_tests(
            tmp_path / f"{seed}", c10=lambda test: C10 * (off if test == "compression" else 1), seed=seed
        )
        fits.append(lf.identify(lf.load_specimen(folder), "neo-hookean")["neo-hookean"])
    found = [fit.details.agreement for fit in fits]
    named = [one.apart.name if one.apart else "" for one in found]
    held, said = sum(holds(fit, C10) for fit in fits), sum(one.disagree for one in found)
    print(f"off by {off}: interval holds {held} of 30, disagree {said}, named {named.count('compression')}")
    assert held >= 27
    if off == 1.0:
        assert said <= 2
    else:
        assert named.count("compression") >= 27


def test_a_cohort_counts_the_folder_and_not_its_tests(tmp_path: Path) -> None:
    write_tests(tmp_path / "gel")
    assert [one.name for one in find_members(tmp_path, "identify").every] == ["gel"]


def test_a_test_can_be_left_out_by_name_and_is_predicted(tmp_path: Path) -> None:
    folder = lf.load_specimen(write_tests(tmp_path / "gel"))
    fit = lf.identify(folder, "neo-hookean", leave_out=["compression"])["neo-hookean"]
    (left,) = [one for one in fit.tests if not one.fitted]
    assert left.name == "compression/a" and holds(fit, C10)
    assert len(fit.details.agreement.tests) == 2


def test_what_is_seen_before_solving_is_of_all_tests(tmp_path: Path) -> None:
    (tmp_path / "seen").mkdir()
    seen = preview_of(write_tests(tmp_path / "gel"), tmp_path / "seen")
    assert [name for name, _ in seen.facts] == ["tension/a", "compression/a", "shear/a"] and not seen.trouble
    assert len({one.picture for one in seen.recordings}) == 3


def test_rubber_of_1944_in_two_tests(tmp_path: Path) -> None:
    """Measured by L. R. G. Treloar: his uniaxial and equibiaxial tests ask for C10 within a few percent."""
    table = '[recordings]\ntable = { stretch = "stretch", stress = "stress", unit = "MPa", measure = "nominal" }\n'
    columns = {
        "uniaxial": ('[uniaxial]\ndirection = "tension"\n', TRELOAR_UNIAXIAL_STRETCH, TRELOAR_UNIAXIAL),
        "equibiaxial": ("[equibiaxial]\n", TRELOAR_BIAXIAL_STRETCH, TRELOAR_BIAXIAL),
    }
    for name, (test, stretch, stress) in columns.items():
        write_table(tmp_path / name, "stretch,stress", stretch, stress)
        (tmp_path / name / "specimen.toml").write_text(HEAD.format(name=name) + test + table)
    fit = fitted(described(tmp_path, list(columns)))
    assert 0.16 < fit.estimates["deep.C10"].value < 0.22
    assert all(0.8 < one.force_over_others < 1.25 for one in fit.details.agreement.tests)


@pytest.mark.slow
@pytest.mark.skipif(not FOAM.is_dir(), reason="the foam's tables aren't here")
def test_a_foam_s_tension_compression_and_shear_need_different_constants(tmp_path: Path) -> None:
    """Measured (M. A. Moreno-Mateos): compressed to 0.4 it buckles, so that no law of ours serves all three."""
    line = 'table = {{ {} = "lambda", stress = "P", unit = "MPa"{} }}\n[tissue]\npoisson_ratio = 0.3\n'
    kinds = {
        "tension": ("UT", '[uniaxial]\ndirection = "tension"\n', line.format("stretch", ', measure = "nominal"')),
        "compression": (
            "UC",
            '[uniaxial]\ndirection = "compression"\n',
            line.format("stretch", ', measure = "nominal"'),
        ),
        "shear": ("SS", "[simple_shear]\n", line.format("strain", "")),
    }
    for name, (file, test, table) in kinds.items():
        rows = np.genfromtxt(FOAM / f"foam_{file}.csv", delimiter=",", skip_header=1)
        rows = rows[rows[:, 0] >= 0]
        write_table(tmp_path / name, "lambda,P (MPa)", *rows.T)
        (tmp_path / name / "specimen.toml").write_text(f"{HEAD.format(name=name)}{test}[recordings]\n{table}")
    fit = fitted(described(tmp_path, list(kinds)))
    agreement = fit.details.agreement
    assert agreement is not None and agreement.one_law_for_all < 0.01 and not fit.goodness.fits
    factor = {one.name: one.force_over_others for one in agreement.tests}
    assert factor["tension"] > 1.3 > 0.8 > factor["compression"]
    assert fit.estimates["deep.C10"].identifiability == "not identifiable"
    stiffening = fitted(tmp_path, "reduced-polynomial").estimates["deep.C20"]
    assert stiffening.ci95[0] >= stiffening.parameter.bounds[0]


WRONG = {
    "one": ('tests = ["tension"]', "tests"),
    "twice": ('tests = ["tension", "shear", "shear"]', "'shear' stands 2 times"),
    "missing": ('tests = ["tension", "torsion"]', "not found"),
    "elsewhere": ('tests = ["tension", "../shear"]', "tests"),
    "beside a test": ('tests = ["tension", "shear"]\n[uniaxial]\ndirection = "tension"', "uniaxial"),
}


@pytest.mark.parametrize("name", WRONG)
def test_a_wrong_list_is_refused_in_one_line(tmp_path: Path, name: str) -> None:
    folder = write_tests(tmp_path / "gel")
    line, words = WRONG[name]
    (folder / "specimen.toml").write_text(f"{HEAD.format(name='gel')}{line}\n")
    _refused(folder, words)


CHANGED = {
    "another law": ("shear", "[tissue]\nlaw = 'reduced-polynomial'\n", "[tissue] law"),
    "another ratio": ("shear", "[tissue]\npoisson_ratio = 0.4\n", "poisson_ratio"),
    "fibres": ("tension", "[fibres]\ndirection = 'load'\n", "fibres"),
    "simulated": ("shear", None, "origin"),
    "two tables": ("shear", "[uniaxial]\ndirection = 'tension'\n", "give each a folder of its own"),
}


@pytest.mark.parametrize("name", CHANGED)
def test_tests_that_are_not_of_one_material_are_refused_in_one_line(tmp_path: Path, name: str) -> None:
    folder = write_tests(tmp_path / "gel")
    test, more, words = CHANGED[name]
    toml = folder / test / "specimen.toml"
    text = toml.read_text()
    toml.write_text(text.replace("measured", "simulated") if more is None else text + more)
    _refused(folder, words)


def test_a_copy_and_a_table_beside_relaxation_are_refused(tmp_path: Path) -> None:
    folder = write_tests(tmp_path / "gel")
    copied = folder / "shear" / "recordings" / "a.csv"
    kept = copied.read_text()
    copied.write_text((folder / "tension" / "recordings" / "a.csv").read_text())
    _refused(folder, "is a copy of")
    copied.write_text(kept)
    stretch = np.linspace(1.0, 1.4, 20)
    write_table(folder / "rubber", "stretch,stress", stretch, 10 * (stretch - stretch**-2))
    table = 'table = { stretch = "stretch", stress = "stress", unit = "kPa", measure = "nominal" }\n'
    text = f'{HEAD.format(name="rubber")}[uniaxial]\ndirection = "tension"\n[recordings]\n{table}'
    (folder / "rubber" / "specimen.toml").write_text(text)
    toml = folder / "shear" / "specimen.toml"
    toml.write_text(f"{toml.read_text()}[tissue]\nrelaxes = true\n")
    _refused(described(folder, ["shear", "rubber"]), "is a table without a time")


def _refused(folder: Path, words: str) -> None:
    done = CliRunner().invoke(app, ["--specimen-dir", str(folder), "--out", str(folder / "out")])
    print(done.output)
    assert done.exit_code == 2 and words in done.output and len(done.output.strip().splitlines()) == 1
