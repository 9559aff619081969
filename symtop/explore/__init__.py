"""The explorer: sliders in a browser, each change one run beside the truth. `answers` computes, `server` speaks HTTP.

Nothing but the standard library on this side and plain JavaScript on the other: it works without a network, asks no
other machine for anything, and needs no package beyond symtop's own. (A notebook server such as marimo was weighed:
some 25 more packages, a front end from a content network, and a redraw of its plots in several hundred milliseconds.)
"""
