"""What a dataclass' annotations say of its numbers and choices holds, or it isn't made."""

from dataclasses import dataclass, replace
from typing import Any, Literal

import pytest
import ufl
from basix.ufl import element

from legfem.common.errors import AboveZero, Checked, InputError, ZeroOrMore
from legfem.experiments.bodies import BallOnLayer
from legfem.experiments.compression import CompressionSettings
from legfem.mechanics.contact import ContactSettings
from legfem.mechanics.materials import Hyperelastic, Yeoh
from legfem.mechanics.terms.muscle import UnevenStiffness
from legfem.meshing.structured import LegMeshSettings, MeridianMeshSettings
from studies.making.scans import SegmentationNoise


@dataclass(frozen=True)
class Sizes(Checked):
    length: AboveZero[float] = 1.0
    gap: ZeroOrMore[float] = 0.0
    radii: AboveZero[tuple[float, ...]] = (1.0,)
    ends: Literal["held", "free"] = "held"
    shift: float = 0.0


@pytest.mark.parametrize(
    ("given", "told"),
    [
        ({"length": 0.0}, "Sizes: length: is 0; give a finite value of more than zero"),
        ({"length": float("inf")}, "Sizes: length: is inf; give a finite value of more than zero"),
        ({"gap": -0.5}, "Sizes: gap: is -0.5; give a finite value of zero or more"),
        ({"gap": float("nan")}, "Sizes: gap: is nan; give a finite value of zero or more"),
        ({"radii": (1.0, -2.0)}, "Sizes: radii: is -2; give a finite value of more than zero"),
        ({"ends": "loose"}, "Sizes: ends: unknown kind 'loose'; choose held or free"),
    ],
)
def test_what_an_annotation_rules_out_is_refused_with_the_field_and_its_bound(given: Any, told: str) -> None:
    with pytest.raises(InputError) as refused:
        Sizes(**given)
    assert str(refused.value) == told


def test_zero_and_any_other_number_pass_where_their_annotations_allow_them() -> None:
    assert replace(Sizes(), gap=0, shift=-3.0, length=2).shift == -3.0


def test_symbols_of_a_discretised_model_pass() -> None:
    symbol = ufl.Constant(ufl.Mesh(element("Lagrange", "triangle", 1, shape=(2,))))
    assert Hyperelastic(symbol, 1.0).C10 is symbol


@pytest.mark.parametrize(
    "make",
    [
        lambda: Yeoh(C10=1.0, D1=1.0, C20=0.0, C30=-1.0),
        lambda: Yeoh(C10=0.0, D1=1.0, C20=0.0),
        lambda: UnevenStiffness("deep", Hyperelastic(1.0, 1.0), ((0.0, 0.0),), (-1.0,)),
        lambda: BallOnLayer(thickness=-1.0),
        lambda: ContactSettings(tangential="glue"),  # type: ignore[arg-type]
        lambda: CompressionSettings(formulation="mixed"),  # type: ignore[arg-type]
        lambda: LegMeshSettings(cells="prisms"),  # type: ignore[arg-type]
        lambda: MeridianMeshSettings(size=1.0, growth=-0.1),
        lambda: SegmentationNoise(correlation_length=0.0),
    ],
)
def test_laws_terms_bodies_and_settings_are_checked_whatever_they_inherit(make: Any) -> None:
    with pytest.raises(InputError):
        make()


def test_refined_elements_are_smaller_where_sizes_are_and_of_the_same_kind() -> None:
    fine = LegMeshSettings().refined(2.0)
    assert (fine.contact_size, fine.far_size, fine.degree) == (1.5, 7.5, 2)
