"""``legfem cohort``: see `legfem.commands.cohort`."""

from legfem.__main__ import command

app = command("cohort")

if __name__ == "__main__":
    app(prog_name="legfem cohort")
