"""``legfem diagnose``: see `legfem.commands.diagnose`."""

from legfem.__main__ import command

app = command("diagnose")

if __name__ == "__main__":
    app(prog_name="legfem diagnose")
