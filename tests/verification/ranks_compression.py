"""A leg in its stocking on this run's ranks: `python ranks_compression.py SOLVER OUT`."""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np
from mpi4py import MPI

from legfem.experiments.compression import CompressionSettings
from legfem.mechanics.materials import NeoHookean
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.solve.linear import LinearSettings
from legfem.solve.settings import NewtonSettings
from legfem.stockings.equilibrium import LegModel3D
from legfem.stockings.fabric import fitted_stocking, stocking_load
from legfem.stockings.leg import default_veins
from legfem.stockings.pressures import PressureProbe, tissue_pressures
from studies.making.shapes import parametric_leg, read_legs

LEGS = Path(__file__).resolve().parents[2] / "studies" / "stockings" / "legs.toml"


def main(solver: str, out: str) -> None:
    comm = MPI.COMM_WORLD
    whole = parametric_leg(read_legs(LEGS)["1"], n_points=90)
    shape = whole.at_levels(np.linspace(50, 110, 13))
    tissues = {"deep": NeoHookean(3e-3, 2.0), "superficial": NeoHookean(8e-3, 2.0)}
    settings = CompressionSettings(
        newton=NewtonSettings(relative_tolerance=1e-10), linear=LinearSettings(solver=solver, tolerance=1e-6)
    )
    mesh = SolidMeshSettings(skin_size=8, inside_size=10, bone_size=8)
    model = LegModel3D(shape, tissues, mesh, settings, comm)
    load = stocking_load(shape, fitted_stocking(shape, "3"))
    fascia = {"fascia.membrane.stiffness": 0.05}
    solved = model.solve(fascia, load.pressure, ("deep.C10",))
    assert solved.report.complete
    probe = PressureProbe(model.compression)
    pressures = tissue_pressures(probe, solved, load, default_veins(shape, 80.0))
    rate = solved.sensitivities["deep.C10"]
    found = {
        "skin": model.displacement("skin", solved.unknown),
        "hull": model.displacement("hull", solved.unknown),
        "rate": model.displacement("skin", rate),
        "veins": np.array(pressures.at_veins),
        "fat": np.array([pressures.greatest_in_fat]),
    }
    if comm.rank == 0:
        np.savez(out, ranks=comm.size, **found)


if __name__ == "__main__":
    main(*sys.argv[1:])
