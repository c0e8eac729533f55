"""The command ``python -m legfem.stocking``; the room is `legfem.stockings`."""
