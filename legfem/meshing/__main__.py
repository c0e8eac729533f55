"""``python -m legfem.meshing``: see `legfem.commands.meshing`."""

from legfem.commands.meshing import app

if __name__ == "__main__":
    app(prog_name="python -m legfem.meshing")
