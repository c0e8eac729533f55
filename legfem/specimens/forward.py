"""Models of specimens' tests: all of a folder that are fitted together, and one with what a diagnosis weighs."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

import numpy as np

from legfem.experiments.axisymmetric import Layer
from legfem.experiments.experiment import Picklable, Solved, cached_in_process
from legfem.inverse.catalogue import Values, is_ratio
from legfem.inverse.fibre_ratio import moduli, ratio_of, slopes_at_ratio
from legfem.inverse.outcome import Outcome, needed_for, through
from legfem.jobs.store import code_fingerprint
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.terms import Fibres
from legfem.solve.path import ForceCurve
from legfem.specimens.kind import AXES, SpecimenTest
from legfem.specimens.laws import ONE, SpecimenTissue
from legfem.specimens.sizes import Sizes


def experiment_of(
    sizes: Sizes,
    laws: Mapping[str, Hyperelastic],
    depth: float,
    fibrous: str = ONE,
    called: Mapping[str, str] = MappingProxyType({}),
) -> SpecimenTest:
    """Return the experiment with a test's sizes, its mesh and steps fit for a depth (mm).

    Laws are by the tissue's name; that of a specimen of one is `legfem.specimens.laws.ONE`. Tissues may be called
    otherwise by what sees them.
    Fibres, if there are, are the named tissue's, and do nothing until their numbers are given.
    """
    layers = tuple(Layer(name, thickness, laws[name], called.get(name, "")) for name, thickness in sizes.layers)
    model = sizes.kind.model(sizes.body, layers or laws[ONE], depth)
    return model if sizes.fibres is None else model.with_terms((Fibres(fibrous, axis=AXES[sizes.fibres]),))


@dataclass(frozen=True, eq=False)
class SpecimenForward(Picklable):
    """Tests of one tissue, a `legfem.inverse.outcome.Forward`.

    Parameters
    ----------
    tests : tuple
        Sizes, all different.
    depths : tuple of float
        How deep each is pressed, mm.
    laws : Mapping[str, Hyperelastic]
        Of the tissues, by name.
    bulk_ratios : Mapping[str, float]
        Bulk over shear modulus at small strain, by name.
    least_bulk : Mapping[str, float]
        Stiffness C10 (MPa) below which the bulk modulus doesn't fall with it, by name: what is
        called incompressible is to stay so where a law stiffens far beyond its C10.
    fibre_ratios : Mapping[str, float]
        Shear modulus along over that across the fibres, of the tissue that has them.
    """

    tests: tuple[Sizes, ...]
    depths: tuple[float, ...]
    laws: Mapping[str, Hyperelastic]
    bulk_ratios: Mapping[str, float]
    least_bulk: Mapping[str, float]
    fibre_ratios: Mapping[str, float] = field(default_factory=dict)

    @classmethod
    def of_tissues(
        cls, tests: tuple[Sizes, ...], depths: tuple[float, ...], tissues: Sequence[SpecimenTissue], c10: float
    ) -> "SpecimenForward":
        """Return the model of tissues whose stiffness is ``c10`` (MPa) if it isn't stated."""
        laws = {one.name: one.at(c10) for one in tissues}
        least = {one.name: 0.0 if one.poisson_ratio is not None else c10 for one in tissues}
        ratios = {one.name: one.fibre_ratio for one in tissues if one.fibrous}
        bulk = {one.name: one.bulk_ratio for one in tissues}
        return cls(tests, depths, laws, bulk, least, ratios)

    @cached_in_process
    def experiments(self) -> list[SpecimenTest]:
        """Meshed when first solved, in whichever process."""
        return [
            experiment_of(sizes, self.laws, depth, next(iter(self.fibre_ratios), ONE))
            for sizes, depth in zip(self.tests, self.depths, strict=True)
        ]

    def prepare(self) -> None:
        """Mesh and compile now."""
        _ = self.experiments

    @property
    def nominal(self) -> Values:
        """The law's numbers (MPa, 1/MPa) and the fibres' ratio by full name."""
        return {
            f"{tissue}.{name}": value for tissue, law in self.laws.items() for name, value in law.parameters.items()
        } | {ratio_of(tissue): ratio for tissue, ratio in self.fibre_ratios.items()}

    def with_compressibility(self, values: Values) -> dict[str, float]:
        """Return values with each D1 that isn't among them, as Poisson's ratio has it."""
        own = {**self.nominal, **values}
        missing = {
            f"{tissue}.D1": 1 / (ratio * max(own[f"{tissue}.C10"], self.least_bulk[tissue]))
            for tissue, ratio in self.bulk_ratios.items()
            if f"{tissue}.D1" not in values
        }
        return {**values, **missing}

    def solve(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """Solve every test in full; one that breaks down is an outcome that stops at once."""
        every = [self.solve_one(k, values, sensitivities) for k in range(len(self.tests))]
        return Outcome.joined(values, every)

    def solve_one(self, number: int, values: Values | None = None, sensitivities: Sequence[str] = ()) -> Outcome:
        """Solve one of the tests, at the nominal values if there are no others.

        A derivative by a stiffness is that at the same Poisson's ratio where the values have no D1,
        and at the same ratio of the fibres.
        """
        values = self.nominal if values is None else values
        every, fibrous = self.with_compressibility(values), self.fibre_ratios
        own = {**self.nominal, **every}
        given = {name: value for name, value in every.items() if not is_ratio(name)} | moduli(own, fibrous)
        chain = dict[str, dict[str, float]]()
        for name in sensitivities:
            chain[name] = slopes_at_ratio(name, own, fibrous)
            tissue, _, key = name.rpartition(".")
            d1 = f"{tissue}.D1"
            tied = tissue in self.bulk_ratios and d1 not in values
            if key == "C10" and tied and own[name] >= self.least_bulk[tissue]:
                chain[name][d1] = -own[d1] / own[name]
        try:
            solved: Solved = self.experiments[number].solve(given, self.depths[number], needed_for(chain))
        except (ArithmeticError, ValueError, RuntimeError, np.linalg.LinAlgError) as error:
            nothing = ForceCurve(np.zeros(1), np.zeros(1), dict.fromkeys(sensitivities, np.zeros(1)))
            reason = " ".join(str(error).split()) or type(error).__name__
            return Outcome(values, (nothing,), False, reason, 0, 0.0)
        return Outcome.of(values, through(chain, solved.curve), solved.report)

    @property
    def code(self) -> str:
        """Hash of the code that it runs, with that of its kinds of tests."""
        kinds = {type(sizes.kind).__module__ for sizes in self.tests}
        return code_fingerprint(type(self).__module__, *sorted(kinds))

    def fingerprint(self) -> Mapping[str, Any]:
        """Return tests, depths, law and code."""
        return {"model": "specimens", **super().fingerprint(), "code": self.code}
