"""Build the paper: the pages' numbers and figures into ``_build/``, and the PDF by Typst.

Run ``python docs/paper/build.py`` from the checkout. What is taken from which page stands in ``evidence.toml``; what is
no longer there ends the build.
"""

from __future__ import annotations

import json
import re
import sys
import tomllib
from itertools import takewhile
from pathlib import Path
from typing import Any

from legfem.mechanisms import mechanisms

HERE = Path(__file__).resolve().parent
ROOT, BUILT = HERE.parents[1], HERE / "_build"


class MovedError(Exception):
    """A page no longer has what the paper takes from it."""


def cells(line: str) -> list[str]:
    """Return a Markdown row's cells, without links, code marks and bold."""
    plain = (
        re.sub(r" ?\((?:\[page\]\(.*?\)|the same page)\)|\[(.*?)\]\(.*?\)", r"\1", line)
        .replace("**", "")
        .replace("`", "")
    )
    return [cell.strip() for cell in plain.strip().strip("|").split("|")]


def table(text: str, under: str, header: list[str], file: str) -> list[list[str]]:
    """Return the rows of the table with that header between a heading and the next of its kind."""
    lines = text.splitlines()
    if lines.count(under) != 1:
        raise MovedError(f"{file}: no heading {under!r}")
    level = under.split()[0] + " "
    rest = lines[lines.index(under) + 1 :]
    end = next((k for k, line in enumerate(rest) if line.startswith(level)), len(rest))
    at = [k for k, line in enumerate(rest[:end]) if line.startswith("|") and cells(line) == header]
    if len(at) != 1:
        raise MovedError(f"{file}: under {under!r} no table has the header {header}")
    rows = [cells(line) for line in takewhile(lambda line: line.startswith("|"), rest[at[0] + 2 : end])]
    if not rows or any(len(row) != len(header) for row in rows):
        raise MovedError(f"{file}: under {under!r} a row has not {len(header)} cells")
    return rows


def evidence(root: Path = ROOT) -> dict[str, Any]:
    """Return all that the paper takes: tables by name, phrases' groups by name, mechanisms with their statements."""
    wanted = tomllib.loads((HERE / "evidence.toml").read_text("utf-8"))
    found: dict[str, Any] = {"tables": {}, "phrases": {}}
    for name, one in wanted["tables"].items():
        rows = table((root / one["file"]).read_text("utf-8"), one["under"], one["header"], one["file"])
        found["tables"][name] = {"header": one["header"], "rows": rows}
    for name, one in wanted["phrases"].items():
        told = re.findall(one["pattern"], " ".join((root / one["file"]).read_text("utf-8").split()))
        if len(told) != 1:
            raise MovedError(f"{one['file']}: {name} stands there {len(told)} times: {one['pattern']}")
        found["phrases"][name] = [told[0]] if isinstance(told[0], str) else list(told[0])
    found["mechanisms"] = [[one.name, one.statement] for one in mechanisms()]
    return found


def main() -> None:
    """Write numbers, figures and paper.pdf."""
    sys.path.insert(0, str(HERE))
    import figures
    import typst

    BUILT.mkdir(exist_ok=True)
    found = evidence()
    (BUILT / "evidence.json").write_text(json.dumps(found, ensure_ascii=False, indent=1), "utf-8")
    figures.draw_all(BUILT, found)
    typst.compile(HERE / "paper.typ", output=BUILT / "paper.pdf", root=ROOT, font_paths=[figures.FONTS])
    print(BUILT / "paper.pdf")


if __name__ == "__main__":
    main()
