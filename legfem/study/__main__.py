"""``legfem study``: see `legfem.commands.study`."""

from legfem.__main__ import command

app = command("study", __name__)
