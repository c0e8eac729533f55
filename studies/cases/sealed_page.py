"""What is counted of sealed cases: by channels, by channels and kind, and case by case."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from studies.cases.sealed import SURE, WRONG, Said
from studies.cases.sealed_draw import SUBSETS

KINDS = {"none": "null", "single": "single", "pair": "pair", "outside": "outside"}


def page(said: Sequence[Said]) -> str:
    """Return the tables in Markdown."""
    return "\n".join([*_by_channels(said), "", *_by_kind(said), "", *_by_truth(said), "", *_cases(said)]) + "\n"


def answers_by_time(cases: Sequence[Sequence[Said]]) -> str:
    """Return what provisional answers said, the first ones of all cases first, beside what was said in the end."""
    if all(one.final for case in cases for one in case):
        return ""
    lines = [f"| answer | cases | seconds of the processor, median and most | effects weighed, median | {_STOOD}"]
    lines += ["|---" * 8 + "|"]
    for number in range(max(map(len, cases))):
        told = [(case[number], case[-1]) for case in cases if number < len(case)]
        own, spent = [one for one, _ in told], [one.seconds for one, _ in told]
        stood = [(one.stated, one.unknown) == (end.stated, end.unknown) for one, end in told if one.probability >= SURE]
        weighed = np.median([n for n, _ in (one.weighed for one in own)])
        half = 100 * float(np.median([one.half_width for one in own]))
        lines.append(
            f"| {number + 1} | {len(own)} | {np.median(spent):.0f}, {max(spent):.0f} | {weighed:.0f} | "
            f"{_of(stood)} | {_of([one.holds for one in own])} | {half:.0f} % | {sum(one.final for one in own)} |"
        )
    return "\n".join([*lines, "", ""])


_STOOD = f"said with {SURE:g} or more, and stood | C10 held | half-width, median | the last one |"


def names_f1(said: Sequence[Said]) -> float:
    """Return the F1 of the names in the first things said: of effects that were there, and of names that were right."""
    right = sum(len(set(one.first) & set(one.truth)) for one in said)
    either = sum(len(one.first) + len(one.truth) for one in said)
    return 2 * right / either if either else 1.0


_COUNTED = (
    "| n | named first | listed | unknown | consistent | told | C10 held | half-width, median "
    f'| said with {SURE:g} or more, and right | "yes" beside a C10 over {100 * WRONG:.0f} % off |'
)
_RULE = "|---" * 10 + "|"


def _by_channels(said: Sequence[Said]) -> list[str]:
    lines = [f"| channels | F1 of names | false alarms {_COUNTED}", f"|---|---|---{_RULE}"]
    for subset in SUBSETS:
        mine = [one for one in said if one.subset == subset]
        if mine:
            nulls = [one for one in mine if one.kind == "none"]
            alarms = _of([one.verdict != "consistent" for one in nulls])
            lines.append(f"| {subset} | {names_f1(mine):.2f} | {alarms} {_counted(mine)}")
    return lines


def _by_kind(said: Sequence[Said]) -> list[str]:
    lines = [f"| channels | kind {_COUNTED}", f"|---|---{_RULE}"]
    for subset in SUBSETS:
        mine = [one for one in said if one.subset == subset]
        groups = [(title, [one for one in mine if one.kind == kind]) for kind, title in KINDS.items()]
        groups.append(("wrong name", [one for one in mine if one.wrong]))
        lines += [f"| {subset} | {title} {_counted(own)}" for title, own in groups if own]
    return lines


def _by_truth(said: Sequence[Said]) -> list[str]:
    """Return what is counted of each thing that is concealed, over all channels."""
    lines = [f"| concealed {_COUNTED}", f"|---{_RULE}"]
    groups: dict[str, list[Said]] = {}
    for one in said:
        groups.setdefault(one.concealed, []).append(one)
    return lines + [f"| {name} {_counted(own)}" for name, own in sorted(groups.items())]


def _counted(own: Sequence[Said]) -> str:
    sure = [one.sure for one in own if one.sure is not None]
    half = f"{100 * float(np.median([one.half_width for one in own])):.0f} %"
    cells = [
        str(len(own)),
        _of([one.right for one in own if one.truth]),
        _of([one.in_list for one in own if one.truth]),
        _of([one.unknown for one in own]),
        _of([one.verdict == "consistent" for one in own]),
        _of([one.told for one in own if one.kind != "none"]),
        _of([one.holds for one in own]),
        half,
        _of(sure),
        _of([one.wrong_yes for one in own]),
    ]
    return "| " + " | ".join(cells) + " |"


def _of(which: Sequence[bool]) -> str:
    return f"{sum(which)}/{len(which)}" if which else "-"


def _cases(said: Sequence[Said]) -> list[str]:
    lines = ["| case | concealed, C10 (kPa) | " + " | ".join(SUBSETS) + " |", "|---|---|" + "---|" * len(SUBSETS)]
    for number in sorted({one.case for one in said}):
        row = {one.subset: one for one in said if one.case == number}
        some = next(iter(row.values()))
        cells = [cell_of(row[subset]) if subset in row else "" for subset in SUBSETS]
        lines.append(f"| {number} | {some.concealed}, {some.true_c10:.2f} | " + " | ".join(cells) + " |")
    return lines


def cell_of(one: Said) -> str:
    """Return what is said of a case: bold where it is right, and C10's interval."""
    names = " or ".join("+".join(n) for n in one.listed[:2]) or one.verdict
    held = ("" if one.holds else " **outside**") + " (doubted)" * one.doubted
    bold = "**" if one.right else ""
    return f"{bold}{names}{bold} {one.probability:.2f}; {one.interval[0]:.2f} to {one.interval[1]:.2f}{held}"
