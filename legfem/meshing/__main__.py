"""``legfem meshing``: see `legfem.commands.meshing`."""

from legfem.__main__ import command

app = command("meshing")

if __name__ == "__main__":
    app(prog_name="legfem meshing")
