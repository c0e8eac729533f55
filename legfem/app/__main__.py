"""``legfem app``: see `legfem.commands.app`."""

from legfem.__main__ import command

app = command("app", __name__)
