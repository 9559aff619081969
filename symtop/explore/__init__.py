"""The explorer: a page with sliders; each change of one is a run beside the exact motion.

`answers` computes, `server` speaks HTTP, with the standard library, and the page is plain JavaScript: it works without
a network.
"""
