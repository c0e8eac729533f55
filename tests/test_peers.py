"""What others would do with recordings: least squares, a Gaussian process beside the model, sparse selection."""

from __future__ import annotations

import json
from dataclasses import dataclass

import numpy as np
import pytest
from making_diagnosis import SOUGHT, problem_of, ramps

from legfem.common.errors import InputError
from legfem.mechanisms import OCCURRENCES
from studies.cases import peers, peers_neural
from studies.cases.outcomes import Interval
from studies.cases.peers_discrepancy import calibrated
from studies.cases.peers_fitted import Answer, Course, Loading, OtherCurves, fitted
from studies.cases.peers_neural import Simulator, by_network, causes, features
from studies.cases.peers_selected import lasso, least_bic


@dataclass(frozen=True)
class Leg:
    recordings: tuple = ()


AT = np.linspace(0.0, 22.0, 45)
TRUE = np.array([1.3, 0.7])


def force(stiffness: np.ndarray, d: np.ndarray) -> np.ndarray:
    """A body that stiffens: C10 by a power and C20 by a steeper one, neither in proportion."""
    c10, c20 = (*stiffness, 0.0)[:2]
    return 0.12 * c10**0.8 * d**1.3 + 0.0008 * c20**0.9 * d**2.6


def slopes(stiffness: np.ndarray, d: np.ndarray) -> np.ndarray:
    by = [0.096 * stiffness[0] ** -0.2 * d**1.3]
    return np.array(by + [0.00072 * c20**-0.1 * d**2.6 for c20 in stiffness[1:]])


def loading(
    stiffness: np.ndarray, noise: float, onsets=(0.2, -0.1, 0.4), extra=np.zeros_like, seed: int = 3
) -> Loading:
    """Three trials with first contacts of their own."""
    d = np.tile(np.linspace(0.5, 20.0, 40), 3)
    trial = np.repeat(np.arange(3), 40)
    since = np.maximum(d - np.array(onsets)[trial], 0.0)
    read = force(stiffness, since) + extra(d) + noise * np.random.default_rng(seed).standard_normal(120)
    return Loading(d, read, trial, 20.3, len(stiffness))


def exact(stiffness: np.ndarray) -> Course:
    return Course(AT, force(stiffness, AT), slopes(stiffness, AT))


@pytest.mark.parametrize("true", [TRUE[:1], TRUE])
def test_least_squares_finds_exact_data_with_an_interval_of_nothing(true):
    found = fitted(exact, loading(true, 0.0))
    assert found.value == pytest.approx(true[0], rel=2e-3)
    assert found.width < 5e-3


def test_least_squares_interval_holds_the_truth_as_often_as_it_says_where_the_model_is_right():
    found = [fitted(exact, loading(TRUE[:1], 0.05, seed=seed)) for seed in range(60)]
    assert 52 <= sum(one.covers(TRUE[0]) for one in found)
    assert np.median([one.width for one in found]) < 0.1


def test_least_squares_interval_is_blind_to_a_model_that_is_wrong():
    found = [fitted(exact, loading(TRUE[:1], 0.05, extra=lambda d: 0.4 * np.sin(d / 5), seed=k)) for k in range(10)]
    assert sum(one.covers(TRUE[0]) for one in found) <= 2


def test_secants_through_earlier_curves_lead_to_the_fit_by_exact_derivatives():
    recorded = loading(TRUE, 0.02)
    curves = OtherCurves(lambda stiffness: force(stiffness, AT), AT)
    found, wanted = fitted(curves, recorded), fitted(exact, recorded)
    assert found.value == pytest.approx(wanted.value, rel=0.01)
    assert found.width == pytest.approx(wanted.width, rel=0.2)
    assert len(curves.known) < 20


def test_a_process_beside_the_model_covers_what_least_squares_with_a_known_discrepancy_misses():
    c10 = TRUE[0] * np.exp(np.linspace(-0.7, 0.7, 201))
    held = []
    for seed in range(12):
        shift = np.random.default_rng(seed).uniform(0, 6)
        recorded = loading(TRUE[:1], 0.03, (0.0, 0.0, 0.0), lambda d: 0.3 * np.sin(d / 4 + shift), seed)  # noqa: B023
        curves = np.array([force(np.array([c]), recorded.displacement) for c in c10])
        slope = np.gradient(force(TRUE[:1], AT), AT)
        found = calibrated(c10, curves, np.interp(recorded.displacement, AT, slope), recorded)
        held.append(found.covers(TRUE[0]))
        assert found.low < found.value < found.high
    assert sum(held) >= 9


def test_a_process_stays_narrow_where_the_model_is_right():
    c10 = TRUE[0] * np.exp(np.linspace(-0.7, 0.7, 401))
    recorded = loading(TRUE[:1], 0.03, (0.0, 0.0, 0.0))
    curves = np.array([force(np.array([c]), recorded.displacement) for c in c10])
    found = calibrated(c10, curves, np.zeros(120), recorded)
    assert found.covers(TRUE[0])
    assert found.width < 0.3


@pytest.fixture(scope="module")
def whitened():
    """Base parameters (n, 2), responses (n, 7) of six mechanisms, white noise."""
    d, rng = np.linspace(0.1, 1.0, 90), np.random.default_rng(8)
    base = np.column_stack([d, d**2]) * 40
    responses = np.column_stack([*(30 * np.sin((k + 2) * 2 * d + k) for k in range(5)), d**1.5 * 40, -np.sin(4 * d)])
    return base, responses, ["a", "b", "c", "d", "e", "hidden", "a"], rng.standard_normal((20, 90))


@pytest.mark.parametrize("choose", [least_bic, lasso])
@pytest.mark.parametrize("planted", [(2,), (1, 4)])
def test_selection_names_what_is_planted(whitened, choose, planted):
    base, responses, names, noises = whitened
    found = [choose(responses[:, planted].sum(axis=1) + noise, base, responses, names) for noise in noises]
    assert all(set(one) >= set(planted) for one in found)
    if choose is least_bic:
        assert sum(set(one) == set(planted) for one in found) >= 12


def test_selection_by_bic_names_nothing_in_most_noises_alone(whitened):
    base, responses, names, noises = whitened
    assert sum(least_bic(left, base, responses, names) == () for left in noises) >= 12


def test_no_pair_is_of_one_mechanism(whitened):
    base, responses, names, noises = whitened
    left = responses[:, 0] - 20 * responses[:, 6] + noises[1]
    chosen = least_bic(left, base, responses, names)
    assert len({names[k] for k in chosen}) == len(chosen)


@pytest.fixture(scope="module")
def base():
    return problem_of(ramps(2))[1]


LOGS = np.log([0.0008, 0.0012])


def test_simulations_have_none_one_or_two_mechanisms_as_often_as_a_diagnosis_expects(base):
    true, forces = Simulator(base, SOUGHT, np.random.default_rng(2)).recordings(800, LOGS)
    assert true.shape == (800, 1 + len(SOUGHT)) and forces.shape == (800, len(base.prediction))
    assert LOGS[0] <= true[:, 0].min() and true[:, 0].max() <= LOGS[1]
    shares = np.bincount(true[:, 1:].sum(axis=1).astype(int), minlength=3) / len(true)
    assert shares == pytest.approx([0.4, 0.4, 0.2], abs=0.06)


def test_simulations_are_alike_by_one_seed(base):
    one, other, third = (Simulator(base, SOUGHT, np.random.default_rng(k)).recordings(5, LOGS)[1] for k in (1, 1, 2))
    assert np.array_equal(one, other) and not np.array_equal(one, third)


def test_simulated_errors_are_as_large_as_a_diagnosis_expects(base, monkeypatch):
    """Errors about one true course, whitened by the fit's own."""
    simulator = Simulator(base, (), np.random.default_rng(4))
    monkeypatch.setattr(Simulator, "truth", lambda *_: (np.zeros(1), base.prediction))
    off = simulator.recordings(400, LOGS)[1] - base.prediction
    assert np.mean(base.problem.whitened(off.T) ** 2) == pytest.approx(1.0, abs=0.25)


def test_simulated_strengths_are_possible_ones(base):
    simulator = Simulator(base, SOUGHT, np.random.default_rng(5))
    for one in SOUGHT:
        drawn, possible = [simulator.value(one.parameters[0], one) for _ in range(200)], OCCURRENCES.get(one.name)
        low, high = one.parameters[0].bounds if possible is None else (possible.low, possible.high)
        assert low <= min(drawn) < max(drawn) <= high


def test_features_tell_the_size_of_a_force_and_what_is_left_beside_it(base):
    _, forces = Simulator(base, SOUGHT, np.random.default_rng(6)).recordings(60, LOGS)
    plain, larger = (features(base, factor * base.prediction, forces)[0] for factor in (1.0, 1.1))
    assert plain[0] == pytest.approx(0.0, abs=1e-9) and larger[0] == pytest.approx(np.log(1.1))
    assert larger[1:] == pytest.approx(plain[1:], abs=1e-6)


def test_the_cause_is_what_most_samples_have():
    samples = np.array([[[1, 0], [0, 0]], [[1, 0], [1, 1]], [[0, 1], [1, 1]]], dtype=float)
    assert causes(samples).tolist() == [[1, 0], [1, 1]]


def test_a_neural_estimate_without_its_library_says_what_to_install_before_anything_is_solved(tmp_path, monkeypatch):
    def missing(name: str) -> None:
        raise ModuleNotFoundError(f"No module named {name!r}", name=name)

    monkeypatch.setattr(peers_neural, "import_module", missing)
    with pytest.raises(InputError, match="pip install sbi"):
        by_network(Leg(), tmp_path)
    assert not list(tmp_path.iterdir())


def test_the_page_counts_by_peer_beside_the_truth_and_a_rerun_recalls(tmp_path, monkeypatch):
    calls = []

    def one(value: float, named: list[str]):
        def answer(leg, library):
            calls.append(library.name)
            return Answer(Interval(value, 0.9 * value, 1.1 * value), 10, named)

        return "studies.cases.outcomes", answer

    monkeypatch.setattr(peers, "PEERS", {"legfem's diagnosis": one(1.0, ["a"]), "least squares, felupe": one(2.0, [])})
    monkeypatch.setattr(peers, "load_subject", lambda folder: Leg())
    truth = {"case-1": {"effects": ["a"], "true_C10_kPa": 1.05}, "case-2": {"effects": ["none"], "true_C10_kPa": 1.0}}
    (tmp_path / "truth.json").write_text(json.dumps({"cases": truth}))
    rows = []
    for k, name in enumerate(truth, 1):
        (tmp_path / name).mkdir()
        (tmp_path / name / "subject.toml").write_text(name)
        rows += peers.rows_of(k, tmp_path / name, tmp_path / "out", tmp_path / "library")
    assert [row["held"] for row in rows] == [True, False, True, False]
    assert [row["right"] for row in rows] == [True, False, False, False]
    text = peers.page(rows)
    assert "| legfem's diagnosis | 2/2" in text and "| least squares, felupe | 0/2" in text
    before = len(calls)
    assert list(peers.rows_of(1, tmp_path / "case-1", tmp_path / "out", tmp_path / "library")) == rows[:2]
    assert len(calls) == before
