"""``python -m legfem.plan``: see `legfem.commands.plan`."""

from legfem.commands.plan import app

if __name__ == "__main__":
    app(prog_name="python -m legfem.plan")
