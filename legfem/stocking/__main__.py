"""``python -m legfem.stocking``: see `legfem.commands.stocking`."""

from legfem.commands.stocking import app

if __name__ == "__main__":
    app(prog_name="python -m legfem.stocking")
