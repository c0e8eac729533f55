"""``legfem diagnose``: see `legfem.commands.diagnose`."""

from legfem.__main__ import command

app = command("diagnose", __name__)
