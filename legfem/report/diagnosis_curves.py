"""The curves of a diagnosis: recordings and model, and what each leading mechanism would leave of itself."""

from dataclasses import dataclass

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from legfem.common.numbers import probability, share
from legfem.common.units import FloatArray
from legfem.inverse.catalogue import symbol_of
from legfem.inverse.explanation import Explanation
from legfem.inverse.location import Signature, runs_within
from legfem.inverse.predictive import nearest_fit
from legfem.inverse.verdict import Diagnosis
from legfem.report.curves import Curves, Dash, Line, curves_figure
from legfem.report.style import DATA_COLOUR, FAINT
from legfem.report.words import LAW_NAMES, TOLD

BASE_COLOUR = "#D55E00"
REPAIRED_COLOUR = "#0072B2"
BASE_NAME = "base model"
UNKNOWN = "something unknown"


@dataclass(frozen=True, eq=False)
class ShownModel:
    """A model beside the base model, as it is shown."""

    model: Explanation
    name: str
    suits: bool
    """Whether it is a finding, not just the most probable of those that were tried."""


def plain(name: str) -> str:
    """Return a mechanism's name for people."""
    return name.replace("-", " ")


def model_name(model: Explanation) -> str:
    """Return an explanation's name for people."""
    if model.unnamed:
        return UNKNOWN
    return " + ".join(plain(name) for name in model.names) or BASE_NAME


def shown_models(found: Diagnosis) -> list[ShownModel]:
    """Return the models that are shown beside the base: those that suit, else the closest."""
    if found.verdict == "consistent":
        return []
    if found.models:
        return [ShownModel(model, model_name(model), True) for model in found.models]
    named = [e for e in found.explained.every if e.names]
    return [ShownModel(named[0], f"closest tried ({model_name(named[0])})", False)] if named else []


@dataclass(frozen=True, eq=False)
class Place:
    """A stretch of a protocol's segment in which the base model is wrong, to one side."""

    protocol: int
    trials: tuple[int, ...]
    segment: int
    phase: str
    stations: NDArray[np.int_]
    """Numbers of its stations in the protocol, consecutive."""
    displacement: tuple[float, float]
    """mm."""
    time: tuple[float, float]
    """s since first contact."""
    size: float
    """Mean of recorded less base model's force, N."""
    noise: float
    """N: standard deviation of one trial's value there."""
    p_value: float | None
    """Family-wise p-value of the strongest window in it; None if no window there is significant."""

    @property
    def weight(self) -> float:
        """How much misfit it holds: squares over the noise's."""
        return len(self.stations) * len(self.trials) * (self.size / self.noise) ** 2


def places_of(found: Diagnosis) -> list[Place]:
    """Return the located stretches in the order of protocols and time."""
    observed, groups = found.observed, dict[tuple[int, int, int, int], list[int]]()
    for k, run in runs_within(observed, _signs(found)):
        first, number = int(run[0] - np.argmax(observed.trial == k)), observed.protocol_of[k]
        groups.setdefault((number, int(observed.segment[run[0]]), first, first + len(run)), []).append(k)
    return [
        _place(found, number, segment, np.arange(first, end), tuple(trials))
        for (number, segment, first, end), trials in sorted(groups.items())
    ]


def _signs(found: Diagnosis) -> NDArray[np.int_]:
    """Return where the base model is wrong (n,): 1 where it is too soft, -1 where too stiff."""
    signs = np.zeros(len(found.located), dtype=int)
    if found.models:
        missed = (found.models[0].fit.prediction - found.base_model.fit.prediction)[found.observed.data.spans[0]]
        signs[found.located] = np.where(missed > 0, 1, -1)[found.located]
        return signs
    signs[found.located] = 1
    for window in (one for one in found.assessment.windows if one.channel == "force"):
        signs[list(window.stations)] = 1 if window.size > 0 else -1
    return np.where(found.located, signs, 0)


def _place(found: Diagnosis, protocol: int, segment: int, stations: NDArray[np.int_], trials: tuple[int, ...]) -> Place:
    observed, base = found.observed, found.base_model
    where = np.concatenate([np.flatnonzero(observed.trial == k)[stations] for k in trials])
    touching = [w.p_value for w in found.assessment.windows if set(w.stations) & set(where.tolist())]
    d, t = observed.displacement[where], observed.time[where]
    return Place(
        protocol,
        trials,
        segment,
        str(observed.phase[where[0]]),
        stations,
        (float(d.min()), float(d.max())),
        (float(t.min()), float(t.max())),
        float(base.fit.residual[where].mean()),
        float(np.sqrt(np.mean(found.errors.trial_sd[where] ** 2))),
        min(touching, default=None),
    )


_MANY_TRIALS = 8
"""Above which trials share a colour's line in the legend no more: only their mean is drawn."""


def curves_of(found: Diagnosis, number: int) -> list[Curves]:
    """Return force over displacement and, where there is more than a loading, over time."""
    stations, (lines, left) = found.observed.protocols[number], _lines_of(found, number)
    blocks = [_over(found, number, False, lines, left)]
    if len(np.unique(stations.segment)) > 1:
        blocks.append(_over(found, number, True, lines, left))
    return blocks


def recording_figure(found: Diagnosis, number: int, subject: str, origin: str) -> Figure:
    """Return force of all trials of one protocol with the models, and what they miss.

    Parameters
    ----------
    found
        The diagnosis.
    number
        Of the protocol.
    subject, origin
        Whose data, and what kind.
    """
    what = f"Recording and model: {found.observed.protocols[number].label}"
    return curves_figure(curves_of(found, number), what, subject, origin)


def _lines_of(found: Diagnosis, number: int) -> tuple[list[Line], list[str]]:
    """Return the recordings and models of a protocol, and what each model leaves, in words."""
    observed = found.observed
    trials, at = observed.trials_of(number), observed.stations_of(number)
    recorded, base = observed.force[at], -found.base_model.fit.residual[at]
    lines = [
        Line("recorded" + (", mean" if len(trials) > 1 else ""), recorded.mean(axis=0), None, DATA_COLOUR, points=True)
    ]
    if 1 < len(trials) <= _MANY_TRIALS:
        lines += [
            Line(observed.trials[k], force, missed, FAINT, "dotted", faint=True, tabled=False)
            for k, force, missed in zip(trials, recorded, base, strict=True)
        ]
    prediction = found.base_model.fit.prediction[at].mean(axis=0)
    lines.append(Line(BASE_NAME, prediction, base.mean(axis=0), BASE_COLOUR, "dashed"))
    left = [f"{BASE_NAME} {_rms(base):.2g} N"]
    for shown in shown_models(found)[:1]:
        fit = nearest_fit(shown.model.fit)
        name = f"with {shown.name}" if shown.suits else shown.name
        lines.append(Line(name, fit.prediction[at].mean(axis=0), -fit.residual[at].mean(axis=0), REPAIRED_COLOUR))
        left.append(f"{name} {_rms(fit.residual[at]):.2g} N")
    return lines, left


def _over(found: Diagnosis, number: int, time: bool, lines: list[Line], left: list[str]) -> Curves:
    """Return what stands over time, else over displacement."""
    observed = found.observed
    places = [place for place in places_of(found) if place.protocol == number]
    sd = np.sqrt(np.mean(found.errors.trial_sd[observed.stations_of(number)] ** 2, axis=0))
    stations = observed.protocols[number]
    return Curves(
        f"recording{number}-{time:d}",
        f"Force over {'time' if time else 'displacement'}, {stations.label}",
        TOLD["recorded_and_model"].format(law=LAW_NAMES[found.law], base=BASE_NAME, left=", ".join(left)),
        stations.time if time else stations.displacement,
        "time (s)" if time else "displacement (mm)",
        "force (N)",
        lines,
        2 * sd,
        "± 2 sd of a trial's noise",
        [place.time if time else place.displacement for place in places],
        "where the base model is wrong" if places else "",
        "model − recorded (N)",
    )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


def relative_change(before: float, after: float) -> str:
    """Return a change in per cent; where there was nothing before, that."""
    change = after / before - 1.0 if before > 1e-6 else 0.0
    return f"{'+' if change > 0 else ''}{share(change)}" if before > 1e-6 else "from 0"


_MOST_SIGNATURES = 4
_SIGNATURE_STROKES: tuple[tuple[str, Dash], ...] = (
    ("#0072B2", "solid"),
    ("#CC79A7", "dashed"),
    ("#009E73", "dotdash"),
    ("#E69F00", "dotted"),
)


def signatures_of(found: Diagnosis) -> list[Curves]:
    """Return the misfit with the signatures of the leading mechanisms scaled to it, a block a way of pressing."""
    names = leading(found) if found.verdict != "consistent" else []
    return [_signatures(found, number, names) for number in range(len(found.observed.protocols) if names else 0)]


def _signatures(found: Diagnosis, number: int, names: list[str]) -> Curves:
    observed, stations = found.observed, found.observed.protocols[number]
    timed, at = len(np.unique(stations.segment)) > 1, observed.stations_of(number)
    left = found.weighted_base.fit.residual[at].mean(axis=0)
    lines = [Line("difference", -left, None, DATA_COLOUR, points=True)]
    for name, (colour, dash) in zip(names, _SIGNATURE_STROKES, strict=False):
        scaled, share = matched(found, strongest(found, name))
        score = found.assessment.score(name)
        said = "reported" if any(name in model.names for model in found.models) else "not reported"
        said += f", {probability(score.p_value)}" if score else ""
        said += "" if share is None else f", matches {100 * share:.0f} % of the misfit"
        lines.append(Line(f"{plain(name)} ({said})", -scaled[at].mean(axis=0), None, colour, dash))
    hides = " and ".join(map(symbol_of, found.base_model.fit.stiffness))
    return Curves(
        f"signature{number}",
        "Does the difference look like what a mechanism would leave",
        TOLD["signatures"].format(label=stations.label, hides=hides),
        stations.time if timed else stations.displacement,
        "time (s)" if timed else "displacement (mm)",
        "base model − recorded (N)",
        lines,
    )


def leading(found: Diagnosis) -> list[str]:
    """Return the mechanisms that are shown: those reported, then those with the strongest sign."""
    reported = [name for model in found.models for name in model.names]
    strongest_first = [score.name for score in sorted(found.assessment.scores, key=lambda s: -s.statistic)]
    known = {signature.mechanism.name for signature in found.assessment.signatures}
    names = dict.fromkeys([*reported, *strongest_first])
    return [name for name in names if name in known][:_MOST_SIGNATURES]


def strongest(found: Diagnosis, name: str) -> Signature:
    """Return the one of a mechanism's signatures that matches the misfit best."""
    mine = [s for s in found.assessment.signatures if s.mechanism.name == name]
    return max(mine, key=lambda signature: _statistic(found, signature))


def matched(found: Diagnosis, signature: Signature) -> tuple[FloatArray, float | None]:
    """Return a signature (n,) scaled to the misfit, N, and the share of the misfit it matches.

    The share is of the squares (in units of the noise) above those that noise makes; None where
    there are hardly more. With the wrong sign it is zero.
    """
    fitted, direction = found.weighted_base.fit, signature.direction
    along = _along(found, signature)
    square = float(direction @ direction)
    shown = direction[: len(fitted.whitened)]
    scaled = np.asarray(found.errors.lower @ shown) * along / square
    dof = len(fitted.whitened)
    beyond = fitted.cost - dof
    if beyond < 2 * np.sqrt(2 * dof):
        return scaled, None
    return scaled, min(1.0, _statistic(found, signature) / beyond)


def _along(found: Diagnosis, signature: Signature) -> float:
    along = float(signature.direction @ found.weighted_base.fit.augmented_residual)
    return max(along, 0.0) if signature.one_sided else along


def _statistic(found: Diagnosis, signature: Signature) -> float:
    return _along(found, signature) ** 2 / float(signature.direction @ signature.direction)
