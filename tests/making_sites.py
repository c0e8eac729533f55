"""A leg in closed form that is pressed at three sites, and its folder."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from making import TOML, leg, press, write_contours, write_recording
from making_identification import DEPTH, AnalyticLeg, pressed_leg

from legfem.data import Recording
from legfem.inverse.outcome import JointForward, Outcome
from legfem.legs.subject import SitedLeg

SITES = ("back", "medial", "low")
FACTORS = (1.0, 0.8, 1.3)
"""Of the closed form's forces, by site."""
SITE_TABLES = """
[[site]]
name = "back"

[[site]]
name = "medial"
[site.indenter]
direction_deg = 180.0
"""


@dataclass
class SiteLeg(AnalyticLeg):
    """One of the sites."""

    factor: float = 1.0

    def prepare(self) -> None:
        """There is no mesh."""

    def solve(self, values: Mapping[str, float], sensitivities: Sequence[str]) -> Outcome:
        solved = super().solve(values, sensitivities)
        curve = solved.curve
        by = {name: self.factor * each for name, each in curve.sensitivities.items()}
        scaled = replace(curve, force=self.factor * curve.force, sensitivities=by)
        return replace(solved, curves=(scaled,))


def sited_leg(
    folder: Path,
    c10: float | Sequence[float],
    c20: float = 0.0,
    seed: int = 0,
    noise: float = 0.03,
    gain_sd: float = 0.0,
) -> SitedLeg:
    """Return a leg of three sites with recordings; C10 may be each site's own (kPa)."""
    generator = np.random.default_rng([seed, 7])
    sites = []
    for k, (name, factor) in enumerate(zip(SITES, FACTORS, strict=True)):
        own = c10 if isinstance(c10, float) else c10[k]
        gain = factor * (1 + gain_sd * generator.standard_normal())
        subject = pressed_leg(folder, own, c20, 10 * seed + k, noise=noise / factor)
        trials = tuple(_scaled(trial, gain) for trial in subject.recordings)
        sites.append(replace(subject, recordings=trials, site=name, id=f"leg-{name}"))
    return SitedLeg("leg", "Closed form", tuple(sites), folder)


def sites_model(depth: float = DEPTH + 0.5) -> JointForward:
    """Return the model of the leg."""
    models = tuple(SiteLeg(depth=depth, factor=factor) for factor in FACTORS)
    return JointForward(models)  # type: ignore[arg-type]


def write_sites(folder: Path, tables: str = SITE_TABLES, names: Sequence[str] = SITES[:2]) -> Path:
    """Write a subject's folder with several sites."""
    folder.mkdir(parents=True, exist_ok=True)
    (folder / "subject.toml").write_text(TOML + tables)
    write_contours(folder / "contours.csv", leg())
    for k, name in enumerate(names):
        recording = press(force_sd=0.03, displacement_sd=0.02, seed=k)
        write_recording(folder / "recordings" / name / "trial1.csv", recording)
    return folder


def _scaled(trial: Recording, factor: float) -> Recording:
    return replace(trial, force=factor * trial.force)
