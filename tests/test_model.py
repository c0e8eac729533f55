"""The model is a sum of terms that can be swapped, and a new effect is one more."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

import numpy as np
import pytest
import ufl
from making_mechanics import fixed_steps, leg_model, one_tissue, press, pressed_block

from legfem.fem.system import System
from legfem.mechanics.contact import ContactSettings, StiffPressure
from legfem.mechanics.model import LegModel
from legfem.mechanics.terms import NormalContact, Tissue
from legfem.solve.newton import NewtonSolver


@pytest.fixture
def model() -> LegModel:
    return leg_model(one_tissue(1e-3, 28.0), 15.0, ContactSettings(), 0.5, "mixed")


def test_parameters_have_full_names(model):
    assert model.parameters["deep.C10"] == 1e-3
    assert model.parameters["indenter.radius"] == 15.0
    assert model.parameters["contact.stiffness"] == 0.5
    assert {name.split(".")[0] for name in model.parameters} == {
        "superficial",
        "fascia",
        "deep",
        "indenter",
        "contact",
        "friction",
    }


def test_terms_are_found_by_place_and_name(model):
    assert [term.name for term in model.at("body")] == ["superficial", "fascia", "deep"]
    assert [term.name for term in model.at("skin")] == ["contact", "friction"]
    assert isinstance(model.term("deep"), Tissue)
    assert isinstance(model.term("contact"), NormalContact)


def test_a_term_is_swapped_by_name_and_the_model_stays_as_it_was(model):
    stiffer = replace(model.term("contact"), law=StiffPressure(5.0, 0.01))
    swapped = model.with_term(stiffer)
    assert swapped.term("contact") is stiffer
    assert [term.name for term in swapped.terms] == [term.name for term in model.terms]
    assert model.parameters["contact.stiffness"] == 0.5


@dataclass(frozen=True)
class Bandage:
    """Springs on the skin towards where it was: an effect that the default model doesn't have."""

    stiffness: float
    """MPa/mm."""
    name: str = "bandage"
    domain: Literal["skin"] = "skin"

    @property
    def parameters(self) -> dict[str, float]:
        return {"bandage.stiffness": self.stiffness}

    def history(self, domain: Any) -> dict[str, tuple[int, ...]]:
        return {"travel": ()}

    def residual(self, skin: Any, history: Mapping[str, Any]) -> Any:
        k = skin.symbols.scalar("bandage.stiffness", self.stiffness)
        return k * ufl.dot(skin.displacement, skin.variation) * skin.measure

    def updated(self, skin: Any, history: Mapping[str, Any]) -> dict[str, Any]:
        step = skin.displacement - skin.displacement_before
        return {"travel": history["travel"] + ufl.sqrt(ufl.dot(step, step) + 1e-30)}


def _force(system: System, depth: float = 1.5) -> float:
    assert press(system, NewtonSolver(system), [depth], fixed_steps(0.5)).complete
    return system.force()


def test_a_new_effect_is_one_more_term():
    plain = pressed_block()
    model = plain.model.with_term(Bandage(1e-3))
    assert len(model.terms) == len(plain.model.terms) + 1
    wrapped = System(plain.spaces, model, np.array([0.0, 8.0]), plain.direction)
    _force(plain), _force(wrapped)
    free, held = (np.linalg.norm(s.skin.domain.unknown.x.array) for s in (plain, wrapped))
    assert held < 0.97 * free
    wrapped.set_parameters({"bandage.stiffness": 0.0})
    assert _force(wrapped) == pytest.approx(_force(plain), rel=1e-10), "its null value"
    travel = wrapped.skin.history.variables["bandage.travel"].x.array
    deepest = np.linalg.norm(wrapped.skin.domain.unknown.x.array.reshape(-1, 2), axis=1).max()
    assert travel.max() == pytest.approx(deepest, rel=0.05), "and it remembers"


def test_parameters_change_without_compiling():
    system = pressed_block()
    soft = _force(system)
    system.set_parameters(
        {"deep.C10": 2e-3, "deep.C20": 1e-3, "deep.D1": 14.0, "contact.stiffness": 0.4, "friction.stiffness": 0.4}
    )
    assert _force(system) == pytest.approx(2 * soft, rel=1e-8)
