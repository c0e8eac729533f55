"""``scripts/house`` holds the code to limits, and its lists of exceptions only shrink."""

import subprocess
import sys
from pathlib import Path

import pytest

HOUSE = Path(__file__).parents[1] / "scripts" / "house"
LIMITS = """
[tool.legfem.house]
longest_file = 12
longest_function = 4
most_parameters = 2
code_lines_budget = 7
most_code_lines = 9
long_functions = ["legfem.report.page.Page.long"]
doors = ["legfem.api.door"]

[tool.legfem.house.prose_as_data]
"legfem/report/page.py" = 1
"""
PAGE = '''"""A docstring
of two lines."""
class Page:

    def long(self, reason):
        # A comment.
        return (1,
            "rate" in reason,
            2)
'''
FILES = {"legfem/report/page.py": PAGE, "legfem/api/__init__.py": "def door(a, b, c): ...\n", "pyproject.toml": LIMITS}


@pytest.fixture
def project(tmp_path: Path) -> Path:
    for name, text in FILES.items():
        path = tmp_path / name
        path.parent.mkdir(exist_ok=True, parents=True)
        path.write_text(text)
    return tmp_path


def house(project: Path, *options: str) -> tuple[int, str]:
    done = subprocess.run([sys.executable, HOUSE, project, *options], capture_output=True, text=True)
    assert not done.stderr
    return done.returncode, done.stdout


def add(project: Path, text: str, name: str = "legfem/report/page.py") -> None:
    (project / name).write_text((project / name).read_text() + text)


def limit(project: Path, old: str, new: str) -> None:
    path = project / "pyproject.toml"
    assert old in path.read_text()
    path.write_text(path.read_text().replace(old, new))


def test_counts_leave_comments_docstrings_and_blanks_aside(project: Path) -> None:
    code, told = house(project)
    assert code == 0, told
    assert [line.split()[:2] for line in told.splitlines()[:2]] == [["legfem/api", "1"], ["legfem/report", "5"]]


@pytest.mark.parametrize(
    ("more", "offence"),
    [
        ("x = 1\ny = 2\n", "legfem/ has 8 code lines; code_lines_budget in pyproject.toml is 7"),
        ("\n" * 4, "legfem/report/page.py has 13 lines; at most 12"),
        ("x = 1 # fmt: skip\n", "legfem/report/page.py has a '# fmt: skip'"),
        ("def many(a, b, c): ...\n", "legfem.report.page.many has more than 2 parameters"),
        ("class Page: ...\n", "legfem.report.page and legfem.report.page each have a class Page"),
        ("def inner(a):\n\n\n\n    ...", "legfem.report.page.inner has more than 4 lines"),
        ("DOUBT = 'in doubt'\n'a'.startswith(DOUBT)\n", "takes a sentence for data: 'a'.startswith(DOUBT)"),
    ],
)
def test_what_passes_a_limit_is_told_with_its_place(project: Path, more: str, offence: str) -> None:
    add(project, more)
    code, told = house(project, "--gates")
    assert code == 1
    assert offence in told


@pytest.mark.parametrize(
    ("code", "prose"),
    [
        ("found = '(low, high)' in 'text'", True),
        ("found = 'rate' in one.reason", True),
        ("re.sub(pattern, '', remedy)", True),
        ("re.compile('the (.*) is')", True),
        ("one.partition(': ')", True),
        ("one.partition('=')", False),
        ("name.endswith('.C10')", False),
        ("found = 'C10' in one.stated", False),
        ("re.search(r'[/:]', name)", False),
    ],
)
def test_a_sentence_that_is_matched_is_told_from_a_name(project: Path, code: str, prose: bool) -> None:
    add(project, code)
    assert ("takes a sentence for data" in house(project, "--gates")[1]) == prose


@pytest.mark.parametrize(
    ("old", "new", "offence"),
    [
        ('page.Page.long"]', 'page.Page.long", "legfem.gone"]', "legfem.gone is listed in vain"),
        ('api.door"]', 'api.door", "legfem.gone"]', "legfem.gone is listed in vain"),
        (
            'page.py" = 1',
            'page.py" = 2',
            "legfem/report/page.py takes 1 sentences for data; pyproject.toml may say no more",
        ),
        ('page.py" = 1', 'page.py" = 1\n"legfem/gone.py" = 1', "legfem/gone.py takes 0 sentences for data"),
    ],
)
def test_an_exception_that_is_no_longer_needed_fails(project: Path, old: str, new: str, offence: str) -> None:
    limit(project, old, new)
    code, told = house(project, "--gates")
    assert code == 1
    assert offence in told


def test_the_budget_may_only_be_lowered(project: Path) -> None:
    def git(*words: str) -> None:
        who = ("-c", "user.name=A", "-c", "user.email=a@b", "-c", "init.defaultBranch=main")
        subprocess.run(["git", *who, "-C", project, *words], check=True, capture_output=True)

    git("init")
    for most in ("9", "8"):
        limit(project, "most_code_lines = 9", f"most_code_lines = {most}")
        git("add", ".")
        git("commit", "-m", "A step")
        assert house(project, "--gates")[0] == 0
    limit(project, "budget = 7", "budget = 8")
    assert house(project, "--gates")[0] == 0, "within what may never be passed"
    limit(project, "budget = 8", "budget = 9")
    assert "code_lines_budget is 9; it may not pass most_code_lines, 8" in house(project, "--gates")[1]
    limit(project, "most_code_lines = 8", "most_code_lines = 9")
    code, told = house(project, "--gates")
    assert code == 1
    assert "most_code_lines may only be lowered; it was 8 and is 9" in told
