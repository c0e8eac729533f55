"""A leg's folder that an instrument fills: what is seen of its files, what is said of each trial and of all."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from making import TOML, press, tissue_force, write_recording, write_subject
from making_diagnosed import diagnosed
from making_diagnosis import ramps, two_rates
from typer.testing import CliRunner

from legfem.api import live
from legfem.api.live import Visit, answer_lines, follow, visit_of
from legfem.api.results import Diagnosed
from legfem.commands.live import app
from legfem.common.command_line import BAD_INPUT, INTERRUPTED
from legfem.common.errors import InputError, UnsolvedError
from legfem.common.progress import Deadline
from legfem.data.reader import SETTLED_S, STALLED_S, Watched, changes, looked
from legfem.inverse.verdict import Diagnosis
from legfem.legs.plan import bought_in_visit
from legfem.legs.schema import SUBJECTS, SubjectFile
from legfem.legs.subject import Subject

ONE, OTHER = Path("trial1.csv"), Path("trial2.csv")
WANTED = "wanted = {{ C10_percent = {} }}\n"


# --- files, by a clock that is moved by hand ---


def unreadable(path: Path) -> None:
    raise InputError(path, "row 7", "has two cells", "give three")


def states(*looks: tuple[float, dict[Path, tuple[int, int]]], read: Callable[[Path], None] = str) -> list[dict]:
    """Return the changes at looks, each a time and the stamps of the files that are there."""
    told, before = [], {}
    for now, there in looks:
        after: Watched = looked(before, there, now, read)
        told.append({path.stem: state for path, state in changes(before, after).items()})
        before = after
    return told


def test_a_file_is_complete_once_it_has_stood_still_and_is_told_of_once():
    grows = [(0.0, {ONE: (1, 0)}), (1.0, {ONE: (2, 1)}), (2.5, {ONE: (3, 2)}), (4.0, {ONE: (3, 2)})]
    stands = [(4.5, {ONE: (3, 2)}), (60.0, {ONE: (3, 2)})]
    appeared, growing, complete = ({"trial1": state} for state in ("appeared", "growing", "complete"))
    assert states(*grows, *stands) == [appeared, growing, {}, {}, complete, {}]
    assert SETTLED_S == 2.0


def test_a_half_written_file_is_waited_for_and_one_that_stands_still_is_stalled_once():
    half = [(t, {ONE: (1, 0)}) for t in (0.0, 3.0, 9.9)]
    told = states(*half, (STALLED_S, half[0][1]), (30.0, half[0][1]), (31.0, {ONE: (2, 1)}), read=unreadable)
    assert told == [{"trial1": "appeared"}, {}, {}, {"trial1": "stalled"}, {}, {"trial1": "growing"}]


def test_why_a_stalled_file_cannot_be_read_is_kept():
    before = looked({}, {ONE: (1, 0)}, 0.0, unreadable)
    assert "has two cells" in looked(before, {ONE: (1, 0)}, STALLED_S, unreadable)[ONE].trouble


def test_a_whole_file_that_is_written_again_or_deleted_is_told_of():
    both = {ONE: (1, 0), OTHER: (1, 0)}
    again = {ONE: (1, 5), OTHER: (1, 0)}
    told = states((0.0, both), (2.0, both), (5.0, again), (5.5, {ONE: (2, 6), OTHER: (1, 0)}), (6.0, {ONE: (2, 6)}))
    assert told[1:] == [{"trial1": "complete", "trial2": "complete"}, {"trial1": "replaced"}, {}, {"trial2": "gone"}]
    assert states((0.0, {ONE: (1, 0)}), (1.0, {}), (2.0, {}), (3.0, {ONE: (1, 0)})) == [
        {"trial1": "appeared"},
        {"trial1": "gone"},
        {},
        {"trial1": "appeared"},
    ]


# --- trials of a leg ---


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A leg's folder without recordings."""
    made = write_subject(tmp_path / "leg")
    shutil.rmtree(made / "recordings")
    return made


def record(folder: Path, name: str, times: float = 1.0, seed: int = 0, **how: float) -> Path:
    """Write a trial, whose force is so many times a leg's."""
    made = press(force_sd=0.03, displacement_sd=0.02, seed=seed, **how)
    stiffer = replace(made, force=made.force + (times - 1.0) * tissue_force(made.displacement))
    path = folder / "recordings" / f"{name}.csv"
    path.parent.mkdir(exist_ok=True)
    return write_recording(path, stiffer)


def settled(visit: Visit, at: float) -> list[str]:
    """Return what is said at three looks, between which files stand still."""
    return [line for now in (at, at + SETTLED_S, at + SETTLED_S + 0.5) for line in visit.look(now)]


def trials(visit: Visit) -> list[str]:
    return [] if visit.subject is None else [one.trial for one in visit.subject.recordings]


def test_each_trial_is_judged_once_beside_those_before(folder):
    visit = visit_of(folder)
    assert settled(visit, 0.0) == [] and visit.settled and visit.subject is None
    record(folder, "trial1")
    first = settled(visit, 10.0)
    assert first[0] == "trial1.csv: usable, grade A" and trials(visit) == ["trial1"]
    assert re.search(r"first contact at the start.*; 20.0 mm deep$", first[1])
    one = visit.subject
    assert settled(visit, 15.0) == [] and visit.subject is one
    record(folder, "trial2", times=1.2, seed=1)
    second = settled(visit, 20.0)
    assert second[0] == "trial2.csv: usable, grade A" and trials(visit) == ["trial1", "trial2"]
    assert float(re.search(r"at (?:19.9|20) mm ([\d.]+) times", second[1])[1]) == pytest.approx(1.2, abs=0.01)


def test_a_trial_that_cannot_be_used_says_why_and_does_not_count(folder):
    visit = visit_of(folder)
    record(folder, "trial1")
    settled(visit, 0.0)
    leg = visit.subject
    record(folder, "short", depth=2.0, seed=1)
    (line,) = settled(visit, 10.0)
    assert line.startswith("short.csv: NOT USABLE: ") and "mm of loading after contact are too short" in line
    shutil.copy(folder / "recordings" / "trial1.csv", folder / "recordings" / "trial2.csv")
    (line,) = settled(visit, 20.0)
    assert line.startswith("trial2.csv: NOT USABLE: ") and "copy" in line
    assert visit.subject is leg


def test_what_is_doubtful_is_told_with_the_trial_that_brought_it(folder):
    visit = visit_of(folder)
    record(folder, "trial1")
    assert not any("DOUBTFUL" in line for line in settled(visit, 0.0))
    record(folder, "trial2", times=2.0, seed=1)
    assert any("DOUBTFUL INPUT" in line and "is not a repeat" in line for line in settled(visit, 10.0))
    record(folder, "trial3", times=2.0, seed=2)
    assert not any("trial2.csv" in line for line in settled(visit, 20.0))


def test_what_was_refused_beside_a_trial_counts_once_that_is_deleted(folder):
    visit = visit_of(folder)
    wrong = record(folder, "trial1")
    settled(visit, 0.0)
    shutil.copy(wrong, wrong.with_name("trial2.csv"))
    assert any("trial2.csv: NOT USABLE" in line for line in settled(visit, 10.0))
    wrong.unlink()
    said = settled(visit, 20.0)
    assert said[0].startswith("trial1.csv was deleted") or said[-1].startswith("trial1.csv was deleted")
    assert any("trial2.csv: usable" in line for line in said) and trials(visit) == ["trial2"]


def test_a_trial_that_is_replaced_counts_again_once_it_is_whole(folder):
    visit = visit_of(folder)
    record(folder, "trial1")
    settled(visit, 0.0)
    before = visit.subject
    record(folder, "trial1", times=1.1, seed=5)
    assert visit.look(10.0) == ["trial1.csv is written again: the answer is made anew once it is whole"]
    assert visit.subject is None and not visit.settled
    assert settled(visit, 11.0)[0] == "trial1.csv: usable, grade A"
    assert visit.subject is not None and visit.subject is not before


def test_a_half_written_file_is_never_refused_and_is_said_to_stand_still(folder):
    visit = visit_of(folder)
    whole = record(folder, "trial1").read_text()
    half = folder / "recordings" / "trial1.csv"
    # As a buffer of so many bytes is written.
    half.write_text(whole[: len(whole) // 2].rpartition(",")[0])
    assert [visit.look(now) for now in (0.0, 3.0, 6.0, 9.5)] == [[]] * 4
    (line,) = visit.look(STALLED_S)
    assert line.startswith("trial1.csv has stood still for 10 s and can't be read; does the instrument still write?")
    assert visit.look(30.0) == []
    half.write_text(whole)
    assert settled(visit, 40.0)[0] == "trial1.csv: usable, grade A"


# --- all so far ---


def answered(leg: Subject, **_: object) -> Diagnosed:
    """Return a made-up diagnosis of a leg."""
    return Diagnosed(leg, diagnosed({"fascia-stiffness.factor": 4.0}, asked=("fascia-stiffness", "force-drift")), 0.0)


def leg_of(folder: Path, names: tuple[str, ...]) -> Subject:
    visit = visit_of(folder)
    for seed, name in enumerate(names):
        record(folder, name, seed=seed)
    settled(visit, 0.0)
    assert visit.subject is not None
    return visit.subject


def given(folder: Path) -> SubjectFile:
    return visit_of(folder).entry.given


def test_a_trial_is_judged_once_whatever_else_is_written(folder, monkeypatch):
    judged, with_trials = [], live.with_trials
    monkeypatch.setattr(live, "with_trials", lambda *given: judged.append(len(given[2])) or with_trials(*given))
    visit = visit_of(folder)
    for k in range(3):
        record(folder, f"trial{k + 1}", seed=k)
        settled(visit, 10.0 * k)
    (folder / "recordings" / "trial4.csv").write_text("time_s,displacement_mm,force_N\n0.0,")
    settled(visit, 40.0)
    assert judged == [1, 2, 3] and trials(visit) == ["trial1", "trial2", "trial3"]


def next_lines(lines: list[str]) -> list[tuple[str, int, int]]:
    """Return what further trials are told to buy: what to do, and C10's error before and after."""
    found = (re.fullmatch(r"next: (.*): C10 ± (\d+) % -> ± (\d+) %", line) for line in lines)
    return [(one[1], int(one[2]), int(one[3])) for one in found if one]


def test_the_answer_has_the_finding_and_what_another_trial_would_buy(folder):
    one = leg_of(folder, ("trial1",))
    lines = answer_lines(answered(one), one, given(folder))
    assert lines[0].startswith("by trial1: ") and "C10" in lines[0]
    ((todo, before, after),) = next_lines(lines)
    assert todo == "press again" and 0 < after <= before
    assert "how tissue relaxes" in lines[-1] and "weighed" not in lines[-1]
    two = leg_of(folder, ("trial1", "trial2"))
    assert answer_lines(answered(two), two, given(folder))[0].startswith("by trial1, trial2: ")


def test_what_was_done_already_is_not_asked_for_again(folder):
    leg = leg_of(folder, ("trial1",))
    for recordings, there in ((ramps(), True), (two_rates(), False)):
        found = diagnosed({}, recordings, asked=("fascia-stiffness", "force-drift"))
        asked = bought_in_visit(found, leg, ["rates"])
        assert "press again" in asked and any("mm/s" in one for one in asked) is there


def test_what_a_visit_allows_is_told_the_best_first(folder):
    (folder / "subject.toml").write_text('can = ["hold", "rates", "skin_profile"]\n' + TOML)
    leg = leg_of(folder, ("trial1", "trial2"))
    told = next_lines(answer_lines(answered(leg), leg, given(folder)))
    assert {todo.split()[0] for todo, _, _ in told} == {"press", "hold"} and len(told) == 3
    assert [after for _, _, after in told] == sorted(after for _, _, after in told)
    (folder / "subject.toml").write_text('can = ["fly"]\n' + TOML)
    with pytest.raises(InputError, match="can"):
        visit_of(folder)


@pytest.mark.parametrize(("percent", "enough"), [(0.5, False), (99.0, True)])
def test_what_is_wanted_is_enough_or_how_far_it_is(folder, percent, enough):
    (folder / "subject.toml").write_text(WANTED.format(percent) + TOML)
    leg = leg_of(folder, ("trial1", "trial2"))
    lines = answer_lines(answered(leg), leg, given(folder))
    if enough:
        assert re.fullmatch(r"enough: C10 [\d.]+ kPa ± \d+ %", lines[-1])
    else:
        assert any(re.fullmatch(r"± \d+ % of 0.5 % wanted", line) for line in lines)
        assert next_lines(lines)
    (folder / "subject.toml").write_text(TOML)
    plain = answer_lines(answered(leg), leg, given(folder))
    assert not any("wanted" in line or "enough" in line for line in plain) and next_lines(plain)


def test_a_provisional_answer_is_enough_only_so_far(folder, monkeypatch):
    (folder / "subject.toml").write_text(WANTED.format(99.0) + TOML)
    leg = leg_of(folder, ("trial1", "trial2"))
    monkeypatch.setattr(Diagnosis, "weighed", (7, 22))
    found = answered(leg)
    lines = answer_lines(replace(found, diagnosis=replace(found.diagnosis, provisional=True)), leg, given(folder))
    assert "Provisional: 7 of 22 effects weighed" in lines[0]
    assert any(line.startswith("so far enough: C10 ") for line in lines) and next_lines(lines)
    assert "not weighed yet" in lines[-1]


@pytest.mark.parametrize("wrong", ["0", "-5", "101", '"ten"'])
def test_what_can_not_be_wanted_is_refused(folder, wrong):
    (folder / "subject.toml").write_text(WANTED.format(wrong) + TOML)
    with pytest.raises(InputError, match=r"wanted\.C10_percent"):
        visit_of(folder)


def test_answers_are_made_until_all_that_is_there_was_answered_once(folder, monkeypatch):
    monkeypatch.setattr(live, "LOOK_S", 0.05)
    record(folder, "trial1")
    said, found = [], []
    follow(visit_of(folder), answered, said.extend, found.append, 15.0, once=True)
    assert said[0] == f"waiting for recordings in {folder / 'recordings'}"
    assert len(found) == 1 and sum(line.startswith("by trial1: ") for line in said) == 1


class EndsError(Exception):
    """As Ctrl-C."""


def test_an_answer_is_made_again_after_a_change_and_ctrl_c_ends_the_watch(folder, monkeypatch):
    monkeypatch.setattr(live, "LOOK_S", 0.05)
    one, said = record(folder, "trial1"), []
    record(folder, "trial2", seed=1)
    asked = []

    def diagnose(leg: Subject, within: Deadline) -> Diagnosed:
        asked.append([trial.trial for trial in leg.recordings])
        if len(asked) == 2:
            raise EndsError
        one.unlink()
        while visit.subject is leg:
            time.sleep(0.01)
        assert within.passed, "there is no use in going on by a trial that is gone"
        return answered(leg)

    before, visit = threading.active_count(), visit_of(folder)
    with pytest.raises(EndsError):
        follow(visit, diagnose, said.extend, lambda _: None, 15.0)
    assert asked == [["trial1", "trial2"], ["trial2"]]
    assert "trial1.csv was deleted: the answer is made without it" in said
    assert not any(line.startswith("by ") for line in said), "of a trial that is gone"
    assert threading.active_count() == before


def test_answers_come_at_once_then_more_rarely_until_none_is_provisional(folder, monkeypatch):
    monkeypatch.setattr(live, "LOOK_S", 0.05)
    record(folder, "trial1")
    left, told = [], []

    def diagnose(leg: Subject, within: Deadline) -> Diagnosed:
        left.append(within.at - time.monotonic())
        found = answered(leg)
        return replace(found, diagnosis=replace(found.diagnosis, provisional=len(left) < 4))

    def answer(found: Diagnosed) -> None:
        told.append(found.diagnosis.provisional)
        if not told[-1]:
            raise EndsError

    with pytest.raises(EndsError):
        follow(visit_of(folder), diagnose, lambda _: None, answer, 15.0)
    assert left == pytest.approx([0.0, 15.0, 30.0, 60.0], abs=1.0)
    assert told == [True, False], "what says the same is not told again"


def test_a_leg_that_cannot_be_solved_is_said_and_watching_goes_on(folder, monkeypatch):
    monkeypatch.setattr(live, "LOOK_S", 0.05)
    record(folder, "trial1")
    said, asked = [], []

    def diagnose(leg: Subject, within: Deadline) -> Diagnosed:
        asked.append(len(leg.recordings))
        if len(asked) > 1:
            raise EndsError
        record(folder, "trial2", seed=1)
        raise UnsolvedError("the model stops before 20.0 mm")

    with pytest.raises(EndsError):
        follow(visit_of(folder), diagnose, said.extend, lambda _: None, 15.0)
    assert asked == [1, 2] and "no answer by these trials: the model stops before 20.0 mm" in said
    with pytest.raises(UnsolvedError):
        asked.clear()
        follow(visit_of(folder), diagnose, said.extend, lambda _: None, 15.0, once=True)


# --- the command ---


def ran(*words: object) -> tuple[int, str]:
    done = CliRunner().invoke(app, list(map(str, words)))
    assert done.exception is None or isinstance(done.exception, SystemExit), done.exception
    return done.exit_code, done.output


@pytest.mark.parametrize("what", ["nowhere", "empty", "broken", "time"])
def test_a_wrong_folder_or_time_is_one_line(tmp_path, folder, what):
    (tmp_path / "empty").mkdir()
    if what == "broken":
        (folder / "subject.toml").write_text(TOML.replace("diameter_mm = 30.0", "diameter_mm = 0.03"))
    words = [folder, "--for", "soon"] if what == "time" else [folder if what == "broken" else tmp_path / what]
    status, output = ran(*words, "--once", "--out", tmp_path / "out")
    assert status == BAD_INPUT and output.count("\n") == 1
    assert not (tmp_path / "out").exists()


def test_a_folder_without_recordings_waits_and_says_so(tmp_path, folder):
    status, output = ran(folder, "--once", "--out", tmp_path / "out")
    assert status == BAD_INPUT
    assert output.splitlines()[0] == f"waiting for recordings in {folder / 'recordings'}"
    assert "there is none that can be used" in output.splitlines()[-1]


def test_ctrl_c_ends_it_and_says_where_the_results_are(tmp_path, folder, monkeypatch):
    def interrupted(_: float) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr(live.time, "sleep", interrupted)
    status, output = ran(folder, "--out", tmp_path / "out")
    assert status == INTERRUPTED and f"the last answer is in {tmp_path / 'out'}" in output.splitlines()[-1]


@pytest.mark.slow
def test_an_answer_is_given_after_each_of_subject_3s_trials(tmp_path):
    folder, given = tmp_path / "leg", SUBJECTS.find("3")
    shutil.copytree(given, folder)
    shutil.rmtree(folder / "recordings")
    (folder / "recordings").mkdir()
    seen, said = threading.Event(), []

    def instrument() -> None:
        for path in sorted((given / "recordings").iterdir()):
            rows = path.read_text().splitlines(keepends=True)
            with (folder / "recordings" / path.name).open("w") as file:
                for k in range(0, len(rows), 100):
                    file.writelines(rows[k : k + 100])
                    file.flush()
                    time.sleep(0.1)
            seen.wait(600.0)
            seen.clear()

    def tell(lines: list[str]) -> None:
        said.extend(lines)

    def answer(found: Diagnosed) -> None:
        found.write(tmp_path / "out")
        seen.set()
        if len(found.subject.recordings) == 3:
            raise EndsError

    from legfem.api.diagnosis import diagnose

    def within_time(leg: Subject, within: Deadline) -> Diagnosed:
        return diagnose(leg, library=tmp_path / "library", within=within)

    writing = threading.Thread(target=instrument)
    writing.start()
    with pytest.raises(EndsError):
        follow(visit_of(folder), within_time, tell, answer, 15.0)
    writing.join()
    for by in ("trial1", "trial1, trial2", "trial1, trial2, trial3"):
        assert any(line.startswith(f"by {by}: ") and "C10" in line for line in said), said
    assert (tmp_path / "out" / "diagnosis.json").is_file()


@pytest.mark.slow
def test_a_kill_loses_neither_the_answer_nor_what_was_solved(tmp_path):
    words = [sys.executable, "-m", "legfem", "live", str(SUBJECTS.find("3")), "--jobs", "1"]
    words += ["--out", str(tmp_path / "out"), "--library", str(tmp_path / "library")]
    running = subprocess.Popen(words, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    told = []
    for line in running.stdout:
        told.append(line.strip())
        if line.startswith("report: "):
            break
    running.kill()
    running.wait()
    before = json.loads((tmp_path / "out" / "diagnosis.json").read_text())
    kept = {path: path.stat().st_mtime_ns for path in (tmp_path / "library").rglob("*.json")}
    again = subprocess.run([*words, "--once", "--for", "1ms"], capture_output=True, text=True, check=True)
    assert next(line for line in told if line.startswith("by ")) in again.stdout
    assert before["answer"] == json.loads((tmp_path / "out" / "diagnosis.json").read_text())["answer"]
    assert kept and kept.items() <= {p: p.stat().st_mtime_ns for p in (tmp_path / "library").rglob("*.json")}.items()
