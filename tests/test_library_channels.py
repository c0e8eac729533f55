"""Channels that some of a library's solutions lack: weighed by what the others have."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
import pytest

from legfem.geometry.section import CALF, LIMBS
from legfem.inverse.catalogue import DEEP_C10
from legfem.inverse.channel_readings import PlannedChannel
from legfem.inverse.library import ChannelTables, Library, NuisanceChanges, Table, pair_strength
from legfem.inverse.library_build import _filled, _known_channels
from legfem.inverse.library_tasks import Task
from legfem.inverse.mechanism import Stiffness, Values
from legfem.inverse.observations import blank_observations
from legfem.inverse.predictor import Predictor
from legfem.inverse.responses import Columns, PathRequest, SolvedResponses
from legfem.mechanisms import TissueMechanism, mechanism_named
from legfem.mechanisms.rig import SupportCompliance
from legfem.solve.protocol import Protocol

GRID = 5.0 * np.arange(1, 5)
FAT, MUSCLE = "fat_thickness", "muscle_thickness"
POINT = (0.8e-3, 0.0)
FACTORS = ("superficial-stiffness", "fascia-stiffness", "fascia-stiffness")


def columns(force: float, **channels: float) -> dict[str, np.ndarray]:
    since = np.concatenate([[0.0], GRID])
    return {"force": force * GRID, **{name: size * since for name, size in channels.items()}}


def tasks_of(name: str, *strengths: float) -> list[Task]:
    mechanism = mechanism_named(name)
    assert isinstance(mechanism, TissueMechanism)
    return [Task(POINT, mechanism, strength) for strength in strengths]


def test_a_tilt_that_misses_the_bone_moves_it_as_the_other_tilt_does() -> None:
    """In proportion to the strength, either sign; what is there stays."""
    tasks = [Task(POINT), *tasks_of("indenter-tilt", -8.0, 4.0)]
    outcomes = [
        {"": columns(1.0, **{FAT: -0.05, MUSCLE: -0.4})},
        {"": columns(0.1, **{FAT: 0.02})},
        {"": columns(-0.1, **{FAT: -0.01, MUSCLE: 0.3})},
    ]
    made = list(zip(tasks, outcomes, strict=True))
    names = _known_channels(made)
    assert set(names) == {FAT, MUSCLE}
    filled = _filled(made, names)
    assert [task for task, _ in filled] == tasks
    elastic, there, here = (outcome for _, outcome in filled)
    assert elastic is outcomes[0] and here is outcomes[2] and there is not None
    np.testing.assert_allclose(there[""][MUSCLE], -2.0 * outcomes[2][""][MUSCLE])
    np.testing.assert_allclose(there[""][FAT], outcomes[1][""][FAT])


def test_what_the_base_model_or_a_mechanism_never_sees_is_not_weighed() -> None:
    """Without a bone under the line at rest, or beside all strengths of a mechanism, there is no muscle's thickness."""
    both, fat = columns(1.0, **{FAT: -0.05, MUSCLE: -0.4}), columns(1.0, **{FAT: -0.05})
    tilts = tasks_of("indenter-tilt", -8.0, 8.0)
    for elastic, first, second in ((fat, both, both), (both, fat, fat)):
        done = list(zip([Task(POINT), *tilts], [{"": one} for one in (elastic, first, second)], strict=True))
        assert _known_channels(done) == (FAT,)


@dataclass(eq=False)
class Named:
    """Models that are told apart by their names."""

    def described(self, variant: str) -> str:
        return variant


class SeenTogether(SolvedResponses):
    """Fat and fascia stiffen the force as a product of powers, and thin the fat by a product of their logarithms."""

    def _solve(self, asked: PathRequest) -> dict[str, np.ndarray]:
        fat, fascia = (asked.solution.scaled.get(f"{name}.C10", 1.0) for name in ("superficial", "fascia"))
        beyond = np.log(fat) * np.log(fascia)
        return columns(
            fat**0.2 * fascia**0.1 * np.exp(0.05 * beyond), **{FAT: -0.05 + 0.01 * np.log(fat) + 0.02 * beyond}
        )

    @property
    def grid(self) -> np.ndarray:
        return GRID


@dataclass(eq=False)
class Tabulated(SeenTogether):
    """Each by itself by solutions, two at once by a library's table; by none as if each were alone."""

    pairs: dict[frozenset[str], dict[str, np.ndarray]] = field(default_factory=dict)

    def pair_change(self, pair: Sequence[tuple[TissueMechanism, Values]], stiffness: Stiffness) -> Columns:
        nuisances = NuisanceChanges(GRID, {}, {})
        return Library(GRID, None, nuisances, POINT[0], pairs=self.pairs).pair_change(pair, stiffness)  # type: ignore[arg-type]


def made(kind: type[SeenTogether] = SeenTogether, **given: object) -> SeenTogether:
    return kind(Named(), 20.0, None, {}, **given)  # type: ignore[arg-type]


SPRINGS = SupportCompliance(LIMBS[CALF])


def tissue(name: str) -> TissueMechanism:
    mechanism = SPRINGS if name == SPRINGS.name else mechanism_named(name)
    assert isinstance(mechanism, TissueMechanism)
    return mechanism


def test_what_two_effects_do_at_once_is_beyond_each() -> None:
    """Exactly their product; nothing where one of them is at its null, nor of solutions of another model."""
    solved, fat = made(), (tissue(FACTORS[0]), {"factor": 2.5})
    beyond = np.log(2.5) * np.log(8.0)
    found = solved.pair_change((fat, (tissue(FACTORS[1]), {"factor": 8.0})), POINT)
    np.testing.assert_allclose(found["force"], np.expm1(0.05 * beyond))
    np.testing.assert_allclose(found[FAT], 0.02 * beyond * np.concatenate([[0.0], GRID]))
    for name, values in solved.pair_change((fat, (tissue(FACTORS[1]), {"factor": 1.0})), POINT).items():
        np.testing.assert_allclose(values, 0.0, atol=1e-12, err_msg=name)
    relaxing = tissue("viscoelasticity")
    assert not pair_strength(relaxing)
    tense, springs = {"tension": 50.0}, {"compliance": 0.1, "at_bones": 0.5}
    assert solved.pair_change(((tissue("prestress"), tense), (tissue("support-compliance"), springs)), POINT) == {}


def test_a_full_prediction_of_two_effects_has_what_they_do_at_once() -> None:
    """In force and thickness, where the tissue is pressed to; where that isn't known they act each as if alone."""
    observed = blank_observations([Protocol.ramp(20.0, 0.4)], [PlannedChannel(FAT)])
    together, apart = (Predictor(observed, made(kind), "neo-hookean") for kind in (SeenTogether, Tabulated))
    values = {DEEP_C10: 0.8e-3, "superficial-stiffness.factor": 2.5, "fascia-stiffness.factor": 8.0}
    both = [mechanism_named(name) for name in FACTORS[:2]]
    alone, whole = apart(values, both), together(values, both)
    force, fat = observed.data.spans
    beyond = np.log(2.5) * np.log(8.0)
    np.testing.assert_allclose(whole[force], np.exp(0.05 * beyond) * alone[force])
    np.testing.assert_allclose(whole[fat] - alone[fat], 0.02 * beyond * observed.data.channels[1].station, rtol=1e-6)
    one = {name: value for name, value in values.items() if "fascia" not in name}
    np.testing.assert_array_equal(together(one, both[:1]), apart(one, both[:1]))


class OnSprings(SolvedResponses):
    """Fat stiffens a force in proportion to the way; bones on springs yield by more than such springs in series."""

    def _solve(self, asked: PathRequest) -> dict[str, np.ndarray]:
        springs = asked.solution.parameters.get("tibia.springs.x", np.inf)
        stiff, thinner = of_fat(asked.solution.scaled.get("superficial.C10", 1.0))
        compliance = 0.5 / springs
        return columns(stiff / (1 + 1.3 * compliance * stiff), **{FAT: thinner / (1 + 1.5 * compliance * stiff)})

    @property
    def grid(self) -> np.ndarray:
        return GRID


def of_fat(factor: float) -> tuple[float, float]:
    """Return the force (N) and the thickness (mm) per mm that a fat so many times as stiff makes."""
    return factor**0.2, -0.05 + 0.01 * float(np.log(factor))


@pytest.mark.parametrize("at_bones", [0.0, 0.4, 1.0])
@pytest.mark.parametrize("factor", [1.0, 3.0])
def test_a_leg_of_stiff_fat_on_springs_is_solved_as_one(at_bones: float, factor: float) -> None:
    """Force and thickness are those of the leg with both, in series, on its bones, or between: no sum of each alone."""
    observed = blank_observations([Protocol.ramp(20.0, 0.4)], [PlannedChannel(FAT)])
    predictor = Predictor(observed, OnSprings(Named(), 20.0, None, {}), "neo-hookean")  # type: ignore[arg-type]
    values = {DEEP_C10: 0.8e-3, "superficial-stiffness.factor": factor}
    springs = {"support-compliance.compliance": 0.2, "support-compliance.at_bones": at_bones}
    found = predictor(values | springs, [mechanism_named(FACTORS[0]), SPRINGS])
    force, fat = observed.data.spans
    stiff, thinner = of_fat(factor)
    in_series, on_bones = (1 / (1 + more * 0.2 * stiff) for more in (1.0, 1.3))
    slope = stiff * ((1 - at_bones) * in_series + at_bones * on_bones)
    inner = observed.displacement > 2.0
    np.testing.assert_allclose(found[force][inner], (slope * observed.displacement)[inner], rtol=1e-6)
    yields = (1 - at_bones) * in_series + at_bones / (1 + 1.5 * 0.2 * stiff)
    np.testing.assert_allclose(found[fat], thinner * yields * observed.data.channels[1].station, rtol=1e-6, atol=1e-9)


def test_nuisances_beside_a_mechanism_are_in_proportion_to_what_it_does() -> None:
    """Solved at one strength; a dermis of twice that stretches little more, and those of two add up."""

    def changes(aim: float, rise: float) -> NuisanceChanges:
        own = np.full(len(GRID) + 1, rise)
        of_aim = {"force": np.full(len(GRID), aim), FAT: own, "other": own}
        return NuisanceChanges(GRID, {"aim": of_aim, "tibia": {"force": GRID}}, {})

    fat, dermis = tissue("superficial-stiffness"), tissue("dermis")
    done = {fat.name: np.log(fat.strengths), dermis.name: np.sqrt(dermis.strengths)}
    tables = {
        (m.name, ""): Table(np.zeros(1), np.outer(done[m.name], GRID)[None], strengths=m.strengths)
        for m in (fat, dermis)
    }
    altered = {fat.name: changes(0.02, 0.3), dermis.name: changes(0.1, -0.2)}
    beside = ChannelTables((FAT,), None, tables)
    library = Library(GRID, None, changes(0.01, 0.5), POINT[0], beside=beside, altered=altered)  # type: ignore[arg-type]
    assert library.nuisances_beside([]) is library.nuisances
    assert (pair_strength(fat), pair_strength(dermis)) == (3.5, 0.3)
    present = [(fat, {"factor": 1.7}), (dermis, {"stiffness": 1.0})]
    found = library.nuisances_beside([*present, (mechanism_named("force-drift"), {"rate": 0.1})])
    shares = np.log(1.7) / np.log(3.5), np.sqrt(1.0 / 0.3)
    np.testing.assert_allclose(found.geometric["aim"]["force"], 0.01 + shares[0] * 0.02 + shares[1] * 0.1)
    np.testing.assert_allclose(found.geometric["aim"][FAT], 0.5 + shares[0] * 0.3 - shares[1] * 0.2)


def test_a_tabulated_pair_is_in_proportion_to_both_departures() -> None:
    """Solved at one strength of each: what is bilinear in their logarithms is exact at any, softer ones too."""
    fat, fascia = (tissue(name) for name in FACTORS[:2])
    strengths = [pair_strength(one) for one in (fat, fascia)]
    assert strengths == [3.5, 9.0]
    solved = made()
    pair = [(one, {"factor": at}) for one, at in zip((fat, fascia), strengths, strict=True) if at]
    tabulated = made(Tabulated, pairs={frozenset(FACTORS[:2]): solved.pair_change(pair, POINT)})
    observed = blank_observations([Protocol.ramp(20.0, 0.4)], [PlannedChannel(FAT)])
    by_table, by_solution, apart = (
        Predictor(observed, one, "neo-hookean") for one in (tabulated, solved, made(Tabulated))
    )
    seen = observed.data.spans[1]
    for first, second in ((3.5, 9.0), (2.0, 5.0), (0.5, 9.0)):
        values = {DEEP_C10: 0.8e-3, "superficial-stiffness.factor": first, "fascia-stiffness.factor": second}
        true = by_solution(values, [fat, fascia])
        np.testing.assert_allclose(by_table(values, [fat, fascia])[seen], true[seen], rtol=1e-6)
        assert np.abs(apart(values, [fat, fascia]) - true)[seen].max() > 0.1
    assert tabulated.pair_change([(fat, {"factor": 2.0}), (tissue("indenter-tilt"), {"angle": 5.0})], POINT) == {}
    assert pair_strength(tissue("viscoelasticity")) is None
