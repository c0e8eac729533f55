"""What is wrong with a text that can't be read as TOML, as people write it, and how to mend it."""

import re

_LINE = re.compile(r"at line (\d+), column (\d+)")
_OTHER_QUOTES = re.compile("[\u201c\u201d\u201e\u201f\u00ab\u00bb\u2018\u2019]")
_VALUE = re.compile(r"^\s*(?P<key>[\w.-]+)\s*=\s*(?P<value>.*?)\s*$")
_KINDS: tuple[tuple[re.Pattern[str], str, str], ...] = (
    (re.compile(r"[+-]?\d+,\d+"), "has a decimal comma", "write decimals with points"),
    (re.compile(r"[+-]?[\d.]+\s?[a-zA-Zµ°%]+"), "has a unit behind the number", "write the number alone"),
    (re.compile(r".*;"), "ends with a semicolon", "take it out"),
    (re.compile(r".*\s//.*"), "has a comment after //", "begin comments with #"),
    (re.compile(r"(True|TRUE|False|FALSE|yes|no|Yes|No)"), "is neither true nor false", "write true or false"),
    (re.compile(r'"[^"]*\\.*"'), "has a backslash in a path", "write paths with /"),
    (re.compile(r"[^\W\d]\w*( \w+)*"), "is text without quotes", 'write it in quotes: "..."'),
)
"""What may stand where a value is wanted, what is wrong with it, and how to mend it."""


def why_no_toml(text: str, error: ValueError) -> tuple[str, str]:
    """Return what is wrong, with its line, and how to mend it.

    Parameters
    ----------
    text : str
        The whole file's.
    error : ValueError
        What ``tomllib`` raised.
    """
    lines = text.splitlines()
    place = _LINE.search(str(error))
    if text.lstrip()[:1] == "{":
        return "is JSON", "write it as TOML: key = value, and [tables] on lines of their own"
    if place is None or int(place[1]) > len(lines):
        return str(error), "correct the syntax (texts in quotes, decimals with points)"
    number, line = int(place[1]), lines[int(place[1]) - 1]
    told = _of_line(line, str(error))
    if told is None:
        return f"{error}: {line.strip()[:60]!r}", "correct the syntax (texts in quotes, decimals with points)"
    return f"line {number}: {line.strip()[:60]} {told[0]}", told[1]


def _of_line(line: str, error: str) -> tuple[str, str] | None:
    if error.startswith("Cannot overwrite"):
        return "gives a key that is given above already", "keep one of the two"
    if error.startswith("Cannot declare"):
        return "is a table that is given above already", "put its keys under the first"
    if _OTHER_QUOTES.search(line):
        return "has an editor's curved quotes", 'write straight ones: "..."'
    if re.match(r"^\s*[\w-]+\s*:", line):
        return "has a colon in place of =", "write key = value"
    found = _VALUE.match(line)
    if found is None:
        return None
    value = found["value"].partition(" #")[0].rstrip()
    return next(((problem, remedy) for kind, problem, remedy in _KINDS if kind.fullmatch(value)), None)
