"""``python -m legfem.identify``: see `legfem.identify.cli`."""

from legfem.identify.cli import app

if __name__ == "__main__":
    app(prog_name="python -m legfem.identify")
