"""Heun's method as a program that writes raw doubles."""

import sys
from array import array

I1, I3, mgl, h, n, stride, *y = map(float, sys.stdin.readline().split())


def f(y):
    x, v, w = (value / I1 for value in y[3:])
    return (v * y[2] - w * y[1], w * y[0] - x * y[2], x * y[1] - v * y[0], -mgl * y[1], mgl * y[0], 0.0)


rows = array("d", y)
for k in range(int(n)):
    a = f(y)
    b = f([z + h * s for z, s in zip(y, a, strict=True)])
    y = [z + h / 2 * (s + u) for z, s, u in zip(y, a, b, strict=True)]
    if (k + 1) % int(stride) == 0:
        rows.extend(y)
sys.stdout.buffer.write(rows.tobytes())
