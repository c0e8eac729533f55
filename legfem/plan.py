"""``python -m legfem.plan``: see `legfem.commands.plan`."""

if __name__ == "__main__":
    from legfem.commands.plan import app

    app(prog_name="python -m legfem.plan")
