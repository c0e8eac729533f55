"""The model on a mesh: spaces, forms, symbols, history, fields.

DOLFINx's and PETSc's wheels find their MPI library only after mpi4py has loaded it, so that it is imported before them.
"""

import mpi4py.MPI  # noqa: F401
