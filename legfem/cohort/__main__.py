"""``legfem cohort``: see `legfem.commands.cohort`."""

from legfem.__main__ import command

app = command("cohort", __name__)
