"""``legfem identify``: see `legfem.commands.identify`."""

from legfem.__main__ import command

app = command("identify", __name__)
