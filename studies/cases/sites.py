"""One planted leg: its sites together, and each by itself."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from legfem.common.documents import markdown_table
from legfem.inverse.catalogue import DEEP_C10, DEEP_C20, LawName, Values, parameter_of
from legfem.inverse.estimates import Estimate
from legfem.inverse.outcome import JointForward, Outcome
from legfem.inverse.parameter import Parameter, Prior
from legfem.inverse.settings import SearchRequest
from legfem.jobs.store import Store
from legfem.legs.forward import PlaneStrainForward
from legfem.legs.identification import fit_leg
from legfem.legs.problem import section_forward
from studies.cases.machine import Kind
from studies.cases.outcomes import Interval, Rate
from studies.cases.sites_draw import FAT_FACTOR, Truth, leg_of, truths

FAT = "superficial.C10"
PARAMETERS = (DEEP_C10, DEEP_C20)
_LAW: tuple[LawName, ...] = ("reduced-polynomial",)


@dataclass(frozen=True)
class FoundLeg:
    """What was found of one leg."""

    truth: Truth
    together: dict[str, Interval]
    """By the parameter's full name."""
    alone: dict[str, dict[str, Interval]]
    """By site."""
    agreement_p: float
    solves: int
    converged: bool

    def best_alone(self, name: str) -> Interval:
        """Return the narrowest interval of a parameter from one site."""
        return min((one[name] for one in self.alone.values()), key=lambda one: one.width)


@dataclass(eq=False)
class Remembered(PlaneStrainForward):
    """A site's model whose solves are kept, so that both ways of identifying share them."""

    kept: Path = Path()

    @classmethod
    def of(cls, model: PlaneStrainForward, kept: Path) -> Remembered:
        """Return a model with a memory."""
        return cls(model.experiment, model.depth, kept)

    def solve(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """Return what is kept, or solve."""
        store = Store(self.kept, Outcome, self.fingerprint())
        asked: Any = (dict(values), tuple(sensitivities))
        return store.get_or_make(asked, lambda: super(Remembered, self).solve(*asked))


def identified(folder: Path, truth: Truth) -> FoundLeg:
    """Record a leg, and identify it from its sites together and from each."""
    leg = leg_of(truth, folder / "true")
    models = [Remembered.of(one, folder / "solves") for one in section_forward(leg, SearchRequest()).models]
    request = SearchRequest(_free(models[0].nominal))
    (joint,) = fit_leg(leg, _LAW, request, forward=JointForward(tuple(models)))
    alone = {}
    for site, model in zip(leg.sites, models, strict=True):
        (single,) = fit_leg(site, _LAW, request, forward=JointForward((model,)))
        alone[site.site] = _intervals(single.estimates)
    return FoundLeg(
        truth,
        _intervals(joint.estimates),
        alone,
        joint.agreement.p_value,
        joint.log.forward_solves,
        joint.log.converged,
    )


def _free(nominal: Values) -> tuple[Parameter, ...]:
    """Return C10 and C20, and the fat's stiffness as a nuisance known to a factor."""
    deep = [parameter_of(name, nominal) for name in PARAMETERS]
    prior = Prior(nominal[FAT], np.log(FAT_FACTOR) / np.sqrt(3), "log", "the study's draws")
    return (*deep, replace(parameter_of(FAT, nominal), role="nuisance", prior=prior))


def _intervals(found: Mapping[str, Estimate]) -> dict[str, Interval]:
    return {name: Interval.of(found[name]) for name in (*PARAMETERS, FAT)}


def page(found: Sequence[FoundLeg]) -> str:
    """Return the table of legs, and what all of them say."""
    rows = []
    for one in found:
        truth = _truths(one.truth)
        cells = [f"{one.truth.number}", "felupe" if one.truth.by_other_code else "legfem, finer"]
        for name in PARAMETERS:
            both = one.together[name], one.best_alone(name)
            cells += [f"{truth[name]:.3f}", *(own.ends(truth[name]) for own in both)]
        rows.append([*cells, f"{one.agreement_p:.2f}"])
    head = ["leg", "pressed by"]
    for name in ("C10", "C20"):
        head += [f"{name} (kPa)", "three sites", "best single site"]
    lines = [markdown_table([*head, "p of agreement"], rows), ""]
    lines.append("A star marks an interval (95 %) that misses. Simulated data.")
    for name in (*PARAMETERS, FAT):
        lines.append("")
        lines.append(_summary(found, name))
    return "\n".join(lines) + "\n"


def _summary(found: Sequence[FoundLeg], name: str) -> str:
    ratios = [one.together[name].width / one.best_alone(name).width for one in found]
    joint = [one.together[name].covers(_truths(one.truth)[name]) for one in found]
    single = [alone[name].covers(_truths(one.truth)[name]) for one in found for alone in one.alone.values()]
    narrower = sum(ratio < 1 for ratio in ratios)
    return (
        f"{name}: joint intervals cover {Rate(sum(joint), len(joint))}, those of single sites "
        f"{Rate(sum(single), len(single))}; the joint one is narrower than the best single one in "
        f"{narrower} of {len(ratios)}, {np.median(ratios):.2f} of its width in the median "
        f"({min(ratios):.2f} to {max(ratios):.2f})."
    )


def _truths(truth: Truth) -> dict[str, float]:
    return dict(zip((*PARAMETERS, FAT), (truth.c10, truth.c20, truth.fat), strict=True))


def _line(truth: Truth, one: FoundLeg) -> str:
    return f"leg {truth.number}: C10 {truth.c10:.3f} -> {one.together[DEEP_C10].value:.3f} kPa"


KIND = Kind("legs pressed at three sites, together and each", 10, truths, identified, FoundLeg, _line, page)
