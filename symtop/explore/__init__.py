"""The explorer: a page with sliders; each change of one is a run beside the exact motion.

`answers` computes, `server` speaks HTTP. The server is of the standard library and the page of plain JavaScript: it
works without a network and needs no package beyond symtop's own. A notebook server (marimo) would need 25 more packages
and a page that fetches its front end from a content network.
"""
