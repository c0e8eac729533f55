"""Whether planted stiffnesses are found again from simulated scans."""

from __future__ import annotations

import time
from dataclasses import dataclass
from pathlib import Path

from legfem.common.progress import Silent
from legfem.common.units import mpa_to_kpa
from legfem.stockings.loading import load_leg
from legfem.stockings.result import StockingResult, StockingSettings, run_leg
from legfem.stockings.search import StiffnessFit
from studies.stockings.truth import TRUTHS


@dataclass(frozen=True)
class Recovery:
    """A leg's planted values and what was found; C10 of muscle, then of fat, in kPa."""

    leg: str
    kind: str
    planted: tuple[float, float]
    found: tuple[float, float]
    low: tuple[float, float]
    high: tuple[float, float]
    solves: tuple[int, ...]
    """Of the weighted search, start by start."""
    starts_agree: bool
    """Whether all starts end within 5 % of one another."""
    rms_mm: float
    chi_square: float
    nelder_mead: tuple[float, float] | None
    nelder_mead_solves: int | None
    nelder_mead_cost: float | None
    registration_rms_mm: float
    cpu_s: float

    @property
    def covered(self) -> tuple[bool, bool]:
        """Whether the intervals hold the planted values."""
        muscle, fat = (low <= true <= high for low, true, high in zip(self.low, self.planted, self.high, strict=True))
        return muscle, fat

    def __str__(self) -> str:
        """Return a line that says what was found."""
        found = ", ".join(f"{value:.3g}" for value in self.found)
        planted = ", ".join(f"{value:.3g}" for value in self.planted)
        return f"found {found} kPa, planted {planted} kPa ({sum(self.solves)} solves)"


def recover(folder: Path, kind: str, settings: StockingSettings) -> Recovery:
    """Identify a leg."""
    started = time.process_time()
    result = run_leg(load_leg(folder), settings, Silent())
    return _recovery(result, kind, time.process_time() - started)


def _recovery(result: StockingResult, kind: str, seconds: float) -> Recovery:
    leg, best = result.leg, result.best
    assert best is not None and best.interval95 is not None and leg.registration is not None
    truth = TRUTHS[leg.id]
    weighted = [s for s in result.searches if s.method == "weighted"]
    simplex = next((s for s in result.searches if s.method == "nelder-mead"), None)
    low, high = mpa_to_kpa(best.interval95).T
    return Recovery(
        leg.id,
        kind,
        (truth.deep_kPa, truth.superficial_kPa),
        _kpa(best),
        (float(low[0]), float(low[1])),
        (float(high[0]), float(high[1])),
        tuple(search.solves for search in weighted),
        all(abs(s.parameters / best.parameters - 1).max() < 0.05 for s in weighted),
        best.rms,
        best.chi_square,
        None if simplex is None else _kpa(simplex),
        None if simplex is None else simplex.solves,
        None if simplex is None else simplex.cost,
        leg.registration.residual,
        seconds,
    )


def _kpa(search: StiffnessFit) -> tuple[float, float]:
    muscle, fat = mpa_to_kpa(search.parameters)
    return float(muscle), float(fat)
