"""The command ``legfem stocking``; the room is `legfem.stockings`."""
