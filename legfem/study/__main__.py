"""``legfem study``: see `legfem.commands.study`."""

from legfem.__main__ import command

app = command("study")

if __name__ == "__main__":
    app(prog_name="legfem study")
