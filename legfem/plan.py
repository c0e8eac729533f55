"""``legfem plan``: see `legfem.commands.plan`."""

from legfem.__main__ import command

app = command("plan", __name__)
