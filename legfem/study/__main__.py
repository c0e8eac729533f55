"""``python -m legfem.study``."""

from legfem.commands.study import app

if __name__ == "__main__":
    app(prog_name="python -m legfem.study")
