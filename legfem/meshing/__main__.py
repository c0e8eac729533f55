"""``legfem meshing``: see `legfem.commands.meshing`."""

from legfem.__main__ import command

app = command("meshing", __name__)
