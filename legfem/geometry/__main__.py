"""``legfem geometry``: see `legfem.commands.geometry`."""

from legfem.__main__ import command

app = command("geometry")

if __name__ == "__main__":
    app(prog_name="legfem geometry")
