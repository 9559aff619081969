/* Integrators on (e, L), each with a defect; -DKIND=k chooses one. KIND 3 has none: the explicit midpoint rule. */
#include <math.h>
#include <string.h>

static void field(const double *y, const double *par, double *dy) {
    const double *e = y, *L = y + 3;
    dy[0] = (L[1] * e[2] - L[2] * e[1]) / par[0];
    dy[1] = (L[2] * e[0] - L[0] * e[2]) / par[0];
    dy[2] = (L[0] * e[1] - L[1] * e[0]) / par[0];
    dy[3] = -par[2] * e[1];
    dy[4] = par[2] * e[0];
    dy[5] = 0;
}

static void turn(double *e, const double *L, double h, double I1) {
    double size = sqrt(L[0] * L[0] + L[1] * L[1] + L[2] * L[2]), angle = h * size / I1;
    double u[3] = {L[0] / size, L[1] / size, L[2] / size}, c = cos(angle), s = sin(angle);
    double along = (1 - c) * (u[0] * e[0] + u[1] * e[1] + u[2] * e[2]);
    double x = u[1] * e[2] - u[2] * e[1], v = u[2] * e[0] - u[0] * e[2], w = u[0] * e[1] - u[1] * e[0];
    e[0] = c * e[0] + s * x + along * u[0];
    e[1] = c * e[1] + s * v + along * u[1];
    e[2] = c * e[2] + s * w + along * u[2];
}

#if KIND == 0 /* the step passes through a float */
#define STEP double h = (float)given;
#else
#define STEP double h = given;
#endif

void step(double *y, double given, const double *par, long n) {
    STEP
#if KIND == 1 /* the state of the last call is kept, and what is given is not looked at again */
    static double mine[6];
    static int begun;
    if (begun) memcpy(y, mine, sizeof mine);
#endif
    for (long k = 0; k < n; k++) {
#if KIND == 2 /* symplectic Euler, one component of its force from before the drift */
        double old = y[1];
        turn(y, y + 3, h, par[0]);
        y[3] -= h * par[2] * old;
        y[4] += h * par[2] * y[0];
#else
        double a[6], b[6], z[6];
        field(y, par, a);
        for (int i = 0; i < 6; i++) z[i] = y[i] + h / 2 * a[i];
        field(z, par, b);
        for (int i = 0; i < 6; i++) y[i] += h * b[i];
#endif
    }
#if KIND == 1
    memcpy(mine, y, sizeof mine);
    begun = 1;
#endif
}
