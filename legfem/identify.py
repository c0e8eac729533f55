"""``legfem identify``: see `legfem.commands.identify`."""

from legfem.__main__ import command

app = command("identify")

if __name__ == "__main__":
    app(prog_name="legfem identify")
