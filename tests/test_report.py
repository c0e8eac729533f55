"""Reports: the text says what it must, and figures and files are there."""

from __future__ import annotations

import math
from dataclasses import replace

import matplotlib
import numpy as np
import pytest
from making import write_subject
from making_results import measured_curve, result
from matplotlib.image import imread

from legfem.common.numbers import number
from legfem.experiments.plane_strain import PlaneStrainSettings
from legfem.inverse.elastography import FibreRatio
from legfem.legs.details import AppliedCorrection
from legfem.legs.finite_element_models import plane_strain_test
from legfem.legs.loading import load_subject
from legfem.legs.notices import of_ends
from legfem.meshing.section import SectionMeshSettings
from legfem.report.answers import sentence_of
from legfem.report.estimates import comparison
from legfem.report.folder import keep_another, made_in_place
from legfem.report.kinds import kind_of, page_of
from legfem.report.render import brief, plain_page
from legfem.report.results import write_report
from legfem.report.style import save


@pytest.fixture(scope="module")
def both():
    measured = measured_curve()
    return [result("neo-hookean", measured), result("reduced-polynomial", measured)]


@pytest.fixture(scope="module")
def subject(tmp_path_factory):
    folder = write_subject(tmp_path_factory.mktemp("report") / "made")
    return load_subject(folder, need_recordings=False)


def text_of(results, subject) -> str:
    """Return ``report.txt``, its lines joined."""
    return " ".join(plain_page(page_of(results), []).split())


def test_report_states_values_errors_and_units(both, subject):
    found = both[1]
    text = text_of(both, subject)
    c10 = found.estimates["deep.C10"].shown
    low, high = (number(end, c10.standard_error) for end in c10.ci95)
    assert f"{number(c10.value, c10.standard_error)} kPa (95 % {low} to {high})" in text
    assert f"± {c10.standard_error:.2g} (sd)" in text
    for one in both:
        assert f"{one.cost.value:.3g}" in text and f"{one.cost.per_length:.3g}" in text
        assert f"{one.goodness.chi_square:.5g} on {one.goodness.degrees_of_freedom} degrees" in text
    assert found.cost.definition in text
    assert f"factorisations: neo-Hookean: {both[0].log.factorisations}; reduced" in text
    assert "full solves: 7; failed: 0; reused from earlier runs: 2; converged: yes; time (s): 12.3" in text
    assert f"C10 +1.000 {found.correlation('deep.C10', 'deep.C20'):+.3f}" in text
    assert "superficial neo-Hookean 2 assumed 22.5" in text, "what was held is there"
    (site,) = found.tests
    assert f"{site.curve.white_sd:.3g} N (sd)" in text


def test_one_parameter_has_no_correlations(both, subject):
    assert "Correlations" not in text_of(both[:1], subject)


def test_the_correction_is_named_with_its_size_and_error(both, subject):
    grid = both[0].tests[0].force.channel.station
    applied = AppliedCorrection("a leg's", np.full(len(grid), -0.15), np.full(len(grid), 0.04))
    text = text_of([result("neo-hookean", correction=applied)], subject)
    assert "3D correction a leg's, neo-Hookean law: force = (1 - P) x plane strain" in text
    assert "5 -0.15 ± 0.04 15 -0.15 ± 0.04" in text
    assert "without a correction for 3D effects" in text_of(both[:1], subject)


def test_who_reads_a_corrected_c10_is_told_what_fibres_would_do_to_it(tmp_path):
    leg = replace(load_subject(write_subject(tmp_path)), plane_strain=False)
    own = AppliedCorrection("own", np.zeros(3), np.full(3, 0.1))
    for correction, expected in ((own, True), (None, False)):
        texts = [sentence_of(one) for one in of_ends(leg, correction)]
        assert any("equally stiff in all directions" in text for text in texts) == expected
    fibrous = replace(leg, fibres=FibreRatio(2.0, 0.3, "measured", "shear waves"))
    for with_fibres, said in ((True, "has what fibres do"), (False, "has no fibres")):
        texts = [sentence_of(one) for one in of_ends(fibrous, replace(own, with_fibres=with_fibres))]
        assert any(said in text for text in texts)
        assert not any("equally stiff in all directions" in text for text in texts)


@pytest.mark.parametrize("origin", ["reconstructed", "simulated", "measured"])
def test_origin_of_the_data_comes_first(both, subject, origin):
    other = result("reduced-polynomial", subject=replace(subject, origin=origin))
    page = page_of([other])
    for text in (plain_page(page, []), brief(page)):
        assert text.index(f"*** {origin.upper()} DATA ***") < text.index(page.headline.sentence[:20])
    assert f"{origin} data" in kind_of([other]).figure([other]).get_suptitle()


def test_terminal_is_told_how_the_laws_compare(both, subject):
    text = " ".join(brief(page_of(both)).split())
    ratio = both[0].cost.value / both[1].cost.value
    assert f"its cost is smaller by a factor of {number(ratio)}" in text
    assert "it does not fit within the noise" in text
    assert "The reduced polynomial law fits within the noise (p = 0.3)" in text
    assert "Its additional parameter is needed" in text
    assert text.count("Poisson") == 1, "a warning of both laws is given once"


def test_comparison_does_not_praise_a_parameter_that_the_data_do_not_need(both):
    neo, poly = both
    alike = replace(neo, goodness=replace(neo.goodness, chi_square=poly.goodness.chi_square + 0.5))
    assert "its additional parameter is not needed" in [*comparison([alike, poly])][-1]
    limit = replace(poly, cost=neo.cost, neo_hookean_limit=True)
    assert "fit equally well" in [*comparison([neo, limit])][-1]


def test_report_survives_numbers_that_are_missing(both, subject):
    found = both[1]
    unmoved = replace(found.estimates["deep.C20"], value=0.0, moves={"superficial.C10": math.nan})
    unmoved = replace(unmoved, ci95=(0.0, unmoved.ci95[1]), identifiability="not identifiable")
    bare = replace(
        found,
        estimates={**found.estimates, "deep.C20": unmoved},
        correlations=np.full((2, 2), math.nan),
        log=replace(found.log, emulator_error=math.nan),
        goodness=replace(found.goodness, p_value=math.nan),
        notices=(),
    )
    text = text_of([bare], subject)
    assert "no emulator" in text and "not known" in text
    assert "nan" not in text


def test_figures_are_written_and_not_empty(both, tmp_path):
    before = dict(matplotlib.rcParams)
    figures = {"fit": kind_of(both).figure(both)}
    for name, figure in figures.items():
        png, svg = save(figure, tmp_path, name, svg=True)
        image = imread(png)
        assert image.shape[0] > 800 and image[..., :3].std() > 0.05
        assert svg.stat().st_size > 10_000
    assert dict(matplotlib.rcParams) == before


def test_report_folder_is_complete_and_can_be_written_again(tmp_path):
    subject = load_subject(write_subject(tmp_path / "subject"), need_recordings=False)
    measured = measured_curve(depth=4.0)
    results = [result("neo-hookean", measured, subject), result("reduced-polynomial", measured, subject)]
    coarse = PlaneStrainSettings(mesh=SectionMeshSettings(contact_size=3.0, far_size=12.0))
    experiment = plane_strain_test(subject, coarse)
    out = tmp_path / "out"
    for solved in (experiment, None):
        report = write_report(results, out, experiment=solved)
        text = report.read_text()
        assert "*** SIMULATED DATA ***" in text
        assert ("one full solve in addition to the search's 7" in " ".join(text.split())) == (solved is not None)
        listed = [line for line in text.split("Files\n-----\n")[1].splitlines() if line]
        names = {n for line in listed if line[0] != " " for n in line.split(", ") if "." in n}
        there = {path.name for path in out.iterdir()}
        assert {"fit.png", "fit.svg", "section.png", "report.html"} <= names & there
        if solved is not None:
            assert there - {"report.txt"} <= names
        assert ("fields.xdmf" in names) == (solved is not None)
    assert not list(out.glob(".*")), "nothing unfinished is left"


def test_parameters_go_back_to_the_model_in_its_units(both):
    c10 = both[0].estimates["deep.C10"].value
    assert both[0].model_values == {"deep.C10": c10, "deep.C20": 0.0, "deep.D2": math.inf}
    read = {**both[0].values, "instrument.gain": 1.01}
    assert "instrument.gain" not in replace(both[0], values=read).model_values


def written(folder, command, *names):
    """Write a report of a command, with some more files."""
    keep_another(folder, command, "result.json")
    (folder / "result.json").write_text(command)
    with made_in_place(folder) as hidden:
        for name in (*names, "report.txt"):
            (hidden / name).write_text(command)


def test_a_report_of_another_law_or_depth_is_kept_and_said(tmp_path, capsys):
    (tmp_path / "solves").mkdir()
    (tmp_path / "mine.txt").write_text("mine")
    written(tmp_path, "legfem identify --subject 3 --jobs 2", "fit.png", "cost.png")
    written(tmp_path, "legfem identify --subject 3 --quiet", "fit.png", "cost.png")
    assert capsys.readouterr().err == "" and not (tmp_path / "earlier-1").exists()
    written(tmp_path, "legfem identify --subject 3 --depth 10", "fit.png")
    told = capsys.readouterr().err
    assert "legfem identify --subject 3): they are in" in told.replace("\n", " ")
    aside = {path.name: path.read_text() for path in (tmp_path / "earlier-1").iterdir()}
    assert set(aside) == {"fit.png", "cost.png", "report.txt", "result.json"}
    assert all("--quiet" in text for text in aside.values())
    assert "--depth 10" in (tmp_path / "result.json").read_text()
    there = {path.name for path in tmp_path.iterdir()} - {".made-by.json"}
    assert there == {"solves", "mine.txt", "earlier-1", "fit.png", "report.txt", "result.json"}
    # Nothing that such a file names elsewhere is touched.
    (tmp_path / "earlier-1" / ".made-by.json").write_text('{"command": ["legfem"], "files": ["../mine.txt", 3]}')
    written(tmp_path / "earlier-1", "legfem identify --subject 4")
    assert (tmp_path / "mine.txt").read_text() == "mine"
