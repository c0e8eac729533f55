"""``legfem live``: see `legfem.commands.live`."""

from legfem.__main__ import command

app = command("live")

if __name__ == "__main__":
    app(prog_name="legfem live")
