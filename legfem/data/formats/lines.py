"""The lines of a text as they were meant, without what encodings, spreadsheets and interrupted writing leave there."""

import codecs
import re
import shlex
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from legfem.common.errors import InputError
from legfem.data.formats.labels import WORDS
from legfem.data.formats.sheet import FEWEST_ROWS, THOUSANDS

_MARKS = {
    # UTF-32's begins with UTF-16's.
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF32_LE: "utf-32",
    codecs.BOM_UTF32_BE: "utf-32",
    codecs.BOM_UTF16_LE: "utf-16",
    codecs.BOM_UTF16_BE: "utf-16",
}
_MOST_NULLS = 0.002
_LOST = re.compile(rb"([^\0]+)(\0{64,})")
"""A block that a system reserved and never wrote, as after a loss of power."""
_WIDE = {code: code - 0xFEE0 for code in range(0xFF01, 0xFF5F)}
"""Full-width letters and figures, as Chinese and Japanese programs write them."""
_UNSEEN = dict.fromkeys([0x00AD, 0x200B, 0x200E, 0x200F, 0x2060, 0xFEFF, *range(0x202A, 0x202F)])
_CHARACTERS = {**_WIDE, **_UNSEEN, 0x2212: "-", 0x201C: '"', 0x201D: '"'}
_DASH = re.compile(r"(?<![\w–])–(?=[\d.,])")
"""In a minus sign's place."""
_FORMULA = re.compile(r'="([^"]*)"')
"""How a cell is kept from a spreadsheet's guesses."""
_COMMENT = re.compile(r"^\s*(?:[#%]+|//+)\s?")
_OF_NUMBERS = re.compile(r"(?=.*\d)[\s\d.,;:|+\-eEdD\"'\u00a0\u202f]*")
_QUOTED_THOUSANDS = re.compile(rf'"\s*({THOUSANDS.pattern})\s*"')
_SPACED_THOUSANDS = re.compile(r"(?<=\d)['’\u00a0\u202f](?=\d{3}(?!\d))")
"""As the Swiss and the French write them; a plain space parts them only in a cell of its own."""
_SPACED_CELL = re.compile(r'(?:^|(?<=[;\t"]))\s*[+-]?\d{1,3}(?: \d{3})+(?=(?:[.,]\d*)?\s*(?:[;\t"]|$))')
_UNGROUPED = re.compile(r"[\w.,;\t+-]*")
"""A line in which nothing can stand between thousands but a point or comma: most lines of a long file."""
_QUOTED_LINE = re.compile(r'\s*"([^"]*[,;\t][^"]*)"\s*')
_MOST_LINES_OF_A_CELL = 5
_HEAD_BYTES = 20_000
_HEAD_LINES = 200
_MOST_LINES = 2_000_000
"""Half an hour of a test at 1 kHz, which takes most of a minute to read."""


@dataclass(frozen=True)
class TextLines:
    """A text's lines, of which an empty one stands for each that is left out, so that numbers are the file's.

    Attributes
    ----------
    texts : list of str
        Without comments' marks above the numbers, and without comments among them.
    first : int
        The first line of numbers; beyond the last where none holds numbers alone.
    encoding : str
        What the text was decoded from.
    ends : bool
        Whether the last line has its end.
    remarks : tuple of str
        What was taken out.
    """

    texts: list[str]
    first: int
    encoding: str
    ends: bool
    remarks: tuple[str, ...]


def read_lines(path: Path, part: str | None = None) -> TextLines:
    """Read a text's lines, or those of a part of it.

    Raises
    ------
    InputError
        If it is no text, has too many lines, or a block of it was never written.
    """
    text, encoding, left = decoded(path) if part is None else (part, "", 0)
    given = text.splitlines()
    if len(given) > _MOST_LINES:
        remedy = f"export the test alone, or keep one line of {-(-len(given) // _MOST_LINES)}: {_thinning(path, given)}"
        raise InputError(path, "file", f"contains {len(given):,} lines; at most {_MOST_LINES:,} are read", remedy)
    given = [_FORMULA.sub(r'"\1"', line) for line in _with_whole_cells(given)]
    # A line in quotes as a whole is one that a spreadsheet took for a cell.
    given = [found[1] if (found := _QUOTED_LINE.fullmatch(line)) else line for line in given]
    given, told = _without_stamps(*_without_labels(given))
    first = _first_of_numbers(given)
    broken = next((k for k in range(first, len(given)) if "\0" in given[k]), None)
    if broken is not None:
        raise InputError(path, f"line {broken + 1}", "contains a null byte: the file is damaged", "copy it again")
    remarks = [*told]
    remarks += [f"{left} null bytes at its end are left out: it was not written to its end"] if left else []
    texts, grouped, comments = [], 0, 0
    for k, line in enumerate(given):
        if _COMMENT.match(line) and k > first:
            texts.append("")
            comments += 1
            continue
        # In quotes, and with a decimal mark of the other kind, there is but one way to read them.
        plain = _COMMENT.sub("", line.replace("\0", ""))
        if not _UNGROUPED.fullmatch(plain):
            plain, count = _QUOTED_THOUSANDS.subn(_without_thousands, plain)
            plain, further = _SPACED_THOUSANDS.subn("", plain)
            plain, more = _SPACED_CELL.subn(lambda found: found[0].replace(" ", ""), plain)
            grouped += count + further + more
        texts.append(plain)
    if comments:
        remarks.append(f"comments among the numbers are left out ({comments} lines)")
    if grouped:
        remarks.append(f"{grouped} numbers have thousands' separators, which are taken out")
    return TextLines(texts, first, encoding, text.endswith(("\n", "\r")), tuple(remarks))


def _thinning(path: Path, lines: Sequence[str]) -> str:
    """Return the command that keeps the heading, and as many lines below it as are read."""
    few = lines[:_HEAD_LINES]
    each, thin = -(-len(lines) // (_MOST_LINES - _HEAD_LINES)), path.with_stem(f"{path.stem}-thin")
    condition = f"NR <= {_first_of_numbers(few)} || NR % {each} == 0"
    return f"awk '{condition}' {shlex.quote(str(path))} > {shlex.quote(str(thin))}"


_STAMP = re.compile(r"\d\d:\d\d:\d\d\.\d{3} -> ")
_LABELLED = re.compile(
    r"\s*(?P<label>[^\W\d][\w ]*?)\s*[:=]\s*(?P<number>[+-]?\d+(?:\.\d*)?)\s*(?P<unit>[^\W\d_]{1,5})?\s*"
)
_MOSTLY, _LINES_TRIED = 0.9, 40


def _without_stamps(lines: list[str], told: tuple[str, ...]) -> tuple[list[str], tuple[str, ...]]:
    """Return lines without the times at which a serial monitor received them."""
    stamped = [_STAMP.match(line) for line in lines if line.strip()]
    if sum(map(bool, stamped)) <= _MOSTLY * len(stamped):
        return lines, told
    return [_STAMP.sub("", line, count=1) for line in lines], (*told, "a serial monitor's times are left out")


def _without_labels(lines: list[str]) -> tuple[list[str], tuple[str, ...]]:
    """Return lines of labels and values, as ``Force:1.25,Depth:3.5 mm``, as a table with a line of names."""
    filled = [k for k, line in enumerate(lines) if line.strip()]
    middle = [lines[k] for k in filled[len(filled) // 2 :][:_LINES_TRIED]]
    if not any(_labelled(_STAMP.sub("", line, count=1)) for line in middle):
        return lines, ()
    parted = [_labelled(_STAMP.sub("", line, count=1)) for line in lines]
    begin = next((k for k in filled if parted[k]), None)
    if begin is None or len(filled) < FEWEST_ROWS:
        return lines, ()
    names = [(label, unit) for label, _, unit in parted[begin]]
    same = [[(label, unit) for label, _, unit in parted[k]] == names for k in filled]
    if len(names) < 2 or sum(same) <= _MOSTLY * len(same):
        return lines, ()
    found = [",".join(n for _, n, _ in cells) if cells else line for cells, line in zip(parted, lines, strict=True)]
    head = ",".join(f"{label} ({unit})" if unit else label for label, unit in names)
    return [*found[:begin], head, *found[begin:]], ("each value stands behind its name",)


def _labelled(line: str) -> list[tuple[str, str, str]]:
    """Return the labels, numbers and units in a line of nothing else; nothing for any other."""
    cells = [_LABELLED.fullmatch(cell) for cell in re.split(r"[,;\t]", line)]
    return [(c["label"], c["number"], c["unit"] or "") for c in cells if c] if all(cells) else []


def _first_of_numbers(lines: Sequence[str]) -> int:
    """Return where three lines of numbers follow one another, as a date in a heading doesn't; the end without any."""
    filled = [k for k, line in enumerate(lines) if line.strip()]
    found = [_OF_NUMBERS.fullmatch(lines[k]) is not None for k in filled]
    needed = 3 if len(filled) >= FEWEST_ROWS else 1
    return next((k for i, k in enumerate(filled) if all(found[i : i + needed])), len(lines))


def _without_thousands(found: re.Match[str]) -> str:
    text = found[1]
    return f'"{text.replace("," if text.rfind(".") > text.rfind(",") else ".", "")}"'


def _with_whole_cells(lines: Sequence[str]) -> list[str]:
    """Return lines in which a quoted cell of several lines, as a heading's ``"Load⏎(N)"``, stands on one."""
    whole: list[str] = []
    k = 0
    while k < len(lines):
        taken = 1
        if lines[k].count('"') % 2:
            ends = (n for n in range(2, _MOST_LINES_OF_A_CELL + 1) if not "".join(lines[k : k + n]).count('"') % 2)
            taken = next(ends, 1)
        whole += [" ".join(lines[k : k + taken]), *[""] * (taken - 1)]
        k += taken
    return whole


def decoded(path: Path) -> tuple[str, str, int]:
    """Return a file's text in plain characters, its encoding, and how many null bytes were left out at its end.

    Raises
    ------
    InputError
        If it is no text, or a block of it was never written.
    """
    text, encoding, left = _decoded(path, path.read_bytes())
    return _DASH.sub("-", text.translate(_CHARACTERS)), encoding, left


def _decoded(path: Path, raw: bytes) -> tuple[str, str, int]:
    for mark, name in _MARKS.items():
        if raw.startswith(mark):
            return raw.removeprefix(codecs.BOM_UTF8).decode(name, errors="replace"), name, 0
    pairs = raw[: len(raw) // 2 * 2]
    for name, nulls in (("utf-16-le", pairs[1::2]), ("utf-16-be", pairs[::2])):
        if pairs and nulls.count(0) > 0.9 * len(nulls):
            return raw.decode(name, errors="replace"), f"{name} (it doesn't say so)", 0
    whole = raw.rstrip(b"\0")
    left = len(raw) - len(whole)
    if whole.count(0) > _MOST_NULLS * len(whole) + 1:
        lost = _LOST.match(whole)
        if lost is not None:
            problem = f"{len(lost[2])} null bytes are in the place of text: part of the file is lost"
            raise InputError(path, f"line {lost[1].count(b'\n') + 1}", problem, "copy it again from the instrument")
        raise InputError(path, "file", "is not text (it contains null bytes)", "export it as CSV from its program")
    try:
        return whole.decode("utf-8"), "utf-8", left if left > 1 else 0
    except UnicodeDecodeError:
        name = _page_of(whole)
        return whole.decode(name, errors="replace"), f"{name} (it isn't utf-8)", left if left > 1 else 0


_PAGES = ("cp932", "gb18030", "cp949", "cp1251", "euc_jp", "big5", "koi8-r", "cp866", "cp1253")
_OTHER_LETTERS = re.compile("|".join(re.findall(r"[^|^$()\x00-\u024f]{2,}", "|".join(WORDS.values()))), re.IGNORECASE)
"""Names of quantities in other than Latin letters."""


def _page_of(raw: bytes) -> str:
    """Return the code page in which a text names most quantities; Western Europe's where none is better."""
    head = raw[:_HEAD_BYTES].rpartition(b"\n")[0] or raw
    found = {name: len(set(_OTHER_LETTERS.findall(head.decode(name, errors="replace")))) for name in _PAGES}
    best = max(_PAGES, key=lambda name: found[name])
    return best if found[best] > 1 else "cp1252"
