"""Keys of every folder's TOML with values of a wrong type or size: one line that names the key, or a sound value."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np
import pytest
from making_fuzzed import KINDS

VALUES = [
    "-1.0",
    "nan",
    "inf",
    "1e300",
    "1e-300",
    '"αβ"',
    '""',
    '"1e3"',
    "[]",
    "[[1]]",
    "{}",
    "true",
    "0.0",
    "1979-05-27",
]
OPEN = ("id", "title", "name", "origin", "direction_deg")
"""May be any text, or any direction."""
NUMBER = 40


@pytest.mark.parametrize("kind", ["specimens", "sites", "stockings"])
def test_values_of_a_wrong_type_or_size_are_refused_or_doubted_in_one_line(tmp_path: Path, kind: str) -> None:
    folder = tmp_path / "good"
    KINDS[kind].make(folder)
    assert KINDS[kind].told(folder) == ""
    (toml,) = folder.glob("*.toml")
    text = toml.read_text()
    keys = [found for found in re.finditer(r"^(\w+) = (.+)$", text, re.MULTILINE) if found[1] not in OPEN]
    generator = np.random.default_rng(38)
    passed = []
    for _ in range(NUMBER):
        key, value = (some[int(generator.integers(len(some)))] for some in (keys, VALUES))
        toml.write_text(text[: key.start(2)] + value + text[key.end(2) :])
        told = KINDS[kind].told(folder)
        if told:
            assert "correct it" not in told, told
        else:
            passed.append(f"{key[1]} = {value}")
    print(kind, f"{NUMBER - len(passed)} of {NUMBER} refused; read:", passed)
    assert len(passed) <= 0.2 * NUMBER
