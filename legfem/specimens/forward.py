"""A specimen's test as identification and diagnosis solve it: its tissues' numbers in, a curve or a failure out."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from legfem.experiments.axisymmetric import Layer
from legfem.experiments.experiment import Picklable, Solved, cached_in_process
from legfem.inverse.catalogue import Values, is_ratio
from legfem.inverse.fibre_ratio import moduli, ratio_of, slopes_at_ratio
from legfem.inverse.outcome import Chain, Outcome, needed_for, through
from legfem.jobs.store import code_fingerprint
from legfem.mechanics.materials import Hyperelastic
from legfem.mechanics.terms import Fibres
from legfem.solve.protocol import Protocol
from legfem.specimens.kind import AXES, SpecimenTest
from legfem.specimens.laws import ONE, SpecimenTissue
from legfem.specimens.sizes import Sizes


def experiment_of(sizes: Sizes, laws: Mapping[str, Hyperelastic], depth: float, fibrous: str = ONE) -> SpecimenTest:
    """Return the experiment with a test's sizes, its mesh and steps fit for a depth (mm).

    Laws are by the tissue's name, from the base up; that of a specimen of one is `legfem.specimens.laws.ONE`. Layers
    are seen by their own names. Fibres, if there are, are the named tissue's, and do nothing until their numbers are
    given.
    """
    pairs = zip(sizes.layers, laws.items(), strict=True) if sizes.layers else ()
    layers = tuple(Layer(name, thickness, law, called) for (called, thickness), (name, law) in pairs)
    model = sizes.kind.model(sizes.body, layers or laws[ONE], depth)
    return model if sizes.fibres is None else model.with_terms((Fibres(fibrous, axis=AXES[sizes.fibres]),))


@dataclass(frozen=True, eq=False)
class SpecimenForward(Picklable):
    """A test of tissues, a `legfem.inverse.outcome.Forward`.

    Parameters
    ----------
    sizes : Sizes
        Of the test.
    depth : float
        How deep it is pressed, mm.
    tissues : tuple of SpecimenTissue
        From the base up, each with its law. What is called incompressible is to stay so where a law stiffens far beyond
        its C10: below ``c10`` its bulk modulus doesn't fall with it.
    c10 : float
        Stiffness (MPa) of those that state none.
    terms : tuple
        Of mechanisms, beyond those of the test.
    """

    sizes: Sizes
    depth: float
    tissues: tuple[SpecimenTissue, ...]
    c10: float
    terms: tuple[Any, ...] = ()

    @property
    def laws(self) -> dict[str, Hyperelastic]:
        """Laws of the tissues, by name."""
        return {one.name: one.at(self.c10) for one in self.tissues}

    @property
    def _fibrous(self) -> dict[str, float]:
        """Shear modulus along over that across the fibres, of the tissue that has them."""
        return {one.name: one.fibre_ratio for one in self.tissues if one.fibrous}

    @cached_in_process
    def experiment(self) -> SpecimenTest:
        """Meshed when first solved, in whichever process."""
        test = experiment_of(self.sizes, self.laws, self.depth, next(iter(self._fibrous), ONE))
        return test.with_terms(self.terms)

    def prepare(self) -> None:
        """Mesh and compile now."""
        _ = self.experiment

    @property
    def nominal(self) -> Values:
        """The laws' numbers (MPa, 1/MPa) and the fibres' ratio by full name."""
        return {
            f"{tissue}.{name}": value for tissue, law in self.laws.items() for name, value in law.parameters.items()
        } | {ratio_of(tissue): ratio for tissue, ratio in self._fibrous.items()}

    def _least_stiffness(self, tissue: SpecimenTissue) -> float:
        """Stiffness C10 (MPa) below which the bulk modulus doesn't fall with it."""
        return 0.0 if tissue.poisson_ratio is not None else self.c10

    def with_compressibility(self, values: Values) -> dict[str, float]:
        """Return values with each D1 that isn't among them, as Poisson's ratio has it."""
        own = {**self.nominal, **values}
        missing = {
            f"{one.name}.D1": 1 / (one.bulk_ratio * max(own[f"{one.name}.C10"], self._least_stiffness(one)))
            for one in self.tissues
            if f"{one.name}.D1" not in values
        }
        return {**values, **missing}

    def solve(self, values: Values, sensitivities: Sequence[str]) -> Outcome:
        """Solve in full; a test that breaks down is an outcome that stops at once."""
        solved = self.follow(values, self.depth, sensitivities)
        return Outcome.of(values, solved.curve, solved.report)

    def follow(self, values: Values, protocol: Protocol | float, sensitivities: Sequence[str]) -> Solved:
        """Solve a protocol, or to a depth (mm).

        A derivative by a stiffness is that at the same Poisson's ratio where the values have no D1,
        and at the same ratio of the fibres.
        """
        every, fibrous = self.with_compressibility(values), self._fibrous
        own = {**self.nominal, **every}
        given = {name: value for name, value in every.items() if not is_ratio(name)} | moduli(own, fibrous)
        chain: Chain = {name: slopes_at_ratio(name, own, fibrous) for name in sensitivities}
        for one in self.tissues:
            c10, d1 = f"{one.name}.C10", f"{one.name}.D1"
            if c10 in chain and d1 not in values and own[c10] >= self._least_stiffness(one):
                chain = {**chain, c10: {**chain[c10], d1: -own[d1] / own[c10]}}
        try:
            solved = self.experiment.solve(given, protocol, needed_for(chain))
        except (ArithmeticError, ValueError, RuntimeError) as error:
            return Solved.nothing(" ".join(str(error).split()) or type(error).__name__, sensitivities)
        return replace(solved, curve=through(chain, solved.curve), path=through(chain, solved.path))

    def fingerprint(self) -> Mapping[str, Any]:
        """Return test, depth, tissues and code, that of its kind of test too."""
        code = code_fingerprint(type(self).__module__, type(self.sizes.kind).__module__)
        return {"model": "specimens", **super().fingerprint(), "code": code}
