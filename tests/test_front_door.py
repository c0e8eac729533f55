"""``import legfem as lf``: quick to import, and a result that can be read, drawn and written."""

from __future__ import annotations

import ast
import contextlib
import doctest
import importlib
import inspect
import json
import pydoc
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
import typer
from making_diagnosed import diagnosed
from making_identification import identify as fits
from making_identification import pressed_leg

import legfem as lf
import legfem.__main__ as front
from legfem.common.errors import InputError
from legfem.inverse.plan import Design, DesignValue
from legfem.legs.forward import PlaneStrainForward
from legfem.legs.schema import SUBJECTS
from legfem.legs.subject import SitedLeg
from legfem.report.page import command_line

ROOT = Path(__file__).resolve().parents[1]


@pytest.fixture(scope="module")
def subject():
    return lf.load_subject("3")


def test_importing_legfem_imports_nothing_that_is_slow() -> None:
    code = "import sys, legfem; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    loaded = set(done.stdout.split())
    assert "legfem" in loaded
    assert not loaded & {"numpy", "scipy", "pandas", "matplotlib", "dolfinx", "ufl", "gmsh"}


def test_the_door_leads_to_all_it_names() -> None:
    for name in lf.__all__:
        assert getattr(lf, name) is not None
    assert lf.__version__ in (ROOT / "pyproject.toml").read_text()
    assert dir(lf) == lf.__all__
    with pytest.raises(AttributeError, match="no attribute 'identity'"):
        lf.identity  # noqa: B018


@pytest.mark.parametrize("name", ["identify", "diagnose", "plan", "stocking", "cohort"])
def test_a_function_stays_one_beside_the_module_of_its_name(name: str) -> None:
    import legfem.api

    module = importlib.import_module(f"legfem.{name}")
    function = getattr(lf, name)
    assert inspect.isfunction(function) and inspect.ismodule(module)
    assert inspect.signature(function) == inspect.signature(getattr(legfem.api, name))


def test_from_a_room_modules_are_imported_whatever_function_has_its_name() -> None:
    from legfem.cohort import agreement

    assert inspect.ismodule(agreement) and inspect.isfunction(lf.cohort)


FUNCTIONS = [name for name in lf.__all__ if inspect.isfunction(getattr(lf, name))]


@pytest.mark.parametrize("name", FUNCTIONS)
def test_help_shows_arguments_and_an_example_that_the_function_would_take(name: str) -> None:
    """What loads is run; what computes is only called as its signature has it."""
    function = getattr(lf, name)
    shown = pydoc.render_doc(function, renderer=pydoc.plaintext)
    assert all(f"{argument}:" in shown for argument in inspect.signature(function).parameters)
    lines = [line.source for line in doctest.DocTestParser().get_examples(function.__doc__)]
    assert lines[0] == "import legfem as lf\n" and f"lf.{name}(" in "".join(lines)
    for call in (node for node in ast.walk(ast.parse("".join(lines))) if isinstance(node, ast.Call)):
        match call.func:
            case ast.Attribute(ast.Name("lf"), called):
                inspect.signature(getattr(lf, called)).bind(*call.args, **{one.arg: one.value for one in call.keywords})
    if name in ("load_leg", "load_specimen", "load_subject"):
        names: dict[str, object] = {}
        with contextlib.chdir(ROOT):
            exec("".join(lines), names)


def test_a_leg_a_section_and_a_recording_show_themselves_in_a_line_and_a_picture(subject) -> None:
    extents = {subject: len(subject.recordings) + 1, subject.section: 1, subject.recordings[0]: 1}
    for shown, pictures in extents.items():
        assert len(repr(shown)) < 200 and "\n" not in repr(shown)
        page = ElementTree.fromstring(f"<div>{shown._repr_html_()}</div>")
        assert len(page.findall(".//svg")) == pictures
        points = [
            float(x) for line in page.iter("polyline") for pair in line.get("points").split() for x in pair.split(",")
        ]
        assert min(points) >= 0.0 and max(points) <= 200.0, "within the frame"
        assert len(shown._repr_html_()) < 20_000
    assert "reconstructed" in repr(subject)
    section = ElementTree.fromstring(f"<div>{subject.section._repr_html_()}</div>")
    drawn = [
        np.array([pair.split(",") for pair in line.get("points").split()], dtype=float)
        for line in section.iter("polyline")
    ]
    parts = [subject.section.contour(part) for part in ("skin", "fascia", "tibia", "fibula")]
    for line, contour in zip(drawn, parts, strict=True):
        ratios = np.ptp(line, axis=0) / np.ptp(contour, axis=0)
        assert ratios[0] == pytest.approx(ratios[1], rel=0.02), "to scale"
    trial = replace(subject.recordings[0], trial="<i>1</i>")
    assert "<i>" not in trial._repr_html_()


def test_sites_and_specimens_show_themselves_too(subject) -> None:
    sited = SitedLeg("legs", "two <sites>", (subject, subject), subject.directory)
    assert repr(sited) == "<SitedLeg: two <sites>, reconstructed>"
    assert sited._repr_html_().count("<svg") == 2 * (len(subject.recordings) + 1)
    specimens = lf.load_specimen(ROOT / "examples" / "specimen")
    assert specimens._repr_html_().count("<svg") == len(specimens.recordings)
    assert len(repr(specimens)) < 200 and len(repr(lf.load_leg("1"))) < 200


def options_of(command: typer.Typer) -> set[str]:
    """Return the names of a command's options, as its function has them."""
    (only,) = command.registered_commands
    return set(inspect.signature(only.callback).parameters) - {"context"}


def test_the_command_and_the_function_take_the_same() -> None:
    """What one has the other has: the folder is the first argument, and progress is what isn't quiet."""
    from legfem.commands import cohort, diagnose, identify, plan, stocking

    not_asked = {"subject", "subject_dir", "specimen_dir", "quiet", "as_json"}
    for command, call, of_command, of_python in (
        (identify, lf.identify, set(), {"settings", "mesh", "comm"}),
        (diagnose, lf.diagnose, set(), set()),
        # What it solves it keeps in the library; ``write`` takes the folder for results.
        (plan, lf.plan, {"out"}, set()),
        (stocking, lf.stocking, set(), {"comm"}),
        (cohort, lf.cohort, set(), set()),
    ):
        given = list(inspect.signature(call).parameters)
        options, keywords = options_of(command.app), set(given[1:])
        assert given[0] == ("folder" if command is cohort else "leg")
        assert options - keywords - {"folder"} == (options & not_asked) | of_command
        assert keywords - options == {"progress", *of_python}


def test_a_report_repeats_the_command_as_it_was_typed(monkeypatch: pytest.MonkeyPatch) -> None:
    said = []
    monkeypatch.setattr(sys, "argv", ["/usr/bin/legfem", "identify", "--subject", "3"])
    monkeypatch.setattr(front, "command", lambda name, module: said.append(command_line()))
    front.main()
    assert said == ["legfem identify --subject 3"]


def test_a_subject_is_known_by_its_id_or_its_folder(subject) -> None:
    again = lf.load_subject(SUBJECTS.find("3"))
    assert (subject.id, subject.directory) == ("3", again.directory) == ("3", lf.load_subject(3).directory)
    with pytest.raises(lf.InputError, match="7: subject: not found; give one of 1, 2, 3, 4"):
        lf.load_subject(7)
    assert len(subject.recordings) == len(again.recordings) == 3


@pytest.mark.parametrize("load", [lf.load_subject, lf.load_leg])
def test_a_subject_that_is_not_there_is_told_in_one_line(load, tmp_path: Path) -> None:
    with pytest.raises(lf.InputError, match=r"give one of 1, 2, 3, 4.*path of a folder"):
        load("none")
    with pytest.raises(InputError, match="not found"):
        load(tmp_path / "nowhere")


def test_an_unknown_law_is_told_in_one_line(subject) -> None:
    with pytest.raises(InputError, match="reduced-polynomial or both"):
        lf.identify(subject, law="Ogden")


def test_an_identified_leg_can_be_read_drawn_and_written(tmp_path: Path) -> None:
    leg = pressed_leg(tmp_path / "leg", 0.7, 0.8)
    laws = ("neo-hookean", "reduced-polynomial")
    found = lf.Identification(leg, tuple(fits(leg, laws=laws)))
    assert found["neo-hookean"].law == "neo-hookean"
    assert "C10 of the deep tissue (muscle), neo-Hookean law" in found.summary()
    assert "SIMULATED DATA" in found.summary()
    frame = found.to_frame()
    assert list(frame["law"]) == [laws[0], laws[1], laws[1]]
    assert list(frame["parameter"]) == ["c10_deep", "c10_deep", "c20_deep"]
    assert (frame["low"] < frame["value"]).all() and (frame["value"] < frame["high"]).all()
    assert set(frame["unit"]) == {"kPa"}
    assert frame["value"][1] == found[laws[1]].estimates["deep.C10"].shown.value
    one = lf.Identification(leg, found.fits[:1])
    assert one.write(tmp_path / "out") == tmp_path / "out" / "report.txt"
    assert one.document() == json.loads((tmp_path / "out" / "result.json").read_text())
    page = found._repr_html_()
    assert "simulated data" in page and "c20_deep" in page
    assert page.count("<iframe") == 1 and "&lt;!DOCTYPE html&gt;" in page
    assert "data-plot=&quot;fit&quot;" in page, "curves that are switched on and off"


def test_a_diagnosed_leg_can_be_read_drawn_and_written(subject, tmp_path: Path) -> None:
    found = lf.Diagnosed(subject, diagnosed({"contact-onset.offset": 0.3}, asked=("contact-onset", "force-drift")), 1.0)
    assert found.verdict == found.diagnosis.verdict == "named"
    assert "Verdict: NAMED" in found.summary() and "Which physics" in found.summary()
    frame = found.to_frame()
    assert set(frame["model"]) == {"before repair", "after repair"}
    after = frame[frame["model"] == "after repair"].set_index("parameter")
    assert after.loc["c10_deep", "low"] < 1.0 < after.loc["c10_deep", "high"]
    assert "contact-onset.offset" in after.index
    assert found.write(tmp_path).is_file()
    assert json.loads((tmp_path / "diagnosis.json").read_text())["verdict"] == "named"
    assert "data-plot=&quot;recording" in found._repr_html_()


def test_a_coarse_mesh_is_for_a_quick_look(subject, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is solved here: the forward model tells what it would solve with."""
    asked = []
    ended = RuntimeError("enough")

    def of_subject(given, depth, settings=None):
        asked.append((given.id, depth, settings))
        raise ended

    monkeypatch.setattr(PlaneStrainForward, "of_subject", of_subject)
    for mesh in ("coarse", None):
        with pytest.raises(RuntimeError, match="enough"):
            lf.identify(subject, depth=12.0, mesh=mesh)
    (_, depth, coarse), (_, _, default) = asked
    assert depth == pytest.approx(12.0, abs=0.3) and default is None
    assert coarse.mesh.contact_size > 1.5 * subject_mesh_size()


def subject_mesh_size() -> float:
    from legfem.meshing.section import SectionMeshSettings

    return SectionMeshSettings().contact_size


def test_an_ambiguous_diagnosis_is_written_with_the_next_tests_ranked(subject, tmp_path: Path) -> None:
    """As the command writes it."""
    asked = ("fascia-stiffness", "prestress", "force-drift")
    made = diagnosed({"fascia-stiffness.factor": 4.0}, asked=asked)
    best = DesignValue(Design("hold it", ()), {("fascia-stiffness", "prestress"): 0.9}, 0.9)
    found = lf.Diagnosed(subject, made, 1.0, (best,))
    report = found.write(tmp_path).read_text()
    assert "Hold it: 90 % chance of distinguishing the candidates" in " ".join(report.split())
    (first,) = json.loads((tmp_path / "diagnosis.json").read_text())["next_experiment_ranked"]
    assert first["test"] == "hold it" and first["chance"] == 0.9
    assert "hold it" in found.summary().lower()
