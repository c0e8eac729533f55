"""``legfem stocking``: see `legfem.commands.stocking`."""

from legfem.__main__ import command

app = command("stocking", __name__)
