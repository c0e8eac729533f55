"""``legfem stocking``: see `legfem.commands.stocking`."""

from legfem.__main__ import command

app = command("stocking")

if __name__ == "__main__":
    app(prog_name="legfem stocking")
