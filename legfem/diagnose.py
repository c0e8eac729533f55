"""``python -m legfem.diagnose``: see `legfem.commands.diagnose`."""

if __name__ == "__main__":
    from legfem.commands.diagnose import app

    app(prog_name="python -m legfem.diagnose")
