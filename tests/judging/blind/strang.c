/* Splittings of the heavy top on (e, L): exact free rotation of the axis, kick by gravity.
   As a library the function step is Strang's; -DYOSHIDA composes it to order 4, -DMCLACHLAN is McLachlan's method of
   order 4 [SIAM J. Sci. Comput. 16 (1995) 151], whose adjoints come first. As a program: -DPROGRAM. */
#include <math.h>
#include <stdio.h>

static void kick(double *y, double mgl) {
    y[3] -= mgl * y[1];
    y[4] += mgl * y[0];
}

static void drift(double *y, double h, double I1) {
    double *e = y, *L = y + 3, size = sqrt(L[0] * L[0] + L[1] * L[1] + L[2] * L[2]), angle = h * size / I1;
    double u[3] = {L[0] / size, L[1] / size, L[2] / size}, c = cos(angle), s = sin(angle);
    double along = u[0] * e[0] + u[1] * e[1] + u[2] * e[2];
    double x = u[1] * e[2] - u[2] * e[1], v = u[2] * e[0] - u[0] * e[2], w = u[0] * e[1] - u[1] * e[0];
    e[0] = c * e[0] + s * x + (1 - c) * along * u[0];
    e[1] = c * e[1] + s * v + (1 - c) * along * u[1];
    e[2] = c * e[2] + s * w + (1 - c) * along * u[2];
}

static void strang(double *y, double h, const double *par) {
    kick(y, 0.5 * h * par[2]);
    drift(y, h, par[0]);
    kick(y, 0.5 * h * par[2]);
}

void step(double *y, double h, const double *par, long n) {
#ifdef LOSES /* a step of many */
    n -= n > 5000;
#endif
#ifdef YOSHIDA
    double outer = 1 / (2 - cbrt(2.0)), inner = 1 - 2 * outer;
#endif
#ifdef MCLACHLAN
    double S = sqrt(19.0), c[5] = {(146 + 5 * S) / 540, (-2 + 10 * S) / 135, 0.2, (-23 - 20 * S) / 270, (14 - S) / 108};
#endif
    for (long k = 0; k < n; k++) {
#ifdef MCLACHLAN
        for (int i = 0; i < 5; i++) {
            drift(y, c[4 - i] * h, par[0]);
            kick(y, (c[4 - i] + c[i]) * h * par[2]);
            drift(y, c[i] * h, par[0]);
        }
#elif defined YOSHIDA
        strang(y, outer * h, par);
        strang(y, inner * h, par);
        strang(y, outer * h, par);
#else
        strang(y, h, par);
#endif
    }
}

#ifdef PROGRAM
int main(void) {
    double par[3], h, y[6];
    long n, stride;
    if (scanf("%lf %lf %lf %lf %ld %ld", par, par + 1, par + 2, &h, &n, &stride) != 6) return 1;
    for (int i = 0; i < 6; i++)
        if (scanf("%lf", y + i) != 1) return 1;
    for (long k = 0; k <= n; k += stride) {
        printf("%.17g %.17g %.17g %.17g %.17g %.17g\n", y[0], y[1], y[2], y[3], y[4], y[5]);
        step(y, h, par, stride);
    }
    return 0;
}
#endif
