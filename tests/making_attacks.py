"""Inputs of every kind, broken at random, and the commands, calls and uploads that they are given to.

``python tests/making_attacks.py`` is the process that runs them: a line of JSON asks, and a line answers. A test ends
it when an answer takes too long, and starts another.
"""

from __future__ import annotations

import gzip
import inspect
import json
import os
import sys
import tempfile
import traceback
from collections.abc import Callable
from contextlib import contextmanager, nullcontext, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from making import write_subject
from making_broken import broken_bytes, broken_text
from making_fuzzed import KINDS, broken_anywhere
from making_instrument_files import REAL
from making_odd_files import ODD as ODD_FILES
from making_odd_files import open_document, tdms_with_times_of_day, workbook_beside_other_cells
from making_stress_tables import described, write_table

OUT = "OUT"
"""In a command's words: a place for results that isn't there yet."""
TEXT = (".toml", ".csv", ".txt", ".TRA", ".lvm", ".dat", ".tsv", "")
ODD = ("nan", "-1", "0", "1e300", "", "é\u202e", "../..", "/dev/zero", "a\nb", "deep.C10", "1 kPa", "[]", "0x10", "~")
"""What may be written where a number, name or path is asked for."""


@dataclass(frozen=True)
class Attack:
    """What is broken, and the command, call or upload that it is given to."""

    how: str
    """``command``, ``call`` or ``upload``."""
    words: list[str]
    folder: str
    done: str

    def told(self) -> str:
        """Return it in words."""
        return f"{self.how} {' '.join(self.words)}: {self.done}"


def _leg(folder: Path) -> None:
    write_subject(folder, trials=2)


def _lab(folder: Path) -> None:
    write_subject(folder / "leg", trials=1)
    toml = folder / "leg" / "subject.toml"
    cylinder = "diameter_mm = 30.0\nlength_mm = 50.0\n"
    head, mark, instrument = toml.read_text().partition("[instrument]")
    (folder / "lab.toml").write_text(f"[indenter]\n{cylinder}\n{mark}{instrument}")
    toml.write_text(head.replace(cylinder, ""))


def _channels(folder: Path) -> None:
    write_subject(folder, trials=1)
    (folder / "us.csv").write_text("time_s,fat_thickness_mm\n" + "".join(f"{4 * k},{9 - k / 2}\n" for k in range(6)))
    toml = folder / "subject.toml"
    toml.write_text(toml.read_text() + '\n[channels.fat_thickness]\nfile = "us.csv"\nsd_mm = 0.3\n')


def _cohort(folder: Path) -> None:
    for name in ("P1", "P2"):
        write_subject(folder / name, trials=1)
    (folder / "cohort.csv").write_text("folder,subject,side,age\nP1,P1,left,33\nP2,P2,right,41\n")


def _instrument(folder: Path, rng: np.random.Generator) -> None:
    folder.mkdir(parents=True)
    made = [*REAL, workbook_beside_other_cells, open_document, tdms_with_times_of_day, *ODD_FILES.values()]
    one = made[int(rng.integers(len(made)))]
    if isinstance(one, str):
        (folder / "odd.csv").write_text(one, encoding="utf-8")
    else:
        one(folder)


def _stress(folder: Path) -> None:
    stretch = np.linspace(1.0, 1.4, 30)
    write_table(folder, "Stretch,Nominal stress (kPa)", stretch, 6.0 * (stretch - stretch**-2))
    line = 'table = { stretch = "Stretch", stress = "Nominal stress", unit = "kPa", measure = "nominal" }'
    described(folder, '[uniaxial]\ndirection = "tension"\nlength_mm = 10.0\narea_mm2 = 100.0\n', line)


GOOD: dict[str, tuple[Callable[[Path], object], list[list[str]]]] = {
    "leg": (
        _leg,
        [
            ["data", "preview", "{}", "--out", OUT],
            ["identify", "--subject-dir", "{}", "--out", OUT],
            ["diagnose", "--subject-dir", "{}", "--out", OUT],
            ["geometry", "--subject-dir", "{}", "--out", OUT],
            ["meshing", "--subject-dir", "{}", "--out", f"{OUT}/a.inp"],
            ["plan", "--subject-dir", "{}", "--out", OUT],
        ],
    ),
    "lab": (_lab, [["data", "preview", "{}/leg", "--out", OUT], ["identify", "--subject-dir", "{}/leg", "--out", OUT]]),
    "channels": (
        _channels,
        [["data", "preview", "{}", "--out", OUT], ["identify", "--subject-dir", "{}", "--out", OUT]],
    ),
    "cohort": (_cohort, [["cohort", "{}", "--out", OUT, "--dry-run"]]),
    "stress": (_stress, [["data", "preview", "{}", "--out", OUT], ["identify", "--specimen-dir", "{}", "--out", OUT]]),
    "specimens": (
        KINDS["specimens"].make,
        [
            ["data", "preview", "{}", "--out", OUT],
            ["identify", "--specimen-dir", "{}", "--out", OUT],
            ["diagnose", "--specimen-dir", "{}", "--out", OUT],
        ],
    ),
    "sites": (
        KINDS["sites"].make,
        [["data", "preview", "{}", "--out", OUT], ["identify", "--subject-dir", "{}", "--out", OUT]],
    ),
    "stockings": (
        KINDS["stockings"].make,
        [["data", "preview", "{}", "--out", OUT], ["stocking", "--subject-dir", "{}", "--out", OUT]],
    ),
    "volumes": (
        KINDS["volumes"].make,
        [
            ["geometry", "--scan", "{}/leg.nii", "--level", "52", "--out", OUT],
            ["geometry", "--subject-dir", "{}", "--out", OUT],
        ],
    ),
    "surfaces": (KINDS["surfaces"].make, [["geometry", "--subject-dir", "{}", "--out", OUT]]),
    "cross-sections": (
        KINDS["cross-sections"].make,
        [
            ["geometry", "--cross-sections", "{}/sections.csv", "--level", "52", "--out", OUT],
            ["geometry", "--subject-dir", "{}", "--out", OUT],
        ],
    ),
}
"""Good folders, and the commands for them."""
OTHERS = ("instrument", "options", "arguments", "upload")
ALL = (*GOOD, *OTHERS)


def _whole(path: Path, rng: np.random.Generator) -> str:
    """Break a file as a whole, as copying, unpacking and syncing do; return what was done."""
    others = [one for one in sorted(path.parent.iterdir()) if one.is_file() and one != path]
    content = path.read_bytes()
    way = int(rng.integers(9))
    if way == 0:
        path.unlink()
    elif way == 1:
        path.write_bytes(content + content)
    elif way == 2:
        path.unlink()
        path.mkdir()
    elif way == 3 and others:
        path.write_bytes(others[int(rng.integers(len(others)))].read_bytes())
    elif way == 4:
        path.write_bytes(gzip.compress(content))
    elif way == 5:
        path.unlink()
        path.symlink_to(path.name)
    elif way == 6:
        path.write_bytes(content.decode("latin-1").encode("utf-16"))
    elif way == 7:
        path.write_bytes(b"\n".join(reversed(content.splitlines())))
    else:
        path.write_bytes(content.replace(b".", b",").replace(b",", b";"))
    return f"{path.name} whole {way}"


def _broken(folder: Path, rng: np.random.Generator) -> str:
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    path = files[int(rng.integers(len(files)))]
    way = rng.random()
    if way < 0.25:
        return _whole(path, rng)
    if way < 0.6 and {".toml"} < {one.suffix for one in files}:
        return broken_anywhere(folder, int(rng.integers(2**31)))
    text = path.suffix in TEXT and b"\0" not in path.read_bytes()
    with suppress(UnicodeDecodeError):
        if text and path.read_bytes():
            return broken_text(path, rng)
    return broken_bytes(path, rng) if path.read_bytes() else f"{path.name} is empty"


def attack(seed: int, folder: Path) -> Attack:
    """Make one: of each kind in turn, broken by the seed."""
    rng, kind = np.random.default_rng(seed), ALL[seed % len(ALL)]
    if kind == "options":
        return _of_options(rng, folder)
    if kind == "arguments":
        call = ["identify", "diagnose", "plan", "stocking", "cohort", "load_subject", "load_specimen"]
        _leg(folder)
        return Attack("call", [call[int(rng.integers(len(call)))], str(int(rng.integers(2**31)))], str(folder), "")
    if kind == "upload":
        _instrument(folder, rng)
        (path,) = folder.iterdir()
        name = [path.name, "recordings/a.csv", "../x", "a/../../token", ".ssh", "é\u202e.csv", "con", "a" * 300, "x/"]
        at, place = broken_bytes(path, rng), name[int(rng.integers(len(name)))]
        return Attack("upload", [place], str(path), f"{at} to {place!r}")
    if kind == "instrument":
        _instrument(folder, rng)
        done = _broken(folder, rng)
        return Attack("command", ["data", "look", *map(str, sorted(folder.iterdir())), "--out", OUT], str(folder), done)
    make, commands = GOOD[kind]
    make(folder)
    done = _broken(folder, rng)
    words = [word.replace("{}", str(folder)) for word in commands[int(rng.integers(len(commands)))]]
    return Attack("command", words, str(folder), done)


def _of_options(rng: np.random.Generator, folder: Path) -> Attack:
    """One option of a command that is given something odd, beside a good folder."""
    kind = ["leg", "specimens", "stockings", "cross-sections", "cohort"][int(rng.integers(5))]
    make, commands = GOOD[kind]
    make(folder)
    words = [word.replace("{}", str(folder)) for word in commands[int(rng.integers(len(commands)))]]
    option, odd = "", str(rng.choice(ODD))
    known = _options(words) or ["--out"]
    option = known[int(rng.integers(len(known)))]
    if option in words[:-1]:
        words[words.index(option) + 1] = odd
    else:
        words += [option, odd]
    return Attack("command", words, str(folder), f"{option} {odd!r}")


def _options(words: list[str]) -> list[str]:
    one = _command(words)
    flags = {"--quiet", "--json", "--help", "--out"}
    return sorted(o.opts[0] for o in one.params if o.opts[0].startswith("--") and not flags & set(o.opts))


def _command(words: list[str]) -> Any:
    import typer

    from legfem.__main__ import command

    one = typer.main.get_command(command(words[0]))
    return getattr(one, "commands", {}).get(words[1], one)


class _Accepted(BaseException):
    """Work began: what was given is taken."""


@contextmanager
def _until_work_begins():
    """End a command where its solving begins: what is solved after that is no matter of its input."""
    from legfem.common import progress

    def begun(*_: object) -> None:
        raise _Accepted

    ways = [(progress.Lines, "_print"), (progress.Silent, "stage"), (progress.Silent, "advance")]
    kept = [getattr(*way) for way in ways]
    for one, name in ways:
        setattr(one, name, begun)
    try:
        yield
    finally:
        for (one, name), before in zip(ways, kept, strict=True):
            setattr(one, name, before)


def _answer(asked: dict[str, Any]) -> dict[str, Any]:
    from typer.testing import CliRunner

    from legfem.__main__ import command
    from legfem.common.errors import InputError

    words, folder = asked["words"], asked["folder"]
    try:
        # A preview solves nothing, and says what it reads.
        with nullcontext() if "preview" in words else _until_work_begins():
            if asked["how"] == "command":
                run = CliRunner().invoke(command(words[0]), words[1:])
                if isinstance(run.exception, SystemExit) or run.exception is None:
                    return {"status": run.exit_code, "told": run.stderr, "printed": run.stdout}
                raise run.exception
            if asked["how"] == "upload":
                return _uploaded(words[0], Path(folder))
            try:
                _called(words[0], int(words[1]), folder)
            except InputError as error:
                return {"status": 2, "told": f"{error}\n" + ("" if error.remedy else "no remedy\n"), "printed": ""}
            return {"status": 0, "told": "", "printed": ""}
    except _Accepted:
        return {"status": 0, "told": "", "printed": "accepted"}
    except Exception:
        return {"status": -1, "told": traceback.format_exc(), "printed": ""}


def _called(name: str, seed: int, folder: str) -> None:
    """Call the front door with one odd argument."""
    import legfem as lf

    rng, call = np.random.default_rng(seed), getattr(lf, name)
    odd = [
        None,
        -1,
        0,
        np.nan,
        np.inf,
        "x",
        [],
        {},
        b"\xff",
        ("a", 1),
        1e300,
        object(),
        True,
        "é\ud800",
        Path("/dev/zero"),
    ]
    names = [p for p in inspect.signature(call).parameters if p not in ("jobs", "progress", "on")]
    given: dict[str, Any] = {"out": folder + "-out"} if name == "cohort" else {}
    first, chosen = names[0], names[int(rng.integers(len(names)))]
    value = odd[int(rng.integers(len(odd)))]
    if name == "cohort":
        given["dry_run"] = True
    call(value if chosen == first else folder, **({chosen: value} if chosen != first else {}) | given)


SERVED: list[Any] = []


def _uploaded(place: str, path: Path) -> dict[str, Any]:
    """Send a file to the app, and look at its page."""
    from starlette.testclient import TestClient

    from legfem.app.guard import Guard
    from legfem.app.server import application
    from legfem.app.workspace import Workspace

    if not SERVED:
        workspace = Workspace.opened(Path(tempfile.mkdtemp()))
        visitor = TestClient(Guard(application(workspace), "a secret", 8765), "http://127.0.0.1:8765")
        visitor.__enter__()
        visitor.get("/", params={"token": "a secret"})
        SERVED.extend([workspace, visitor])
    _, visitor = SERVED
    name = visitor.post("/inputs", json={"name": "sent"}).json()["name"]
    sent = visitor.put(f"/inputs/{name}/{place}", content=path.read_bytes())
    page = visitor.get(f"/input/{name}")
    refused = sent.status_code in (400, 404, 405, 307)
    if page.status_code != 200 or not (refused or sent.status_code == 204):
        return {"status": -1, "told": f"{sent.status_code} {sent.text[:500]} {page.status_code}", "printed": ""}
    return {"status": 2 if refused else 0, "told": "refused: by the server; send it elsewhere\n", "printed": ""}


def serve() -> None:
    """Answer lines until there are no more."""
    answers = os.fdopen(os.dup(1), "w")
    # What libraries print by themselves is no answer.
    null = os.open(os.devnull, os.O_WRONLY)
    os.dup2(null, 1)
    os.dup2(null, 2)
    # What takes long to load is no input's fault.
    from legfem import api  # noqa: F401
    from legfem.__main__ import COMMANDS, command
    from legfem.experiments import plane_strain  # noqa: F401
    from legfem.stockings import equilibrium  # noqa: F401

    for name in COMMANDS:
        command(name)
    print("ready", file=answers, flush=True)
    for line in sys.stdin:
        print(json.dumps(_answer(json.loads(line))), file=answers, flush=True)


if __name__ == "__main__":
    serve()
