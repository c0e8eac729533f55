"""A muscle's C10 from place to place: its term and derivatives, its search, and what a map says of linear readings."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
import ufl
from dolfinx import fem, mesh
from making import circle, press, write_subject
from making_derivatives import PRECISE
from making_mechanics import COARSE, fixed_steps, subject_3
from mpi4py import MPI
from scipy.optimize import least_squares
from scipy.spatial.distance import cdist

import legfem as lf
from legfem.channels import Sight
from legfem.channels.kinds.section_image import INSIDE
from legfem.common.errors import InputError
from legfem.common.units import FloatArray
from legfem.experiments.plane_strain import PlaneStrainIndentation, PlaneStrainSettings
from legfem.geometry.section import LegSection
from legfem.inverse.catalogue import DEEP_C10, IdentifiedLaw
from legfem.inverse.comparison import Comparison, Prediction
from legfem.inverse.outcome import Outcome
from legfem.inverse.parameter import Parameter, Prior
from legfem.inverse.search import Search
from legfem.inverse.searches import Found, run_together
from legfem.inverse.settings import IdentificationSettings
from legfem.legs.details import StiffnessMap
from legfem.legs.loading import load_subject
from legfem.legs.stiffness_field import LENGTH_MM, LOG_SD, map_of, prior_sds
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.materials import NeoHookean
from legfem.mechanics.terms.muscle import StiffnessField
from legfem.report import further_channels

SETTINGS = PlaneStrainSettings(mesh=COARSE, contact=ContactSettings(onset=0.02), newton=PRECISE, steps=fixed_steps(0.5))
DEPTH = 3.0


@pytest.fixture(scope="module")
def uneven() -> PlaneStrainIndentation:
    bare = PlaneStrainIndentation(*subject_3(), SETTINGS)
    under = bare.section_mesh.touch + 35 * bare.section_mesh.direction
    x, y = map(float, under)
    term = StiffnessField("deep", bare.tissues.deep, x - 25, y - 25, 50.0, 3)
    sight = Sight(INSIDE.name, ((x - 4, y - 6, 0.0), (x - 4, y - 6, 1.0)))
    return replace(bare, mechanisms=(term,), sights=(sight,))


MODES = [f"deep.stiffness_field.a{j}_{k}" for j, k in ((1, 1), (1, 2), (2, 1), (2, 2))]
AT = dict(zip(MODES, (0.4, -0.3, 0.2, 0.1), strict=True))


@pytest.mark.parametrize("mode", MODES)
def test_force_and_displacements_are_differentiated_by_a_mode(uneven: PlaneStrainIndentation, mode: str):
    exact = uneven.solve(AT, DEPTH, [mode]).path
    ahead, behind = (uneven.solve({**AT, mode: AT[mode] + by}, DEPTH).path for by in (1e-3, -1e-3))
    difference = (ahead.force - behind.force) / 2e-3
    np.testing.assert_allclose(exact.sensitivities[mode], difference, atol=1e-4 * np.abs(difference).max())
    for way in (0, 1):
        name = f"{INSIDE.name}:{way}"
        moved = (ahead.channels[name] - behind.channels[name]) / 2e-3
        np.testing.assert_allclose(exact.channel_sensitivities[name][mode], moved, atol=1e-3 * np.abs(moved).max())


def test_without_coefficients_and_outside_its_square_it_does_nothing(uneven: PlaneStrainIndentation):
    plain = replace(uneven, mechanisms=()).solve({}, DEPTH).path.force
    np.testing.assert_allclose(uneven.solve({}, DEPTH).path.force, plain, rtol=1e-9)
    away = {**AT, "deep.stiffness_field.left": 500.0}
    np.testing.assert_allclose(uneven.solve(away, DEPTH).path.force, plain, rtol=1e-9)


def test_the_sines_of_points_are_those_of_the_model():
    term = StiffnessField("deep", NeoHookean(1e-3, 28.0), -2.0, 1.0, 6.0, 4)
    sizes = np.linspace(-0.5, 0.7, len(term.modes))
    square = mesh.create_rectangle(MPI.COMM_SELF, [(-4.0, 0.0), (5.0, 8.0)], [45, 40])
    share = term.share(ufl.SpatialCoordinate(square), -2.0, 1.0, 6.0, *sizes.tolist())
    whole = fem.assemble_scalar(fem.form(share * ufl.dx(metadata={"quadrature_degree": 4})))
    x, y = np.meshgrid(np.arange(-4, 5, 0.05) + 0.025, np.arange(0, 8, 0.05) + 0.025)
    points = np.column_stack([x.ravel(), y.ravel()])
    assert whole == pytest.approx(0.05**2 * np.sum(np.expm1(term.sines(points) @ sizes)), rel=2e-3)


@dataclass(frozen=True, eq=False)
class Readings(Comparison):
    """Functions of a field at places, of which none is a solve."""

    term: StiffnessField
    places: FloatArray
    given: FloatArray
    sd: float
    exponential: bool = False

    @property
    def measured(self) -> FloatArray:
        return self.given

    @property
    def covariance(self) -> FloatArray:
        return self.sd**2 * np.eye(len(self.given))

    reach = "everywhere"

    def shown(self, coefficients: FloatArray) -> FloatArray:
        field = self.term.sines(self.places) @ coefficients
        return np.exp(field) if self.exponential else field

    def read(self, model_values: FloatArray, instrument: FloatArray) -> FloatArray:
        return model_values

    def predict(self, outcome: Outcome, instrument: FloatArray) -> Prediction:
        values = self.shown(np.array([outcome.values[name] for name in self.term.modes]))
        slope = values if self.exponential else np.ones(len(values))
        by = dict(zip(self.term.modes, (slope[:, None] * self.term.sines(self.places)).T, strict=True))
        return Prediction(values, by, values, by)


class Solver:
    """Hands values through."""

    def __init__(self) -> None:
        self.solved = 0

    def solve(self, points):
        self.solved += len(points)
        return [Outcome(values, (), True, "", 1, 0.0) for values in points]


def found_of(readings: Readings) -> tuple[Found, int]:
    term, solver = readings.term, Solver()
    sds = prior_sds(term).tolist()
    parameters = tuple(Parameter(n, "-", (-9.0, 9.0), Prior(0.0, sd)) for n, sd in zip(term.modes, sds, strict=True))
    values = {**dict.fromkeys(term.modes, 0.0), DEEP_C10: 1e-3}
    law = IdentifiedLaw("neo-hookean", parameters, {DEEP_C10: 1e-3}, values, starts=(values,))
    search = Search(law, readings, IdentificationSettings(), solver)
    run_together([search])
    assert search.converged
    return Found(search, search.best, False, 0.0), len(search.trials)


SECTION = LegSection.of_parts({"skin": circle(0, 0, 60), "fascia": circle(0, 0, 54), "tibia": circle(0, 40, 6)}, 0.6)


def term_about(side: float = 64.0, finest: int = 16) -> StiffnessField:
    return StiffnessField("deep", NeoHookean(1e-3, 28.0), -0.5 * side, -0.5 * side, side, finest)


def scattered(count: int, seed: int = 0) -> FloatArray:
    return np.random.default_rng(seed).uniform(-20, 20, (count, 2))


def test_mean_and_error_of_a_map_are_a_gaussian_process_regressions():
    """On readings of the field itself at 40 places, against the dense kernel."""
    places, sd = scattered(40), 0.15

    def kernel(one: FloatArray, other: FloatArray) -> FloatArray:
        return LOG_SD**2 * np.exp(-0.5 * (cdist(one, other) / LENGTH_MM) ** 2)

    lower = np.linalg.cholesky(kernel(places, places) + 1e-9 * np.eye(40))
    rng = np.random.default_rng(1)
    read = lower @ rng.standard_normal(40) + sd * rng.standard_normal(40)
    found, solves = found_of(Readings(term_about(), places, read, sd))
    assert solves == 2, "a linear model is met by one step"
    told = map_of(found, term_about(), SECTION)
    near = np.abs(told.points_mm).max(axis=1) < 20
    gain = kernel(told.points_mm, places) @ np.linalg.inv(kernel(places, places) + sd**2 * np.eye(40))
    mean, left = gain @ read, LOG_SD**2 - np.sum(gain * kernel(told.points_mm, places), axis=1)
    np.testing.assert_allclose(np.log(told.C10_kPa)[near], mean[near], atol=0.1 * LOG_SD)
    np.testing.assert_allclose(told.log_sd[near], np.sqrt(left)[near], atol=0.05 * LOG_SD)
    far = np.abs(told.points_mm).max(axis=1) > 33
    np.testing.assert_allclose(told.log_sd[far], LOG_SD, rtol=1e-6)
    assert told.told[near].any() and not told.told[far].any()


def test_the_search_among_many_parameters_ends_where_another_minimiser_does():
    """Of readings that follow the exponential of the field, inclusions of 3 and 0.3 among them, in few solves."""
    term, places = term_about(64.0, 7), scattered(120, 3)
    truth = np.where(np.hypot(*(places - 9).T) < 7, np.log(3), np.where(np.hypot(*(places + 9).T) < 7, np.log(0.3), 0))
    readings = Readings(term, places, np.exp(truth), 0.1, exponential=True)
    found, solves = found_of(readings)
    sds = prior_sds(term)
    other = least_squares(
        lambda a: np.concatenate([(readings.shown(a) - readings.given) / 0.1, a / sds]), np.zeros(len(sds))
    )
    assert solves <= 9
    assert found.best.objective == pytest.approx(2 * other.cost, rel=0.01)
    (peak, trough) = (map_of(found, term, SECTION).points_mm[k] for k in _extremes(found, term))
    assert np.hypot(*(peak - 9)) < 5 and np.hypot(*(trough + 9)) < 5


def _extremes(found: Found, term: StiffnessField) -> tuple[int, int]:
    told = map_of(found, term, SECTION)
    up, down = (max(told.stands_out, key=lambda k: way * told.C10_kPa[k]) for way in (1, -1))
    return int(up), int(down)


def test_readings_without_information_leave_all_grey():
    told = map_of(
        found_of(Readings(term_about(64.0, 7), scattered(5), np.ones(5), 30.0))[0], term_about(64.0, 7), SECTION
    )
    assert not told.told.any() and len(told.stands_out) == 0


@pytest.mark.parametrize(
    ("more", "words"),
    [({"model": "3d"}, "only in the section of one site"), ({"weighting": "paper"}, "only in the section of one site")],
)
def test_a_field_that_cannot_be_mapped_gets_one_line(tmp_path, more, words):
    leg = replace(load_subject(write_subject(tmp_path / "leg")), recordings=(press(),))
    with pytest.raises(InputError, match=words) as caught:
        lf.identify(leg, identify=["deep.C10"], field=True, **more)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("p_value", "said"), [(0.4, "The recordings fit a muscle"), (1e-9, "do not fit even a muscle")]
)
def test_a_map_that_the_recordings_contradict_is_not_said_to_fit(p_value: float, said: str) -> None:
    none = np.zeros(0)
    found = StiffnessMap(
        np.zeros((0, 2)), none, none, none.astype(bool), none.astype(int), 0.8, {}, 0.7, 7.0, p_value, True
    )
    assert said in [*further_channels._mapped(found)][-1]
