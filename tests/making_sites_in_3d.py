"""A leg's sites in 3D in closed form, stiffened by fibres."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from making_identification import DEPTH, AnalyticLeg, pressed_leg

from legfem.data import Recording
from legfem.inverse.catalogue import DEEP_C10, DEEP_RATIO
from legfem.inverse.fibre_ratio import slopes_at_ratio
from legfem.inverse.outcome import Outcome, needed_for, through
from legfem.legs.model_3d import LegModels
from legfem.legs.placement import spatial_leg
from legfem.legs.subject import SitedLeg

RISES = {"along": 0.06, "across": 0.12}
"""Of the force a unit of the fibres' ratio, by how the cylinder lies."""
IN_TENSION = 0.3
"""Share of that which is fibres' in tension."""
TRUE_C10, TRUE_RATIO = 1.3e-3, 2.2


@dataclass
class FibrousLeg(AnalyticLeg):
    """The closed form, stiffened by fibres: shear and tension each by a share of C10."""

    rise: float = 0.06
    level: float = 0.0
    """Share by which its force is off."""
    start: float | None = 2.0
    """Ratio at which a search begins; None without fibres."""

    @property
    def nominal(self) -> Mapping[str, float]:
        own = {} if self.start is None else {DEEP_RATIO: self.start}
        return {**super().nominal, **own}

    def fingerprint(self) -> Mapping[str, Any]:
        return {"model": "fibrous", "rise": self.rise, "level": self.level}

    def solve(self, values: Mapping[str, float], sensitivities: Sequence[str]) -> Outcome:
        every = {DEEP_RATIO: 1.0, **self.nominal, **values}
        ratio, c10 = every[DEEP_RATIO], every[DEEP_C10]
        plain = (*dict.fromkeys([n for n in sensitivities if "fibre" not in n] + [DEEP_C10]),)
        found = super().solve(values, plain)
        force, by = found.curve.force, dict(found.curve.sensitivities)
        # Per MPa of shear and of extension, which is four times that.
        shear = self.rise * (1 - IN_TENSION) / (2 * c10) * force
        extension = self.rise * IN_TENSION / (8 * c10) * force
        factor = 1 + self.rise * (ratio - 1)
        by = {name: factor * each for name, each in by.items()}
        # Fibres' moduli stay: their share of the force doesn't grow with C10.
        by[DEEP_C10] = by[DEEP_C10] - self.rise * (ratio - 1) / c10 * force
        by |= {"deep.fibres.shear": shear, "deep.fibres.extension": extension}
        chain = {name: slopes_at_ratio(name, every, ["deep"]) for name in sensitivities}
        curve = replace(
            found.curve,
            force=(1 + self.level) * factor * force,
            sensitivities={n: (1 + self.level) * v for n, v in by.items() if n in needed_for(chain)},
        )
        return replace(found, curves=(through(chain, curve),))


def leg_of(folder: Path, ways: Sequence[str], seed: int = 0, ratio: float = TRUE_RATIO) -> SitedLeg:
    """Return a leg pressed in several ways, with a lab's simplest errors."""
    sites = []
    for number, way in enumerate(ways):
        truth = FibrousLeg(rise=RISES[way]).solve({DEEP_C10: TRUE_C10, DEEP_RATIO: ratio}, ())
        rng = np.random.default_rng([seed, number])
        subject = pressed_leg(folder, 1.3, 0.0, seed)
        trials = tuple(
            Recording(
                one.time,
                one.displacement,
                truth.curve(0.4 * one.time.clip(max=DEPTH / 0.4)) + 0.03 * rng.standard_normal(len(one.time)),
                one.trial,
            )
            for one in subject.recordings
        )
        turn = 90.0 if way == "across" else 0.0
        sites.append(
            replace(
                subject,
                recordings=trials,
                plane_strain=False,
                site=way,
                indenter=replace(subject.indenter, axis_deg=turn),
            )
        )
    return SitedLeg("leg", "Closed form", tuple(sites), folder)


def models_of(
    leg: SitedLeg, kept: Path | None = None, kind: type[FibrousLeg] = FibrousLeg, **more: Any
) -> list[LegModels]:
    shape = spatial_leg(replace(leg.sites[0], site=""))
    found = []
    for site in leg.sites:
        rise = RISES[site.site]
        full, rough, shorter = (kind(rise=rise, level=level, **more) for level in (0.0, 4e-3, 5e-3))
        found.append(LegModels(full, rough, shorter, shape, DEPTH, kept))
    return found


def models_as_deep_as_asked() -> Callable[..., list[LegModels]]:
    """Return what takes the place of `legfem.legs.model_3d.leg_models`."""

    def models(leg: SitedLeg, depths: Sequence[float], *_: Any) -> list[LegModels]:
        depth = max(depths)
        shape = spatial_leg(leg.sites[0])
        return [
            LegModels(*(FibrousLeg(rise=rise, depth=depth) for _ in range(3)), shape, depth)
            for rise in (0.06, 0.12)[: len(leg.sites)]
        ]

    return models
