"""Tables of stretch and stress without a time: of known laws, and published ones of rubber."""

from __future__ import annotations

from pathlib import Path

import numpy as np

KGF_PER_CM2 = 0.0980665
"""MPa."""
TRELOAR_UNIAXIAL = KGF_PER_CM2 * np.array([0.0, 0.26, 1.37, 2.30, 3.23, 4.16, 5.10])
TRELOAR_UNIAXIAL_STRETCH = np.array([1.0, 1.02, 1.125, 1.24, 1.39, 1.585, 1.90])
TRELOAR_BIAXIAL = KGF_PER_CM2 * np.array([0.0, 0.95, 1.60, 2.42, 2.62, 3.32, 4.43, 5.18])
TRELOAR_BIAXIAL_STRETCH = np.array([1.0, 1.03, 1.07, 1.12, 1.14, 1.20, 1.31, 1.42])
"""Nominal stress (MPa) of vulcanised natural rubber with 8 parts of sulphur, its beginning: L. R. G. Treloar, Trans.
Faraday Soc. 40 (1944) 59-70, as read off its figures in felupe's documentation (A. Dutzler)."""


def write_table(folder: Path, header: str, *columns: np.ndarray, name: str = "a") -> Path:
    """Write a table of columns under a header."""
    (folder / "recordings").mkdir(parents=True, exist_ok=True)
    path = folder / "recordings" / f"{name}.csv"
    np.savetxt(path, np.column_stack(columns), "%.7g", ",", header=header, comments="")
    return folder


def described(folder: Path, test: str, table: str = "") -> Path:
    """Write ``specimen.toml`` for a test's table and the line of [recordings]."""
    recordings = f"[recordings]\n{table}\n" if table else ""
    text = f'id = "table"\ntitle = "Made for a test"\norigin = "measured"\n{test}\n{recordings}'
    (folder / "specimen.toml").write_text(text)
    return folder


def line_in(error: object) -> str:
    """Return the line of TOML with which a refusal ends."""
    return "table = {" + str(error).rpartition("table = {")[2]
