"""``python -m legfem.stocking``: see `legfem.stocking.cli`."""

from legfem.stocking.cli import app

if __name__ == "__main__":
    app(prog_name="python -m legfem.stocking")
