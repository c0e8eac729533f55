"""Run by mpirun: what a leg's solid mesh measures, and what a bad shape says on every rank."""

from __future__ import annotations

import sys

import numpy as np
from mpi4py import MPI
from test_solid_leg import BONE, DEEP, END, SKIN, SUPERFICIAL, calf, measure

from legfem.common.errors import InputError
from legfem.geometry.leg_shape import LegShape
from legfem.meshing.leg_sizes import SolidMeshSettings
from legfem.meshing.solid_leg import mesh_solid_leg

comm = MPI.COMM_WORLD
shape = calf()
leg = mesh_solid_leg(shape, SolidMeshSettings(skin_size=8.0), comm)
found = {
    "cells": leg.mesh.topology.index_map(3).size_global,
    "volumes": [measure(leg, tag) for tag in (SUPERFICIAL, DEEP)],
    "areas": [measure(leg, tag) for tag in (SKIN, BONE, END)],
}
swapped = {**shape.contours, "skin": shape.contours["hull"], "hull": shape.contours["skin"]}
try:
    mesh_solid_leg(LegShape(shape.levels, swapped), comm=comm)
except InputError as error:
    found["error"] = str(error)
if comm.rank == 0:
    np.savez(sys.argv[1], ranks=comm.size, **found)
