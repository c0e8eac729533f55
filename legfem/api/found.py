"""What every result has: the same ways to look at it."""

from __future__ import annotations

import html
from abc import ABC, abstractmethod
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any, Protocol

from legfem.inverse.laws import LawName

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from legfem.report.web.page import WebPage


class Found(ABC):
    """What was found in a leg: the same five ways to look at it for all that is found."""

    @abstractmethod
    def summary(self) -> str:
        """Return what a person reads first."""

    @abstractmethod
    def document(self) -> Any:
        """Return everything as JSON types, every number with its unit."""

    @abstractmethod
    def plot(self) -> Figure:
        """Return the figure that shows most."""

    @abstractmethod
    def write(self, folder: str | Path) -> Path:
        """Write report, figures and numbers into a folder; return the report's path."""

    @abstractmethod
    def _rows(self) -> Iterator[dict[str, Any]]:
        """Yield a row a parameter."""

    def to_frame(self) -> pd.DataFrame:
        """Return the parameters: a row each, with value, 95 % interval and unit."""
        import pandas as pd

        return pd.DataFrame(list(self._rows()))

    @abstractmethod
    def _page(self) -> WebPage:
        """Return what ``report.html`` shows."""

    def _repr_html_(self) -> str:
        """Return the parameters and the report's page for a notebook, its curves and leg alive."""
        from legfem.report.web.page import rendered

        page = self._page()
        table = self.to_frame().to_html(index=False, na_rep="", float_format="{:.4g}".format)
        return (
            f'{table}<iframe title="{html.escape(page.title, quote=True)}" '
            'sandbox="allow-scripts" style="width: 100%; height: 640px; border: 1px solid #c8c8c8" '
            f'srcdoc="{html.escape(rendered(page), quote=True)}"></iframe>'
        )


class OfLaw(Protocol):
    """What belongs to one law."""

    @property
    def law(self) -> str:
        """Its name."""


class ByLaw[Result: OfLaw](Found):
    """Results of one identification, one a law."""

    results: tuple[Result, ...]

    @abstractmethod
    def _document_of(self, result: Result) -> dict[str, Any]:
        """Return what ``result.json`` holds of a law."""

    def document(self) -> list[dict[str, Any]]:
        """Return what ``result.json`` holds, one a law."""
        return [self._document_of(result) for result in self.results]

    def __getitem__(self, law: LawName) -> Result:
        """Return a law's result; raises KeyError for one that wasn't identified."""
        found = {result.law: result for result in self.results}
        if law not in found:
            raise KeyError(f"{law!r} was not identified: there is {', '.join(found)}")
        return found[law]

    def _rows(self) -> Iterator[dict[str, Any]]:
        for found in self.document():
            for name, entry in found["parameters"].items():
                yield {"law": found["law"]} | row(name, entry)


def row(name: str, entry: Mapping[str, Any]) -> dict[str, Any]:
    """Return a parameter's row of a table, of its entry in a document."""
    low, high = entry.get("ci95") or (None, None)
    return {
        "parameter": name,
        "value": entry["value"],
        "low": low,
        "high": high,
        "unit": entry["unit"],
        "identifiability": entry.get("identifiability"),
    }
