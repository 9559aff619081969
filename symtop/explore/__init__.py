"""The explorer: sliders in a browser, each change one run beside the truth. `answers` computes, `server` speaks HTTP.

Nothing but the standard library on this side and plain JavaScript on the other: it works without a network, asks no
other machine for anything, and needs no package beyond symtop's own. A notebook server (marimo) was weighed against it:
25 more packages, and a page that fetches its front end from a content network.
"""
