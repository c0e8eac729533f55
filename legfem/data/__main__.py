"""``legfem data``: see `legfem.commands.data`."""

from legfem.__main__ import command

app = command("data")

if __name__ == "__main__":
    app(prog_name="legfem data")
