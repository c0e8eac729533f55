"""The numbers of an identification, and where each comes from."""

from __future__ import annotations

from collections.abc import Sequence
from math import isfinite, nan

import numpy as np

from legfem.geometry.section import girth
from legfem.identify.result import IdentificationResult
from legfem.inverse.catalogue import symbol_of
from legfem.inverse.intervals import NUMERICAL_ERROR
from legfem.legs.details import SpatialEvidence
from legfem.legs.experiments import tissues_of
from legfem.legs.forward import values_of
from legfem.legs.subject import Subject
from legfem.report.style import LAW_NAMES
from legfem.report.web.elastography import wave_rows
from legfem.report.web.estimates import estimated, held_text, words_of
from legfem.report.web.page import Known, Provenance


def known_of(results: Sequence[IdentificationResult], subject: Subject) -> list[Known]:
    """Return what was found with each law, what was held, and what was measured."""
    first = results[0]
    data = subject.origin
    curve = first.measured
    rows = [
        estimated(f"{words_of(name)}, {LAW_NAMES[result.law]} law", found, curve.n_trials)
        for result in reversed(results)
        for name, found in result.parameters.items()
    ]
    given = values_of(tissues_of(subject))
    free = {name for result in results for name in result.parameters}
    held = {n: v for result in results for n, v in result.assumed.items() if n not in free}
    for name, value in held.items():
        stated = np.isclose(given.get(name, np.nan), value)
        source = "subject.toml" if stated else "given with the command, or the law's own"
        rows.append(Known(words_of(name), held_text(name, value), "assumed", source, remark=_moved(name, results)))
    rows.append(Known("thickness of the fascia", f"{subject.section.fascia_thickness:g} mm", "assumed", "subject.toml"))
    rows += wave_rows(subject)
    if first.correction is not None:
        applied = first.correction
        rows.append(
            Known(
                f"3D correction P at {curve.displacement[-1]:.3g} mm",
                f"{applied.P[-1]:+.3f}",
                "prior",
                applied.name,
                f"{applied.P[-1] - 2 * applied.sd[-1]:+.3f} to {applied.P[-1] + 2 * applied.sd[-1]:+.3f}",
            )
        )
    if first.spatial is not None:
        rows += _of_leg_in_3d(first.spatial, float(curve.displacement[-1]))
    rows += [
        Known(
            "error of the numerical model",
            f"{100 * NUMERICAL_ERROR:g} % of the force (sd)",
            "prior",
            "study convergence",
        ),
        Known(
            "noise of a force reading",
            f"{curve.noise.force_sd:.3g} N (sd)",
            data,
            curve.noise.source,
            remark=f"correlated over {curve.noise.correlation_length:.2g} mm",
        ),
        Known("greatest displacement used", f"{curve.displacement[-1]:.4g} mm", data, "recordings, from first contact"),
        Known("girth of the section", f"{girth(subject.section):.0f} mm", data, "contours of the skin"),
        Known(
            "cylinder",
            f"{2 * subject.indenter.radius:g} mm across, {subject.indenter.length:g} mm long",
            "assumed",
            "subject.toml",
        ),
    ]
    return rows


def _of_leg_in_3d(found: SpatialEvidence, depth: float) -> list[Known]:
    """Return what the leg's own solves in 3D say."""
    source: Provenance = "assumed" if found.extruded else "measured"
    rows = [
        Known("leg in 3D", f"{found.length:.4g} mm long", source, found.shape),
        Known(
            "full solves in 3D",
            f"{found.full_solves} and {found.rough_solves} rougher ones",
            "computed",
            "; ".join(f"{100 * one.error:.2g} % off the predicted force" for one in found.confirmations),
        ),
    ]
    if found.table_P is not None:
        rows.append(
            Known(
                f"P at {depth:.3g} mm of the table's idealised legs",
                f"{found.table_P[-1]:+.3f}",
                "computed",
                "for comparison",
            )
        )
    return rows


def _moved(name: str, results: Sequence[IdentificationResult]) -> str:
    """Return what 10 % more of an assumed number would do to what was found off its bounds."""
    moved = [
        f"{symbol_of(found)} {100 * estimate.moves[name]:+.1f} % ({LAW_NAMES[result.law]})"
        for result in reversed(results)
        for found, estimate in result.parameters.items()
        if isfinite(estimate.moves.get(name, nan))
    ]
    return f"10 % higher: {', '.join(moved)}" if moved else ""
