"""The numbers of a diagnosis, and where each comes from."""

from __future__ import annotations

from legfem.data.recording import Origin
from legfem.geometry.section import girth
from legfem.inverse.mechanism import null_of
from legfem.inverse.verdict import Diagnosis
from legfem.legs.mechanisms import mechanism_named
from legfem.legs.subject import MeasuredEffect, Subject
from legfem.report import diagnosis_tables as tables
from legfem.report.diagnosis_document import Recorded
from legfem.report.diagnosis_style import BASE_NAME, model_name, plain, shown_models
from legfem.report.estimates import wave_rows
from legfem.report.web.page import Known, Provenance

_WRONG = "DO NOT RELY ON IT: of a wrong model, whose interval doesn't cover what was left out"


def known_of(found: Diagnosis, subject: Recorded) -> list[Known]:
    """Return the stiffness with each model, the mechanisms' parameters, and what was assumed."""
    trials = len(found.observed.trials)
    recordings = f"{trials} recording{'s' * (trials > 1)}"
    data: Provenance = subject.origin
    rows = []
    wrong = _WRONG if found.verdict == "unexplained" else ""
    for name in found.base.fit.stiffness:
        shown = [(found.base, BASE_NAME)]
        shown += [(s.model, f"with {s.name}" if s.suits else s.name) for s in shown_models(found)]
        for model, which in shown:
            change = tables.relative_change(found.base.value(name), model.value(name))
            flag = tables.flag(model, name, 0.0)
            remark = [wrong, flag, "" if model is found.base else change]
            rows.append(
                Known(
                    f"{name}, {which}",
                    f"{tables.estimate(model, name)} kPa",
                    "estimated",
                    recordings,
                    tables.interval(model, name),
                    "; ".join(filter(None, remark)),
                )
            )
        if over := tables.averaged(found, name):
            row = Known(f"{name}, {tables.OVER_ALL}", "", "estimated", recordings, over, wrong)
            rows.append(row)
    for model in found.models:
        for mechanism in model.fit.mechanisms:
            for k, p in enumerate(mechanism.parameters):
                full = f"{mechanism.name}.{p.name}"
                unit = "" if p.unit == "-" else f" {p.unit}"
                flag = tables.flag(model, full, null_of(p) if k == 0 else None)
                remark = [flag, f"model with {model_name(model)}"]
                rows.append(
                    Known(
                        f"{plain(mechanism.name)}: {p.statement or plain(p.name)}",
                        tables.estimate(model, full) + unit,
                        "estimated",
                        recordings,
                        tables.interval(model, full),
                        "; ".join(filter(None, remark)),
                    )
                )
    for k, trial in enumerate(found.observed.trials):
        at, (low, high) = found.first_contact(k)
        rows.append(
            Known(
                f"first contact of {trial}",
                f"{_hundredths(at)} mm",
                "estimated",
                "its recording",
                f"{_hundredths(low)} to {_hundredths(high)}",
            )
        )
    noise = found.errors.noise
    rows += [
        Known("noise of a force reading", f"{noise.force_sd:.3g} N (sd)", data, noise.source),
        Known("error of the displacement", f"{noise.wander_sd:.2g} mm (sd)", data, noise.source),
    ]
    accuracy = "usual accuracy"
    if isinstance(subject, Subject):
        accuracy += ", or subject.toml"
    rows += [Known(name, moved, "prior", accuracy) for name, moved in _assumed(found)]
    if isinstance(subject, Subject):
        rows += wave_rows(subject)
        rows += [_measured(one, subject.origin) for one in subject.measured]
        rows.append(Known("girth of the section", f"{girth(subject.section):.0f} mm", data, "contours"))
    return rows


def _measured(one: MeasuredEffect, origin: Origin) -> Known:
    """Return an effect's strength that was measured by itself."""
    strength = mechanism_named(one.effect).parameters[0]
    unit = "" if strength.unit == "-" else f" {strength.unit}"
    return Known(
        f"{plain(one.effect)}, measured by itself: {strength.statement}",
        f"{one.value:.3g} ± {one.sd:.2g}{unit} (sd)",
        origin,
        one.source,
    )


def _assumed(found: Diagnosis) -> list[tuple[str, str]]:
    """Return how far the fit moved what was assumed; modes of one outline together."""
    moved: dict[str, list[float]] = {}
    for name, z in zip(found.errors.names, found.best.posterior.effects, strict=True):
        moved.setdefault(name.partition(", mode ")[0], []).append(round(float(z), 1) + 0.0)
    return [
        (
            name if len(every) == 1 else f"{name}, {len(every)} modes",
            f"moved {every[0]:+.1f} sd" if len(every) == 1 else f"moved {min(every):+.1f} to {max(every):+.1f} sd",
        )
        for name, every in moved.items()
    ]


def _hundredths(value: float) -> str:
    return f"{round(value, 2) + 0.0:.2f}"
