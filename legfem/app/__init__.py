"""``legfem app``: the commands in a browser window, on this machine alone.

The pages are NiceGUI's. All of its traffic (pages, uploads, files and the socket) is one ASGI
application, so that one guard stands before everything (`legfem.app.guard`); uploads go to the disk
as they come in; fields and buttons are plain elements, outside of shadow roots, that phones,
keyboards and screen readers know; it loads nothing from elsewhere. Its wheel is 8.5 MB (Panel's
20.6 MB) and it brings some forty packages, 105 MB installed, where Panel would bring eleven: that
is its price. Dash takes uploads through memory, in Base64.

What the pages show stands in files (`legfem.app.workspace`), and what they start are the commands,
as processes of their own (`legfem.app.runs`). The server keeps nothing.
"""
