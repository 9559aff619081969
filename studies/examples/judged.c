/* An integrator in C, symplectic Euler on y = (e, L) with the axis turned exactly about L: a kick, then a drift.

       cc -O2 -shared -fPIC studies/examples/judged.c -o judged.so -lm
       symtop judge ./judged.so --order 1 --symplectic

   par holds I1, I3 and mgl; n steps of h are made in place. */
#include <math.h>

void step(double *y, double h, const double *par, long n) {
    for (long k = 0; k < n; k++) {
        double *e = y, *L = y + 3, kx = h * par[2] * e[1], ky = h * par[2] * e[0];
        L[0] -= kx;
        L[1] += ky;
        double size = sqrt(L[0] * L[0] + L[1] * L[1] + L[2] * L[2]), angle = h * size / par[0];
        double u = L[0] / size, v = L[1] / size, w = L[2] / size, c = cos(angle), s = sin(angle);
        double along = (1 - c) * (u * e[0] + v * e[1] + w * e[2]);
        double x = v * e[2] - w * e[1], y_ = w * e[0] - u * e[2], z = u * e[1] - v * e[0];
        e[0] = c * e[0] + s * x + along * u;
        e[1] = c * e[1] + s * y_ + along * v;
        e[2] = c * e[2] + s * z + along * w;
    }
}
