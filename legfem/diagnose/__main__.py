"""``python -m legfem.diagnose``: see `legfem.commands.diagnose`."""

from legfem.commands.diagnose import app

if __name__ == "__main__":
    app(prog_name="python -m legfem.diagnose")
