"""Searches of one solver side by side: what they ask for is solved together."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import suppress

from legfem.identify.laws import model_values
from legfem.identify.misfit import Compared
from legfem.identify.search import Search


def run_together[Comparison: Compared](searches: Sequence[Search[Comparison]]) -> None:
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
