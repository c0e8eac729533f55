"""Meshes by gmsh."""

import mpi4py.MPI  # noqa: F401  # first, see legfem.fem
