"""The app in a browser without a network: from the first click to a verdict."""

import json
import shutil
import sys
from pathlib import Path

import browser
import pandas as pd
import pytest
from making_app import MINUTES, accessible, begun, home
from making_specimens import write_bars
from walking import Server, loose_files, walk

from legfem.app.runs import Run, RunState
from legfem.common.errors import InputError
from legfem.common.resources import RESOURCES
from legfem.legs.loading import load_subject
from legfem.legs.schema import subject_entry
from legfem.mechanics.materials import ReducedPolynomial
from legfem.specimens.schema import parse_specimen_file

pytestmark = [pytest.mark.slow, pytest.mark.skipif(browser.browser() is None, reason="no Chromium here")]
LEG = RESOURCES / "dubuis" / "subjects" / "1"


def test_a_folder_is_dropped_previewed_mapped_identified_and_diagnosed(tmp_path):
    server = Server((sys.executable,), tmp_path / "workspace")
    seen = walk(server, browser.browser(), tmp_path)
    assert "Muscle stiffness C10 = 0." in seen["identified"]
    assert "C10 between 0." in seen["diagnosed"], "loading alone leaves what may hide open"
    assert "diagnose-example-leg" in seen["compared"]
    assert "not a plain name" in seen["led out"]
    with pytest.raises(InputError) as refused:
        load_subject(tmp_path / "workspace" / "inputs" / "bad")
    assert seen["bad"] == str(refused.value)
    assert seen["faults"] == []
    assert seen["inaccessible"] == []


def test_two_tabs_change_one_file_and_nothing_is_lost(served, page):
    workspace, address = served
    name = begun(page, "a pressed leg")
    second = page.add_tab()
    page.open(f"{home(address)}input/{name}")
    for tab, key, value in ((0, "title *", "changed here"), (second, "aim_sd_mm", "1.75")):
        page.turn_to(tab)
        page.click("Assumed")
        page.type(key, value)
    path = workspace.input(name) / "subject.toml"
    for tab, seen in ((0, "changed here"), (second, "aim ± 1.75 mm")):
        page.turn_to(tab)
        page.click("Save")
        page.sees(seen)
    given = subject_entry(path).given
    assert (given.title, given.accuracy.aim_sd_mm) == ("changed here", 1.75)

    # The text of a file that another tab changed meanwhile isn't written over it.
    for tab in (0, second):
        page.turn_to(tab)
        page.open(f"{home(address)}input/{name}")
        page.click("Assumed")
        page.click("subject.toml as text")
    page.type("text of the file", path.read_text() + "# mine\n")
    page.click("Save the text")
    page.until("!document.body.innerText.includes('Save the text')")
    page.turn_to(0)
    page.type("text of the file", "nothing")
    page.click("Save the text")
    page.sees("the file was changed elsewhere")
    assert path.read_text().endswith("# mine\n")

    # Both begin the same command: these are two runs.
    for tab in (0, second):
        page.turn_to(tab)
        page.open(f"{home(address)}input/{name}")
        page.click("Run")
        page.sees("Find C10 and C20")
    for tab in (0, second):
        page.turn_to(tab)
        page.click("Run identify")
        page.until("location.pathname.startsWith('/run/')")
        page.click("End at once", "button")
        page.sees("goes on from the finished part")
    runs = [run for run in workspace.runs if run.startswith(f"identify-{name}")]
    assert len(runs) == 2
    assert {Run(workspace.run(run)).state for run in runs} == {RunState.LOST}


def test_wrong_input_is_a_line_each_and_nothing_is_taken_for_a_leg(served, page, tmp_path):
    workspace, address = served
    before = set(workspace.inputs)
    empty, other, foreign = (tmp_path / name for name in ("empty", "other", "foreign"))
    for folder in (empty, other, foreign):
        folder.mkdir()
    page.drop([empty])
    page.sees("the folder is empty")
    assert set(workspace.inputs) == before
    (other / "photo.jpg").write_bytes(b"\xff\xd8\xff")
    page.drop([other])
    page.until("location.pathname === '/input/other'")
    page.sees("nor a recording that can be read")
    # Headers that no program could guess are chosen by hand.
    rows = "".join(f"{0.1 * k:.1f};{0.04 * k:.3f};{0.002 * k * k:.4f}\n" for k in range(200))
    (foreign / "essai.csv").write_text(f"foo;bar;baz\n{rows}")
    page.open(home(address))
    page.sees("Drop a folder here")
    page.drop([foreign])
    page.until("location.pathname === '/input/foreign'")
    page.sees("none of its columns")
    page.click("A leg that was pressed", "button")
    for quantity, column, unit in (("time", "foo", "s"), ("displacement", "bar", "mm"), ("force", "baz", "N")):
        page.choose(f"{quantity}: column", column)
        page.type(f"{quantity}: unit", unit)
    assert accessible(page)


def test_a_run_that_is_refused_says_the_commands_line_and_leaves_its_input(served, page):
    workspace, _ = served
    name = begun(page, "a pressed leg")
    page.click("Run")
    page.type("more options", "--law nonsense")
    page.sees("--law nonsense")
    page.click("Run identify")
    page.sees("'nonsense' is not one of")
    page.sees("once the cause below is corrected")
    run = workspace.runs[0]
    assert run.startswith(f"identify-{name}")
    assert Run(workspace.run(run)).state is RunState.REFUSED
    assert (workspace.input(name) / "subject.toml").is_file()


def ran(page, kind, options, minutes, **fields):
    """Run a command from the page of an input; return its sentence, its report's page seen."""
    page.click("Run")
    page.sees(f"Run {kind}")
    for label, number in fields.items():
        page.type(label, number)
    if options:
        page.type("more options", options)
        page.sees(options)
    assert accessible(page)
    page.click(f"Run {kind}")
    page.until("location.pathname.startsWith('/run/')")
    page.until("!!document.querySelector('iframe.report, .line.refused')", minutes * MINUTES)
    assert accessible(page)
    assert not page.value("document.querySelector('.line.refused')?.innerText")
    return page.value("document.querySelector('.sentence').innerText")


KNOWN = """
[tissues.deep]
C10_kPa = 3.0
[tissues.superficial]
C10_kPa = 4.0
[segment]
from_mm = 40.0
to_mm = 100.0
"""


def test_a_leg_is_dropped_and_its_stocking_run_from_the_app(served, page, tmp_path):
    workspace, _ = served
    leg = tmp_path / "known leg"
    leg.mkdir()
    for name in ("bare.nii.gz", "stocking.csv"):
        shutil.copy(LEG / name, leg)
    scanned = '[compressed]\nscan = "compressed.nii.gz"\n'
    (leg / "leg.toml").write_text((LEG / "leg.toml").read_text().replace(scanned, "") + KNOWN)
    page.drop([leg])
    page.until("location.pathname === '/input/known%20leg'")
    page.sees("Outlines of skin and muscle")
    page.click("Assumed")
    page.sees("Part that is modelled")
    assert accessible(page)
    told = ran(page, "stocking", "", 20, **{"about how many tetrahedra": "8000"})
    found = json.loads((workspace.run("stocking-known leg") / "results" / "result.json").read_text())
    mean = 7.50062 * found["laws"]["neo-hookean"]["pressures"]["mean_interface_kPa"]
    assert f"{mean:.0f} mmHg" in told
    assert 10 < mean < 40


def test_a_plan_is_run_from_the_app(served, page):
    workspace, _ = served
    name = begun(page, "a pressed leg")
    fields = {"expected C10 (kPa)": "0.7", "to press to (mm)": "5"}
    told = ran(page, "plan", "--jobs 1", 40, **fields)
    assert told
    assert (workspace.run(f"plan-{name}") / "results" / "report.html").is_file()


RED = "document.querySelector('.line.refused')?.innerText"
BY = "direction of travel (degrees)"
LENGTH = '[aria-label="cylinder\'s length (mm)"]'


class Counted:
    """A page whose clicks and numbers are counted."""

    def __init__(self, page):
        self.page, self.clicks, self.numbers = page, 0, 0

    def click(self, *what):
        self.clicks += 1
        self.page.click(*what)

    def type(self, label, number):
        self.clicks += 1  # into the field
        self.numbers += 1
        self.page.type(label, number)


def workbook(folder):
    """One Excel file with the trials' first rows as a lab's machine exports them."""
    folder.mkdir()
    trial = load_subject(RESOURCES / "frauziols" / "subjects" / "3").recordings[0]
    columns = {"Zeit [s]": trial.time, "Weg [mm]": trial.displacement, "Kraft [N]": trial.force}
    pd.DataFrame(columns).iloc[: len(trial.time) // 2 : 2].to_excel(folder / "left calf.xlsx", index=False)
    return folder / "left calf.xlsx"


def test_excel_girth_and_fat_lead_to_a_verdict_in_eight_clicks_and_six_numbers(served, page, tmp_path):
    workspace, _ = served
    user = Counted(page)
    page.drop([workbook(tmp_path / "data")])
    page.sees("What is it?")
    assert not page.value(RED)
    user.click("A leg that was pressed", "button")
    for label, number in (
        ("girth there (mm)", "365"),
        ("skin and fat where it is pressed (mm)", "9"),
        ("diameter (mm)", "30"),
        ("cylinder's length (mm)", "50"),
    ):
        user.type(label, number)
    assert accessible(page)
    user.click("How stiff, and can I trust it?")
    page.until("location.pathname.startsWith('/run/identify-')")
    page.sees("How stiff?")
    page.sees("begins when the run before it is done")
    page.until("document.querySelectorAll('iframe.report').length === 2", 60 * MINUTES)
    assert not page.value(RED)
    assert user.clicks <= 8 and user.numbers <= 6
    stiff, trusted = page.value("[...document.querySelectorAll('.sentence')].map((one) => one.innerText)")
    assert "C10 = " in stiff and "C10 " in trusted
    section = subject_entry(workspace.input(workspace.inputs[0]) / "subject.toml").given.section
    assert (section.girth_mm, section.fat_mm, section.contours) == (365.0, 9.0, None)
    assert accessible(page)


@pytest.fixture
def without_lab(served):
    """Take the lab's file away afterwards."""
    yield
    served[0].lab.unlink(missing_ok=True)


@pytest.mark.usefixtures("without_lab")
def test_a_leg_with_contours_is_described_by_a_click_on_its_section(served, page, tmp_path):
    workspace, _ = served
    page.drop([loose_files(tmp_path)])
    page.until("location.pathname.startsWith('/input/my%20leg')")
    page.sees("Where was it pressed?")
    assert not page.value(RED)
    page.click("Only save this")
    page.sees("diameter (mm), cylinder's length (mm): missing")
    page.type("diameter (mm)", "30")
    page.type("cylinder's length (mm)", "50")
    page.click("Only save this")
    page.sees("click the section where the skin was pressed")
    page.click_at(".aim", 0.5, 0.95)
    page.until(f"document.querySelector('[aria-label={json.dumps(BY)}]').value !== ''")
    assert accessible(page)
    page.click("keep indenter and instrument for further legs (lab.toml)", ".q-checkbox")
    page.click("Only save this")
    page.sees("Is this what you measured?")
    assert not page.value(RED)
    found = load_subject(workspace.input(workspace.inputs[0]))
    # From behind: the picture's lower edge.
    assert abs(found.indenter.direction_deg - 90.0) < 10.0
    assert abs(found.indenter.aim[0]) < 10.0 and found.indenter.aim[1] < -50.0

    # The next leg of the lab begins with the same rig, and its own file doesn't state the instrument.
    page.open(home(served[1]))
    page.sees("Drop a folder here")
    second = tmp_path / "second"
    second.mkdir()
    page.drop([loose_files(second)])
    page.sees("As lab.toml states it.")
    page.until("document.querySelector('[aria-label=\"diameter (mm)\"]').value === '30'")
    page.click_at(".aim", 0.5, 0.95)
    page.until(f"document.querySelector('[aria-label={json.dumps(BY)}]').value !== ''")
    page.click("Only save this")
    page.sees("Is this what you measured?")
    path = workspace.input(workspace.inputs[0]) / "subject.toml"
    assert "[instrument]" not in path.read_text()
    assert load_subject(path.parent).instrument.force_sd == found.instrument.force_sd


def test_a_leg_that_a_ball_pressed_is_dropped_and_described(served, page, tmp_path):
    workspace, _ = served
    page.drop([loose_files(tmp_path)])
    page.sees("Where was it pressed?")
    page.choose("what pressed it", "a ball")
    hidden = f"document.querySelector({json.dumps(LENGTH)}).offsetParent"
    page.until(f"{hidden} === null")
    page.type("diameter (mm)", "30")
    page.click_at(".aim", 0.5, 0.95)
    page.until(f"document.querySelector('[aria-label={json.dumps(BY)}]').value !== ''")
    page.click("Only save this")
    page.sees("Is this what you measured?")
    given = subject_entry(workspace.input(workspace.inputs[0]) / "subject.toml").given
    assert (given.indenter.shape, given.indenter.length_mm) == ("ball", None)


def test_a_study_of_all_legs_is_run_and_its_table_downloaded(served, page):
    workspace, address = served
    for name in workspace.inputs:
        workspace.delete("inputs", name)
    for _ in range(2):
        name = begun(page, "a pressed leg")
        folder = workspace.input(name)
        for trial in sorted((folder / "recordings").iterdir())[1:]:
            trial.unlink()
        page.open(home(address))
        page.sees("Drop a folder here")
    page.click("A study of several legs")
    page.sees("2 legs or visits of 2 people")
    assert accessible(page)
    pasted = "folder\tsubject\tside\nexample-leg\tP01\tleft\nexample-leg-2\tP01\t"
    page.type("table of the study", f"{pasted}rihgt\n")
    page.sees("side is neither left nor right")
    page.type("table of the study", f"{pasted}right\n")
    page.sees("2 legs or visits of 1 person")
    page.click("Run the study")
    page.until("location.pathname.startsWith('/run/study')")
    page.until("!!document.querySelector('iframe.report')", 40 * MINUTES)
    table = page.value(
        "fetch([...document.querySelectorAll('a')].find((one) => one.innerText === 'Table as CSV').href)"
        ".then((answer) => answer.text())"
    )
    assert len(table.strip().splitlines()) == 3
    assert "example-leg-2" in table and "P01" in table
    assert accessible(page)
    page.click("change the study's table, and go on")
    page.sees("Go on with this table")


def test_an_input_is_renamed_deleted_and_put_back(served, page):
    workspace, _ = served
    name = begun(page, "a pressed leg")
    page.click("Files", ".q-tab")
    page.sees("can be put back")
    page.type("name", "other calf")
    page.click("Rename")
    page.until("location.pathname === '/input/other%20calf'")
    page.sees("Is this what you measured?")
    assert "other calf" in workspace.inputs and name not in workspace.inputs
    page.click("Files", ".q-tab")
    page.sees("can be put back")
    assert accessible(page)
    page.click("Delete", "button")
    page.until("location.pathname === '/'")
    page.sees("other calf is deleted.")
    assert accessible(page)
    page.click("Undo", "button")
    page.until("location.pathname === '/input/other%20calf'")
    assert "other calf" in workspace.inputs
    page.sees("Is this what you measured?")
    page.click("Files", ".q-tab")
    page.click("Delete", "button")
    page.until("location.pathname === '/'")
    page.open(home(served[1]))
    page.click("Deleted")
    page.click("Put back", "button")
    page.until("location.pathname === '/input/other%20calf'")
    assert "other calf" in workspace.inputs


def test_recordings_of_specimens_are_dropped_described_and_identified(served, page, tmp_path):
    workspace, _ = served
    bars = write_bars(tmp_path / "bars", ReducedPolynomial(5e-3, 1.0, 3e-3, float("inf")))
    (bars / "specimen.toml").unlink()
    page.drop([bars])
    page.until("location.pathname === '/input/bars'")
    page.sees("What is it?")
    page.click("Specimens in a lab's test", "button")
    assert accessible(page)
    page.choose("what was done", "a bar pulled or pressed along its length")
    page.choose("direction *", "compression")
    page.type("length_mm *", "10")
    page.click("Only save this")
    page.sees("area_mm2: is missing")
    page.type("area_mm2 *", "100")
    page.click("Only save this")
    page.sees("measured data")
    given = parse_specimen_file(workspace.input("bars") / "specimen.toml")
    assert (given.uniaxial.length_mm, given.uniaxial.area_mm2) == (10.0, 100.0)
    page.click("Assumed")
    page.sees("Test: a bar")
    assert accessible(page)
    told = ran(page, "identify", "--law reduced-polynomial --jobs 1", 60)
    assert "C10 = " in told
    assert Path(workspace.run("identify-bars") / "results" / "report.html").is_file()
