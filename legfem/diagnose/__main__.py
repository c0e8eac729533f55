"""``python -m legfem.diagnose``: see `legfem.diagnose.cli`."""

from legfem.diagnose.cli import app

if __name__ == "__main__":
    app(prog_name="python -m legfem.diagnose")
