"""``legfem data``: see `legfem.commands.data`."""

from legfem.__main__ import command

app = command("data", __name__)
