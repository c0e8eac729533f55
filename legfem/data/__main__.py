"""``python -m legfem.data``: see `legfem.commands.data`."""

from legfem.commands.data import app

if __name__ == "__main__":
    app(prog_name="python -m legfem.data")
