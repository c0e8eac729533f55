"""Shear waves' moduli of a leg in a stocking: what contours hardly tell, the fat's stiffness."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from making_stocking import LEG_TOML, PLANTED_KPA, laws, short_leg

from legfem.common.errors import InputError
from legfem.common.progress import Silent
from legfem.experiments.compression import CompressionSettings
from legfem.geometry.slices import calf_levels
from legfem.inverse.elastography import ShearModulus
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.report.kinds import page_of
from legfem.report.render import plain_page
from legfem.stockings.contour_distances import ContourAccuracy
from legfem.stockings.equilibrium import PARAMETERS, EquilibriumSolver, LegModel3D
from legfem.stockings.fabric import fitted_stocking
from legfem.stockings.identification import identify_in_stocking
from legfem.stockings.leg import StockingLeg
from legfem.stockings.scan_fit import stiffness_priors
from legfem.stockings.schema import parse_leg_file

FINE = SolidMeshSettings(skin_size=8, inside_size=10, bone_size=8)
COARSE = SolidMeshSettings(skin_size=11, inside_size=14, bone_size=9)
ACCURACY = ContourAccuracy(sd=0.1, correlation=16.0, around=30.0, along=40.0, pressure_sd=0.003)
WAVES = '[[elastography]]\ntissue = "{}"\nplane = "{}"\nshear_modulus_kPa = 12.0\nsd_kPa = 1.8\n'
STATED = "[tissues.deep]\nC10_kPa = 3\n[tissues.superficial]\nC10_kPa = 8\n"
FAT = ShearModulus("superficial", "across", 12e-3, 1.8e-3, "five frames")


def test_a_modulus_is_a_prior_of_half_of_it(tmp_path):
    toml = tmp_path / "leg.toml"
    toml.write_text(LEG_TOML + WAVES.format("superficial", "across"))
    (entry,) = parse_leg_file(toml).elastography
    priors = stiffness_priors([ShearModulus.of(entry)])
    assert [one.name for one in priors.parameters] == list(PARAMETERS)
    at = np.array([3e-3, 6.9e-3])
    np.testing.assert_allclose(priors.residual(at), [1.0])
    np.testing.assert_allclose(priors.jacobian(at), [[0.0, 1 / 0.9e-3]])
    assert len(stiffness_priors()) == 0


@pytest.mark.parametrize(
    ("more", "said"),
    [
        (WAVES.format("deep", "along"), r"elastography\.0\.plane: along the leg isn't used"),
        (2 * WAVES.format("deep", "across"), r"elastography\.1: .* given twice"),
        (STATED + WAVES.format("deep", "across"), "elastography: .*C10_kPa of both"),
        (WAVES.format("deep", "across").replace("kPa", "Pa"), r"elastography\.0\.s"),
    ],
)
def test_what_is_wrong_with_it_is_named(tmp_path, more, said):
    toml = tmp_path / "leg.toml"
    toml.write_text(LEG_TOML + more)
    with pytest.raises(InputError, match=said):
        parse_leg_file(toml)


@pytest.mark.slow
def test_known_fat_narrows_both_intervals_and_a_wrong_modulus_is_told(tmp_path):
    """The scan is another mesh's; the fat's modulus reads half a standard deviation too much."""
    shape = short_leg()
    stocking = fitted_stocking(shape, "3")
    model = LegModel3D(shape, laws(*PLANTED_KPA), FINE, CompressionSettings(stabilisation=0.3))
    worn = EquilibriumSolver(model, stocking).solve()
    leg = StockingLeg(
        "t",
        "Test",
        "simulated",
        shape,
        shape,
        worn.shape,
        None,
        stocking,
        ACCURACY,
        laws(3.0, 3.0),
        False,
        "held",
        calf_levels(shape),
        (),
    )
    muscle = ShearModulus("deep", "across", 15e-3, 0.75e-3, "five frames")
    every = {"neither": (), "fat": (replace(FAT, value=12.9e-3),), "wrong": (muscle,)}
    found = {
        name: identify_in_stocking(replace(leg, elastography=moduli), Silent(), mesh=COARSE, folder=tmp_path / "kept")
        for name, moduli in every.items()
    }
    width = {}
    for name in ("neither", "fat"):
        interval = np.array([known.shown.ci95 for known in found[name].estimates.values()])
        print(name, found[name].details.best.stiffness, interval)
        assert all(low < c10 < high for (low, high), c10 in zip(interval, PLANTED_KPA, strict=True))
        width[name] = np.diff(np.log(interval), axis=1)[:, 0]
    narrower = width["fat"] / width["neither"]
    print(f"muscle's and fat's intervals over their widths without: {narrower}")
    assert narrower[1] < 0.5 and narrower[0] < 0.95
    # Six standard deviations of the prior's off the truth.
    said = plain_page(page_of([found["wrong"]]), [])
    assert "Elastography finds a higher c10_deep than the fit of both scans does" in " ".join(said.split())
    priors = found["fat"].settings["priors"]
    assert set(priors) == {"c10_superficial"}
    assert priors["c10_superficial"]["sd"] == pytest.approx(0.9) and priors["c10_superficial"]["unit"] == "kPa"
