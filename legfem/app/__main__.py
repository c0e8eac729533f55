"""``legfem app``: see `legfem.commands.app`."""

from legfem.__main__ import command

app = command("app")

if __name__ == "__main__":
    app(prog_name="legfem app")
