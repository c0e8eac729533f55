"""``legfem geometry``: see `legfem.commands.geometry`."""

from legfem.__main__ import command

app = command("geometry", __name__)
