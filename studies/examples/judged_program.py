"""A program for ``symtop judge``, Heun's method on y = (e, L): a line of numbers in, a state every `stride` steps out.

symtop judge "python studies/examples/judged_program.py" --form program --order 2
symtop judge "python studies/examples/judged_program.py" --form server --order 2

As a program it is started for every run, and reads one line; as a server it is started once, and ends each answer with
an empty line.
"""

import sys


def f(y, I1, mgl):  # noqa: D103
    u, v, w = (value / I1 for value in y[3:])
    return v * y[2] - w * y[1], w * y[0] - u * y[2], u * y[1] - v * y[0], -mgl * y[1], mgl * y[0], 0.0


for line in sys.stdin:
    I1, I3, mgl, h, n, stride, *y = map(float, line.split())
    for k in range(int(n) + 1):
        if k % int(stride) == 0:
            sys.stdout.write(" ".join(map(repr, y)) + "\n")
        first = f(y, I1, mgl)
        last = f([value + h * slope for value, slope in zip(y, first, strict=True)], I1, mgl)
        y = [value + h / 2 * (a + b) for value, a, b in zip(y, first, last, strict=True)]
    sys.stdout.write("\n")
    sys.stdout.flush()
