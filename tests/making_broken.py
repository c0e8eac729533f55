"""Ways in which a good subject folder goes wrong: as people do it, and at random."""

from __future__ import annotations

import re
import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd

from legfem.common.errors import InputError
from legfem.legs.loading import load_subject
from legfem.legs.plausibility import doubts_about
from legfem.legs.schema import SUBJECTS

type Change = Callable[[Path], None]


def copied(name: str, folder: Path) -> Path:
    """Return a copy of a subject that comes with legfem, called measured."""
    shutil.copytree(SUBJECTS.find(name), folder)
    replaced("origin = .*", 'origin = "measured"')(folder)
    return folder


def told(folder: Path) -> list[str]:
    """Return the fields that an error, or doubts, name in a folder."""
    try:
        return [doubt.field for doubt in doubts_about(load_subject(folder))]
    except InputError as error:
        assert "\n" not in str(error) and error.remedy
        return [error.field]


def replaced(pattern: str, by: str, table: str = "") -> Change:
    """Return a change of subject.toml, in one of its tables."""

    def change(folder: Path) -> None:
        path = folder / "subject.toml"
        head, mark, rest = path.read_text().partition(table) if table else ("", "", path.read_text())
        text, count = re.subn(pattern, by, rest, count=1)
        assert count, pattern
        path.write_text(head + mark + text)

    return change


def trials(folder: Path) -> list[Path]:
    return sorted((folder / "recordings").glob("*.csv"))


def columns(**factors: float) -> Change:
    """Return a change that multiplies columns of all recordings."""

    def change(folder: Path) -> None:
        for path in trials(folder):
            table = pd.read_csv(path)
            for name, factor in factors.items():
                table[name] *= factor
            table.to_csv(path, index=False)

    return change


def contours(factor: float) -> Change:
    def change(folder: Path) -> None:
        path = folder / "contours.csv"
        table = pd.read_csv(path)
        table[["x_mm", "y_mm"]] *= factor
        table.to_csv(path, index=False)

    return change


def copy_of_a_trial(folder: Path) -> None:
    shutil.copy(trials(folder)[0], folder / "recordings" / "z.csv")


def copy_moved_in_time_and_scaled(folder: Path) -> None:
    table = pd.read_csv(trials(folder)[0])
    table["time_s"] += 100.0
    table["force_N"] = 1.01 * table["force_N"] + 0.02
    table.to_csv(folder / "recordings" / "z.csv", index=False)


def _each(change_of: Callable[[pd.DataFrame], pd.DataFrame]) -> Change:
    def change(folder: Path) -> None:
        for path in trials(folder):
            change_of(pd.read_csv(path)).to_csv(path, index=False)

    return change


def counted(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(time_s=np.arange(len(table)))


def cut_off(table: pd.DataFrame) -> pd.DataFrame:
    return table.assign(force_N=table["force_N"].clip(upper=0.4 * table["force_N"].max()))


def copy_thinned(folder: Path) -> None:
    pd.read_csv(trials(folder)[0])[::2].to_csv(folder / "recordings" / "z.csv", index=False)


def copy_resampled(folder: Path) -> None:
    table = pd.read_csv(trials(folder)[0])
    time = np.linspace(table["time_s"].min(), table["time_s"].max(), len(table) + 37)
    others = {name: np.interp(time, table["time_s"], table[name]) for name in ("displacement_mm", "force_N")}
    copy = pd.DataFrame({"time_s": time, **others})
    copy.to_csv(folder / "recordings" / "z.csv", index=False)


def copy_of_another_kind(folder: Path) -> None:
    shutil.copy(trials(folder)[0], folder / "recordings" / "trial 4.txt")


def one_trial_times(factor: float) -> Change:
    def change(folder: Path) -> None:
        table = pd.read_csv(trials(folder)[1])
        table["force_N"] *= factor
        table.to_csv(trials(folder)[1], index=False)

    return change


def spiked(folder: Path) -> None:
    table = pd.read_csv(trials(folder)[1])
    table.loc[100, "force_N"] = 50.0
    table.to_csv(trials(folder)[1], index=False)


def spiked_contour(folder: Path) -> None:
    table = pd.read_csv(folder / "contours.csv")
    at = table.index[table["part"] == "skin"][17]
    table.loc[at, ["x_mm", "y_mm"]] *= 1.2
    table.to_csv(folder / "contours.csv", index=False)


def exchanged(one: str, other: str) -> Change:
    def change(folder: Path) -> None:
        path = folder / "contours.csv"
        table = pd.read_csv(path)
        table["part"] = table["part"].replace({one: other, other: one})
        table.to_csv(path, index=False)

    return change


def in_radians(folder: Path) -> None:
    text = (folder / "subject.toml").read_text()
    degrees = float(re.search(r"direction_deg = ([\d.]+)", text)[1])
    replaced(r"direction_deg = [\d.]+", f"direction_deg = {np.deg2rad(degrees):.6f}")(folder)


SILENTLY_WRONG: dict[str, tuple[Change, str]] = {
    "force in kgf": (columns(force_N=1 / 9.80665), "force_N"),
    "force in mN": (columns(force_N=1e3), "force_N"),
    "force in gf": (columns(force_N=1e3 / 9.80665), "force_N"),
    "force in kN": (columns(force_N=1e-3), "force_N"),
    "displacement in m": (columns(displacement_mm=1e-3), "displacement_mm"),
    "displacement in cm": (columns(displacement_mm=0.1), "displacement_mm"),
    "displacement in micrometres": (columns(displacement_mm=1e3), "displacement_mm"),
    "time in ms": (columns(time_s=1e3), "time_s"),
    "time in minutes": (columns(time_s=1 / 60), "time_s"),
    "time is the sample's number": (_each(counted), "time_s"),
    "force cut off": (_each(cut_off), "force_N"),
    "displacement from another zero": (
        _each(lambda table: table.assign(displacement_mm=table["displacement_mm"] + 100.0)),
        "displacement_mm",
    ),
    "a file that isn't read": (copy_of_another_kind, "recordings"),
    "a trial copied and thinned": (copy_thinned, "force_N"),
    "a trial copied and resampled": (copy_resampled, "force_N"),
    "length in cm": (replaced("length_mm = 50.0", "length_mm = 5.0"), "indenter.length_mm"),
    "radius for diameter": (replaced("r_mm = 30.0", "r_mm = 15.0"), "indenter.diameter_mm"),
    "diameter for radius": (replaced("r_mm = 30.0", "r_mm = 60.0"), "indenter.diameter_mm"),
    "direction in radians": (in_radians, "indenter.direction_deg"),
    "aim at the edge": (replaced(r"aim_mm = \[.*?\]", "aim_mm = [45.0, 0.0]"), "indenter.aim_mm"),
    "fat of 2000 kPa": (replaced("C10_kPa = 2.0", "C10_kPa = 2000.0"), "tissues.superficial.C10_kPa"),
    "fat in MPa": (replaced("C10_kPa = 2.0", "C10_kPa = 0.002"), "tissues.superficial.C10_kPa"),
    "fascia in MPa": (replaced("C10_kPa = 100.0", "C10_kPa = 0.1"), "tissues.fascia.C10_kPa"),
    "deep D1 of 5000": (replaced("D1_per_MPa = 28.0", "D1_per_MPa = 5000.0"), "tissues.deep.D1_per_MPa"),
    "fat's D1 of 800": (replaced("D1_per_MPa = 22.5", "D1_per_MPa = 800.0"), "tissues.superficial.D1_per_MPa"),
    "fascia's thickness in m": (
        replaced(r"thickness_mm = [\d.]+", "thickness_mm = 0.0006"),
        "section.fascia_thickness_mm",
    ),
    "contours halved": (contours(0.5), "section.contours"),
    "contours times 0.7": (contours(0.7), "section.contours"),
    "contours doubled": (contours(2.0), "section.contours"),
    "a skin with a spike": (spiked_contour, "section.contours"),
    "a reading with a spike": (spiked, "force_N"),
    "contours in cm": (contours(0.1), "x_mm, y_mm"),
    "contours in micrometres": (contours(1e3), "x_mm, y_mm"),
    "skin and fascia exchanged": (exchanged("skin", "fascia"), "fascia"),
    "a trial copied": (copy_of_a_trial, "force_N"),
    "a trial copied, moved and scaled": (copy_moved_in_time_and_scaled, "force_N"),
    "a trial twice as stiff": (one_trial_times(2.0), "force_N"),
    "a trial in kgf": (one_trial_times(1 / 9.80665), "force_N"),
}
"""What a person would see, and the field that has to be named."""


def _characters(rng: np.random.Generator, text: str) -> str:
    at, odd = int(rng.integers(len(text))), str(rng.choice(list("[]{}=\"'.,;#-\n\t\0é9eN")))
    end = at + int(rng.integers(0, 4))
    return text[:at] + odd * int(rng.integers(0, 3)) + text[end:]


def _number(rng: np.random.Generator, text: str) -> str:
    found = list(re.finditer(r"-?\d+\.?\d*", text))
    if not found:
        return text
    one = found[int(rng.integers(len(found)))]
    value = float(one[0])
    choices = [value * 10.0 ** int(rng.integers(-6, 7)), -value, 0.0, np.nan, np.inf, 1e300, 1e-300, value + 1e9]
    by = str(choices[int(rng.integers(len(choices)))])
    by = str(rng.choice([by, by, by, '"text"', "", "1,5", "[1, 2]", "true", "0x", "[" * 3000]))
    return text[: one.start()] + by + text[one.end() :]


def _lines(rng: np.random.Generator, text: str) -> str:
    lines = text.splitlines()
    at = int(rng.integers(len(lines)))
    other = int(rng.integers(len(lines)))
    match int(rng.integers(6)):
        case 0:
            del lines[at:other]
        case 1:
            lines.insert(at, lines[other])
        case 2:
            lines[at], lines[other] = lines[other], lines[at]
        case 3:
            lines = lines[:at]
        case 4:
            lines = lines[:1] + lines[:0:-1]
        case 5:
            lines[at] = lines[at].replace(",", ";").replace(".", ",")
    return "\n".join(lines)


def _bytes(rng: np.random.Generator, text: str) -> bytes:
    match int(rng.integers(5)):
        case 0:
            return b""
        case 1:
            return rng.bytes(500)
        case 2:
            return text.encode("utf-16")
        case 3:
            return text.encode()[: int(rng.integers(len(text)))]
        case _:
            return b"\xef\xbb\xbf" + text.replace("\n", "\r\n").encode()


def _scaled(rng: np.random.Generator, text: str) -> str:
    """Multiply a column by a power of ten, or by -1, or shift it."""
    rows = [line.split(",") for line in text.splitlines()]
    column = int(rng.integers(len(rows[0])))
    factor = float(rng.choice([-1.0, 0.0, *10.0 ** np.arange(-6, 7)]))
    shift = float(rng.choice([0.0, 0.0, 1e3, -1e3]))
    for row in rows[1:]:
        try:
            row[column] = str(factor * float(row[column]) + shift)
        except (ValueError, IndexError):
            continue
    return "\n".join(",".join(row) for row in rows)


def broken_at_random(folder: Path, seed: int) -> str:
    """Break one file of a leg's folder in one to three ways; return what was done."""
    rng = np.random.default_rng(seed)
    files = [folder / "subject.toml", folder / "contours.csv", *trials(folder)]
    path = files[int(rng.choice(len(files), p=[0.4, 0.3, *[0.3 / (len(files) - 2)] * (len(files) - 2)]))]
    return broken_text(path, rng)


def broken_text(path: Path, rng: np.random.Generator) -> str:
    """Break a TOML file or a table in one to three ways; return what was done."""
    done = [path.name]
    for _ in range(int(rng.integers(1, 4))):
        text = path.read_text()
        ways = [_characters, _number, _number, _lines]
        way = ways[int(rng.integers(4))] if path.suffix == ".toml" else [*ways, _scaled, _scaled][int(rng.integers(6))]
        if text:
            path.write_text(way(rng, text))
            done.append(way.__name__)
    if rng.random() < 0.1 and path.read_text():
        path.write_bytes(_bytes(rng, path.read_text()))
        done.append("bytes")
    return " ".join(done)


def broken_bytes(path: Path, rng: np.random.Generator) -> str:
    """Cut a file, or change some of its bytes, of its head mostly; return what was done."""
    kept = bytearray(path.read_bytes())
    way = int(rng.integers(5))
    if way == 0:
        del kept[int(rng.integers(len(kept))) :]
    elif way == 1:
        at = int(rng.integers(len(kept)))
        del kept[at : at + int(rng.integers(1, 40))]
    else:
        ends = len(kept) if way == 2 else min(400, len(kept))
        for at in rng.integers(ends, size=int(rng.integers(1, 9))):
            kept[at] = int(rng.choice([0, 1, 127, 128, 255, int(rng.integers(256))]))
    path.write_bytes(kept)
    return f"{path.name} bytes {way}"
