"""``legfem plan``: see `legfem.commands.plan`."""

from legfem.__main__ import command

app = command("plan")

if __name__ == "__main__":
    app(prog_name="legfem plan")
