"""A folder as people write and name it: what is wrong is told in a line that says where, and how to mend it."""

from __future__ import annotations

import re
import unicodedata
from collections.abc import Callable
from pathlib import Path

import pandas as pd
import pytest
from making import write_subject

from legfem.common.errors import InputError
from legfem.legs.loading import load_subject


def told(folder: Path) -> str:
    with pytest.raises(InputError) as caught:
        load_subject(folder)
    return str(caught.value)


@pytest.mark.parametrize(
    ("pattern", "by", "words"),
    [
        ("length_mm = 50.0", "length_mm = 50,0", "line 11: length_mm = 50,0 has a decimal comma; write decimals with"),
        ("length_mm = 50.0", "length_mm = 50 mm", "has a unit behind the number; write the number alone"),
        ("length_mm = 50.0", "length_mm: 50.0", "has a colon in place of =; write key = value"),
        ("length_mm = 50.0", "length_mm = 50.0;", "ends with a semicolon; take it out"),
        ("length_mm = 50.0", "length_mm = 50.0 // of glass", "has a comment after //; begin comments with #"),
        ("length_mm = 50.0", "length_mm = 5\nlength_mm = 50", "gives a key that is given above already; keep one"),
        ("length_mm = 50.0", "length_mm = fifty", 'is text without quotes; write it in quotes: "..."'),
        ('title = "(.*)"', r"title = “\1”", "has an editor's curved quotes; write straight ones"),
        ('title = "(.*)"', r'title = "C:\\Users\\x"', "has a backslash in a path; write paths with /"),
        ('title = "(.*)"', "title = 2024-05-03", "title: 2024-05-03 is not text; write it in quotes"),
        (r"\[instrument\]", "[indenter]", "is a table that is given above already; put its keys under the first"),
        (r"direction_deg = \S+", "direction_deg = 1370", "1370 is out of range; give a value of at most 360, in deg"),
        (r"(?s)^.*$", '{"title": "x"}', "is JSON; write it as TOML"),
    ],
)
def test_a_slip_in_the_toml_is_told_with_its_line_and_its_remedy(tmp_path, pattern, by, words):
    toml = write_subject(tmp_path / "leg") / "subject.toml"
    text = re.sub(pattern, by, toml.read_text(), count=1)
    toml.write_text(text)
    assert words in told(tmp_path / "leg")


def test_a_toml_that_notepad_saved_as_unicode_is_read(tmp_path):
    toml = write_subject(tmp_path / "leg") / "subject.toml"
    toml.write_bytes(toml.read_text().replace("\n", "\r\n").encode("utf-16"))
    load_subject(tmp_path / "leg")


def _renamed(old: str, new: str) -> Callable[[Path], object]:
    return lambda folder: (folder / old).rename(folder / new)


def _as_workbook(folder: Path) -> None:
    pd.read_csv(folder / "contours.csv").to_excel(folder / "contours.xlsx", index=False)
    (folder / "contours.csv").unlink()


def _in_a_folder_more(folder: Path) -> None:
    (folder / "recordings").rename(folder / "day 1")
    (folder / "recordings").mkdir()
    (folder / "day 1").rename(folder / "recordings" / "day 1")


def _beside(folder: Path) -> None:
    for path in (folder / "recordings").iterdir():
        path.rename(folder / path.name)
    (folder / "recordings").rmdir()


@pytest.mark.parametrize(
    ("change", "remedy"),
    [
        (_renamed("subject.toml", "subject.toml.txt"), "rename 'subject.toml.txt' to subject.toml"),
        (_renamed("subject.toml", "Subject.toml"), "rename 'Subject.toml' to subject.toml"),
        (_renamed("subject.toml", "subject (1).toml"), "rename 'subject (1).toml' to subject.toml"),
        (_renamed("contours.csv", "contours.CSV"), "rename 'contours.CSV' to contours.csv"),
        (_as_workbook, "save 'contours.xlsx' as contours.csv"),
        (_renamed("recordings", "Recordings"), "rename 'Recordings' to recordings"),
        (_in_a_folder_more, "move the files out of day 1"),
        (_beside, "move trial1.csv into a folder recordings"),
    ],
)
def test_what_is_missing_under_its_name_is_looked_for_beside_it(tmp_path, change, remedy):
    folder = write_subject(tmp_path / "leg", trials=1)
    change(folder)
    assert told(folder).endswith(remedy)


def test_accents_that_are_encoded_in_another_way_are_told(tmp_path):
    folder = write_subject(tmp_path / "leg")
    toml = folder / "subject.toml"
    toml.write_text(toml.read_text().replace("contours.csv", "größe.csv"))
    (folder / "contours.csv").rename(folder / unicodedata.normalize("NFD", "größe.csv"))
    assert "its accents are encoded in another way" in told(folder)


def test_contours_as_a_german_spreadsheet_saves_them_are_read(tmp_path):
    folder = write_subject(tmp_path / "leg")
    before = load_subject(folder).section
    table = pd.read_csv(folder / "contours.csv")
    table.to_csv(folder / "contours.csv", index=False, sep=";", decimal=",")
    assert (load_subject(folder).section.skin == before.skin).all()
    (folder / "contours.csv").write_text("part;x_mm;y_mm\nskin;1,5;2.5\n" * 2)
    assert "'1,5' has a decimal comma, and '2.5' a point; write all decimals alike" in told(folder)
