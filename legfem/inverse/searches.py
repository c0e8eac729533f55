"""Searches for several laws, run side by side, and whose limits are compared."""

import time
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Protocol

from legfem.inverse.catalogue import DEEP_C20, IdentifiedLaw, LawName, model_values
from legfem.inverse.comparison import Comparison
from legfem.inverse.least_squares import Residual
from legfem.inverse.outcome import FullSolver, Outcome, key_of_values
from legfem.inverse.parameter import Domain
from legfem.inverse.search import Search
from legfem.inverse.settings import IdentificationSettings
from legfem.inverse.trial import Linearised, Trial


def run_together[C: Comparison](searches: Sequence[Search[C]]) -> None:
    """Run searches of one solver side by side, which keeps all processes busy.

    What each finds doesn't depend on the others.
    """
    going = {k: search.asking() for k, search in enumerate(searches)}
    asked = {}
    for k, asking in going.items():
        with suppress(StopIteration):
            asked[k] = next(asking)
    while asked:
        points = [model_values(searches[k].law.values(point)) for k, (several, _) in asked.items() for point in several]
        searches[0].solver.solve(points)
        # Known by now, these cost nothing.
        answered = {k: searches[k].solve(*one) for k, one in asked.items()}
        asked = {}
        for k, trials in answered.items():
            with suppress(StopIteration):
                asked[k] = going[k].send(trials)


_MOST_REFINED = 6
"""Times that a comparison is made anew about what a search found."""
# C20 over its standard error below which the neo-Hookean limit is looked at by itself.
_NEAR_LIMIT = 3.0


@dataclass(frozen=True, eq=False)
class Found[C: Comparison]:
    """A law's finished search."""

    search: Search[C]
    best: Trial
    """The optimum, with a prediction: the law's own, or its neo-Hookean limit's."""
    neo_hookean_limit: bool
    wall_s: float

    @property
    def linear(self) -> Linearised:
        """The misfit about the optimum."""
        return self.search.linearised(self.best)

    @property
    def residual(self) -> Residual:
        """The weighted residual of points (p,), without further full solves."""
        return self.search.emulated().residual

    @property
    def trials(self) -> list[Trial]:
        """All full solves."""
        return [*self.search.trials, *([] if self.best in self.search.trials else [self.best])]

    @property
    def outcomes(self) -> list[Outcome]:
        """Outcomes of the solves; points that differ in the instrument only are read from one."""
        return list({key_of_values(one.outcome.values): one.outcome for one in self.trials}.values())

    @property
    def reused_solves(self) -> int:
        """How many of the solves an earlier run had kept."""
        return sum(key_of_values(one.values) in self.search.solver.reused for one in self.outcomes)


class Searched[C: Comparison](Protocol):
    """What searches need of a problem."""

    @property
    def unknowns(self) -> Mapping[LawName, IdentifiedLaw]:
        """What is free and held in each law."""

    def comparison(self, law: IdentifiedLaw, near: Found[C] | None = None) -> C:
        """Predictions beside the readings; by the errors about a finished search where there is one."""

    def refined(self, search: Search[C]) -> C | None:
        """Comparison made anew about what a search found, to search again; None where it stays as it is."""


@dataclass(eq=False)
class Searches[C: Comparison]:
    """Finds a problem's laws; solves of one law aren't repeated for another.

    Parameters
    ----------
    problem : Searched
        With what is free and what is held in each law.
    solver : FullSolver
        Of the forward model.
    settings : IdentificationSettings
        Of the search.
    near : Found, optional
        An earlier search about which readings are weighed, with whose solves that of the same law begins.
    refines : bool
        Whether a search goes on beside comparisons that are made anew about what it found, to the optimum itself; else
        it comes near that.
    """

    problem: Searched[C]
    solver: FullSolver
    settings: IdentificationSettings
    near: Found[C] | None = None
    refines: bool = True
    _searches: dict[LawName, Search[C]] = field(default_factory=dict, init=False)
    _seconds: dict[LawName, float] = field(default_factory=dict, init=False)

    def find(self, names: Sequence[LawName]) -> list[Found[C]]:
        """Return what was found of laws, in their order."""
        self._run(names)
        return [self._find(name) for name in names]

    def nearest(self, names: Sequence[LawName]) -> Found[C]:
        """Return what was found, near its optimum, of the law of most parameters."""
        most = max(names, key=lambda name: len(self.problem.unknowns[name].parameters))
        self._run([most])
        return self._find(most)

    def _find(self, name: LawName) -> Found[C]:
        search = self._search(name)
        best, k = search.best, search.law.index(DEEP_C20)
        # At the limit itself another search for it would end where this one did.
        reached = not self.refines and best.values.get(DEEP_C20) == 0.0
        if k is not None and "neo-hookean" in self.problem.unknowns and not reached:
            near = bool(best.point[k] <= _NEAR_LIMIT * search.standard_error()[k])
            if near or "neo-hookean" in self._searches:
                neo_hookean = search.reread(self._search("neo-hookean").best)
                best = min(neo_hookean, best, key=lambda one: one.objective)
        if limit := k is not None and best.values[DEEP_C20] == 0.0:
            search, best = _at_limit(search, best)
        return Found(search, best, limit, self._seconds[name])

    def _search(self, name: LawName) -> Search[C]:
        if name not in self._searches:
            self._run([name])
        return self._searches[name]

    def _run(self, names: Sequence[LawName]) -> None:
        """Search for laws side by side."""
        new = {name: replace(self._new(name), ends_near=True) for name in names}
        self.solver.progress.stage(f"identifying the {' and the '.join(new)} law")
        started = time.perf_counter()
        run_together(list(new.values()))
        if self.refines:
            # What is found by comparisons that are left again isn't worth the last solves.
            new = {name: self._refined(search) for name, search in new.items()}
            new = {name: replace(one, ends_near=False).beside(one.misfit) for name, one in new.items()}
            run_together(list(new.values()))
            new = {name: self._refined(search) for name, search in new.items()}
        spent = time.perf_counter() - started
        solves = sum(len(search.trials) for search in new.values())
        for name, search in new.items():
            self._searches[name] = search
            self._seconds[name] = spent * len(search.trials) / solves

    def _refined(self, search: Search[C]) -> Search[C]:
        """Return a search by the comparison that its own optimum leads to."""
        for _ in range(_MOST_REFINED):
            if (comparison := self.problem.refined(search)) is None:
                break
            search = search.beside(comparison)
            run_together([search])
        return search

    def _new(self, name: LawName) -> Search[C]:
        law, near = self.problem.unknowns[name], self.near
        misfit = self.problem.comparison(law, near)
        if near is not None and near.search.law.name == name:
            return replace(near.search, law=law, settings=self.settings).beside(misfit)
        # The limit of a law that ended at it begins there.
        if near is not None and near.best.values.get(DEEP_C20) == 0.0:
            law = replace(law, starts=(near.best.values,))
        return Search(law, misfit, self.settings, self.solver)


def _at_limit[C: Comparison](search: Search[C], best: Trial) -> tuple[Search[C], Trial]:
    """Return a search and its neo-Hookean limit, as points of the search's own law."""
    law = search.law
    parameters = tuple(
        replace(one, bounds=(0.0, one.bounds[1])) if one.name == DEEP_C20 else one for one in law.parameters
    )
    law = replace(law, parameters=parameters)
    if best not in search.trials:
        best = replace(best, point=Domain(parameters).inside(law.point({**law.fixed, **best.values})))
    return replace(search, law=law), best
