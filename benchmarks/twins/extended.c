/* The maps of four methods in 80-bit arithmetic, for benchmarks/roundoff.py: the same method, written once more and
   rounding 2000 times less. Each advances a state n steps; increments are summed plainly. */

#include <math.h>

typedef long double real;

static real slope(const real *top, real theta) { /* V' of (I1, mgl, north, south) */
    real s = sinl(theta / 2), c = cosl(theta / 2), up = top[2] / (s * s), down = top[3] / (c * c);
    return s * c * ((up + down) * (down - up) / (8 * top[0]) - 2 * top[1]);
}

void stormer_verlet(const real *top, real *y, real h, long n) {
    real force = slope(top, y[0]);
    for (long k = 0; k < n; k++) {
        y[1] -= h / 2 * force;
        y[0] += h * y[1] / top[0];
        force = slope(top, y[0]);
        y[1] -= h / 2 * force;
    }
}

void midpoint(const real *top, real *y, real h, long n) { /* x = theta in the middle: x = theta + h/2I1 (p - h/2 V'(x)) */
    real last = slope(top, y[0]);
    for (long k = 0; k < n; k++) {
        real free = y[0] + h * y[1] / (2 * top[0]), scale = h * h / (4 * top[0]), x = free - scale * last, old = x, f;
        for (int i = 0; i < 100; i++) { /* a contraction by h^2 V''/4 I1, to stagnation */
            f = slope(top, x);
            real next = free - scale * f;
            if (next == x || next == old) break;
            old = x;
            x = next;
        }
        last = f;
        y[0] += h / top[0] * (y[1] - h / 2 * f);
        y[1] -= h * f;
    }
}

static void space(const real *top, real *y, real h, long n, int cayley) { /* (e, L), kick-drift-kick */
    real *e = y, *L = y + 3;
    for (long k = 0; k < n; k++) {
        L[0] -= h / 2 * top[1] * e[1];
        L[1] += h / 2 * top[1] * e[0];
        real tau = h / (2 * top[0]), square = L[0] * L[0] + L[1] * L[1] + L[2] * L[2], size = sqrtl(square);
        real w = cayley ? 1 / sqrtl(1 + tau * tau * square) : cosl(tau * size);
        real s = cayley ? tau * w : sinl(tau * size) / size;
        real x = L[1] * e[2] - L[2] * e[1], v = L[2] * e[0] - L[0] * e[2], z = L[0] * e[1] - L[1] * e[0];
        real a = L[1] * z - L[2] * v, b = L[2] * x - L[0] * z, c = L[0] * v - L[1] * x;
        e[0] += 2 * s * (w * x + s * a);
        e[1] += 2 * s * (w * v + s * b);
        e[2] += 2 * s * (w * z + s * c);
        L[0] -= h / 2 * top[1] * e[1];
        L[1] += h / 2 * top[1] * e[0];
    }
}

void strang(const real *top, real *y, real h, long n) { space(top, y, h, n, 0); }
void cayley(const real *top, real *y, real h, long n) { space(top, y, h, n, 1); }
