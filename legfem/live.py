"""``legfem live``: see `legfem.commands.live`."""

from legfem.__main__ import command

app = command("live", __name__)
