"""The code a result depends on: what counts, and what doesn't."""

from __future__ import annotations

from pathlib import Path

import pytest

from legfem.common import resources
from legfem.jobs import store as fingerprint
from legfem.jobs.store import code_fingerprint

MAIN = '''"""Words."""
from legfem.other import half


def answer(x):
    """Words."""
    return half(x)  # words
'''
OTHER = "def half(x):\n    return x / 2\n"


@pytest.fixture
def hashed(tmp_path: Path, monkeypatch: pytest.MonkeyPatch):
    """Returns the fingerprint of a module with given texts of it and of what it imports."""
    (tmp_path / "legfem").mkdir()
    monkeypatch.setattr(fingerprint, "_ROOT", tmp_path)

    def of(main: str = MAIN, other: str = OTHER, unrelated: str = "") -> str:
        texts = {"main": main, "other": other, "unrelated": unrelated}
        for name, text in texts.items():
            (tmp_path / "legfem" / f"{name}.py").write_text(text)
        code_fingerprint.cache_clear()
        fingerprint._read.cache_clear()
        return code_fingerprint("legfem.main")

    yield of
    code_fingerprint.cache_clear()
    fingerprint._read.cache_clear()


def test_words_and_unrelated_modules_do_not_count(hashed) -> None:
    before = hashed()
    assert hashed(MAIN.replace("Words.", "Other words.")) == before
    assert hashed(MAIN.replace("# words", "")) == before
    assert hashed(MAIN.replace("return", "\n\n    return")) == before
    assert hashed(unrelated="x = 1") == before


@pytest.mark.parametrize("change", ["main", "imported", "imported within a function", "version"])
def test_code_and_versions_count(hashed, change: str, monkeypatch: pytest.MonkeyPatch) -> None:
    before = hashed()
    if change == "main":
        after = hashed(MAIN.replace("half(x)", "half(x) + 1"))
    elif change == "imported":
        after = hashed(other=OTHER.replace("2", "3"))
    elif change == "version":
        monkeypatch.setattr(fingerprint, "package_version", lambda name: "99")
        after = hashed()
    else:
        late = MAIN.replace("    return", "    import legfem.unrelated\n    return")
        before = hashed(late, unrelated="x = 1")
        after = hashed(late, unrelated="x = 2")
    assert after != before


def test_a_table_of_values_counts_and_its_comments_do_not(hashed, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(resources, "RESOURCES", tmp_path)
    read = MAIN + 'LIMITS = resource("limits", dict[str, float])\n'
    found = []
    for text in ("a = 1.0", "a = 1.0  # words", "a = 2.0"):
        (tmp_path / "limits.toml").write_text(text)
        found.append(hashed(read))
    assert found[0] == found[1] != found[2]
