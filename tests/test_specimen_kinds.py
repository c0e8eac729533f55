"""Kinds of tests on specimens: one file each says all that the rest of legfem needs."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

import pytest
from making_specimens import BAR, PLANTED, compressed, ramp, record

import legfem as lf
from legfem.app.description import known_tests
from legfem.common import registry
from legfem.common.errors import InputError
from legfem.experiments.bodies import UniaxialSpecimen
from legfem.specimens import kinds as room
from legfem.specimens.kinds.bar import BarKind
from legfem.specimens.schema import SpecimenFile
from legfem.specimens.sizes import Sizes


class OwnBody(UniaxialSpecimen):
    """Sizes of another package's test."""


class OwnKind(BarKind):
    """Another package's test: a bar by another name."""

    table: ClassVar = "own_bar"
    body: ClassVar = OwnBody


@dataclass
class Entry:
    name: str
    what: object

    def load(self) -> object:
        return self.what


@pytest.mark.parametrize("kind", room.kinds().values(), ids=room.kinds())
def test_a_kind_says_all_that_a_page_and_a_form_show(kind) -> None:
    assert kind.words and kind.done and kind.followed
    assert set(kind.own) <= set(kind.entry.model_fields)
    assert set(kind.ranges) <= set(kind.entry.model_fields)
    assert {one.key[-1] for one in known_tests()[kind.table]} == set(kind.entry.model_fields)
    assert SpecimenFile.model_fields[kind.table].annotation == kind.entry | None
    assert room.kind_of(kind.body) is kind


@pytest.mark.parametrize("kind", room.kinds().values(), ids=room.kinds())
def test_a_size_that_is_missing_is_named(kind) -> None:
    stated = {key: 10.0 for key, one in kind.entry.model_fields.items() if one.is_required() and key != "direction"}
    given = kind.entry(**stated, **({"direction": "tension"} if "direction" in kind.entry.model_fields else {}))
    with pytest.raises(InputError) as error:
        kind.body_of(given)
    assert error.value.field in kind.own


def test_another_package_s_kind_is_found_by_its_entry_point(monkeypatch) -> None:
    entries = [Entry("own", OwnKind), Entry("broken", lambda: 7)]
    monkeypatch.setattr(registry, "entry_points", lambda group: entries if group == room.GROUP else [])
    before = set(room.kinds())
    room.kinds.cache_clear()
    try:
        assert set(room.kinds()) == before | {"own_bar"}
        assert str(Sizes(OwnBody(10.0, 100.0))) == "a bar: length 10 mm, area 100 mm², in compression"
    finally:
        monkeypatch.undo()
        room.kinds.cache_clear()


def test_a_folder_of_two_tests_is_refused_with_all_kinds(tmp_path: Path) -> None:
    time, d = ramp(3.0, 6.0)
    record(tmp_path, "one", time, d, compressed(PLANTED, d))
    (tmp_path / "specimen.toml").write_text(BAR + "[plates]\nheight_mm = 10.0\ndiameter_mm = 10.0\n")
    with pytest.raises(InputError) as error:
        lf.load_specimen(tmp_path)
    assert "2 tests are given" in str(error.value)
    assert all(f"[{name}]" in str(error.value) for name in room.kinds())
