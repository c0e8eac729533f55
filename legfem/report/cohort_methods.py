"""How a cohort was done, in paragraphs for a paper."""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from typing import Any

from legfem.cohort.members import Members
from legfem.cohort.rows import Row
from legfem.common.versions import versions_of

_DONE = {
    "identify": "Stiffness of the deep tissue was identified from indentation recordings of {what} by legfem {legfem}",
    "diagnose": "Indentation recordings of {what} were compared with a finite-element model, and what it leaves out "
    "was sought, by legfem {legfem}",
    "stocking": "Stiffness and pressures of {what} in compression stockings were computed by legfem {legfem}",
}


def methods(members: Members, rows: Sequence[Row], task: str, model: str) -> list[str]:
    """Return paragraphs on what was done, with settings and versions.

    Parameters
    ----------
    members
        Who is in the cohort.
    rows
        What was found of each.
    task
        What was done.
    model
        Under which members are compared.
    """
    done = [row for row in rows if row.done]
    people = len({one.person for one in members.every})
    versions = _same([dict(row.versions) for row in done]) or versions_of("legfem", "dolfinx")
    what = f"{len(rows)} members of {people} {'person' if people == 1 else 'people'}"
    stands = ", ".join(f"{name} {version}" for name, version in versions.items() if name != "legfem")
    first = _DONE[task].format(what=what, legfem=versions.get("legfem", "unknown")) + f" ({stands})."
    texts = [first + (f" Results are compared under one model ({model})." if model else "")]
    settings = [row.settings for row in done if row.settings]
    if settings:
        names = (
            ("greatest displacement (mm)", "depth_mm"),
            ("interval", "interval"),
            ("relative numerical error (sd)", "numerical_error_relative"),
            ("C10 of the fat (kPa)", "superficial_C10_kPa"),
            ("C10 of the fascia (kPa)", "fascia_C10_kPa"),
            ("thickness of the fascia (mm)", "fascia_thickness_mm"),
            ("D1 of the deep tissue (1/MPa)", "deep_D1_per_MPa"),
        )
        given = [f"{words}: {_shown([one[key] for one in settings if key in one])}" for words, key in names]
        texts.append(f"Settings: {'; '.join(one for one in given if not one.endswith(': '))}.")
    if len(rows) > len(done):
        texts.append(f"{len(rows) - len(done)} of {len(rows)} members gave no result and are left out of all else.")
    return texts


def _same(given: Sequence[dict[str, str]]) -> dict[str, str]:
    """Versions that were used; several where rows differ."""
    names = dict.fromkeys(name for one in given for name in one)
    return {name: " and ".join(sorted({one[name] for one in given if name in one})) for name in names}


def _shown(values: Sequence[Any]) -> str:
    """One value, or from where to where they go."""
    flat = [one for value in values for one in (value if isinstance(value, list) else [value])]
    if not flat:
        return ""
    if all(isinstance(one, int | float) for one in flat):
        low, high = min(flat), max(flat)
        return f"{low:g}" if low == high else f"{low:g} to {high:g}"
    return " or ".join(text for text, _ in Counter(map(str, flat)).most_common(3))
