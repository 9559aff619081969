"""The explorer: a page with sliders, each change of which makes a run and compares it with the exact motion.

`answers` computes, `server` is an HTTP server by the standard library, and the page is plain JavaScript: it works
without a network.
"""
