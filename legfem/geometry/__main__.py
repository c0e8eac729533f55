"""``python -m legfem.geometry``: see `legfem.commands.geometry`."""

from legfem.commands.geometry import app

if __name__ == "__main__":
    app(prog_name="python -m legfem.geometry")
