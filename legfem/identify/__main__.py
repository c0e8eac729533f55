"""``python -m legfem.identify``: see `legfem.commands.identify`."""

from legfem.commands.identify import app

if __name__ == "__main__":
    app(prog_name="python -m legfem.identify")
