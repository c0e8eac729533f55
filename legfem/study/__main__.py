"""``python -m legfem.study``."""

from legfem.study.cli import app

if __name__ == "__main__":
    app(prog_name="python -m legfem.study")
