/* Splittings on (e, L) that are not what they claim; -DKIND=k chooses one. */
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

#if KIND == 0 /* Ruth's third order, the kicks read backwards */
static const double a[] = {1.0, -2.0 / 3, 2.0 / 3}, b[] = {7.0 / 24, 3.0 / 4, -1.0 / 24};
#elif KIND == 1 /* Yoshida's fourth order, the coefficients in single precision */
static const double a[] = {0.675603596f, -0.175603596f, -0.175603596f, 0.675603596f},
                    b[] = {1.351207192f, -1.702414384f, 1.351207192f, 0};
#elif KIND == 2 /* McLachlan's fourth order of 1995, each stage with its adjoint last: of order 2, as a library had it */
#define S 4.358898943540674
#define C1 ((146 + 5 * S) / 540)
#define C2 ((-2 + 10 * S) / 135)
#define C3 (1.0 / 5)
#define C4 ((-23 - 20 * S) / 270)
#define C5 ((14 - S) / 108)
static const double a[] = {C1, C5 + C2, C4 + C3, C3 + C4, C2 + C5, C1}, b[] = {C1 + C5, C2 + C4, 2 * C3, C4 + C2, C5 + C1, 0};
#else /* Strang's, and a kick that forgets to come back: 0.5 and 0.5000001 */
static const double a[] = {0.0, 1.0}, b[] = {0.5, 0.5000001};
#endif

void step(double *y, double h, const double *par, long n) {
    for (long k = 0; k < n; k++)
        for (unsigned i = 0; i < sizeof a / sizeof *a; i++) {
            drift(y, a[i] * h, par[0]);
            kick(y, b[i] * h * par[2]);
        }
}

#ifdef PROGRAM /* the time is summed in single precision, and the end is where it says so */
int main(void) {
    double par[3], h, y[6];
    long n, stride, rows = 0;
    if (scanf("%lf %lf %lf %lf %ld %ld", par, par + 1, par + 2, &h, &n, &stride) != 6) return 1;
    for (int i = 0; i < 6; i++)
        if (scanf("%lf", y + i) != 1) return 1;
    float t = 0;
    for (rows = 0; rows <= n / stride; rows++) {
        while (fabsf(t) < (float)fabs(rows * stride * h)) {
            kick(y, 0.5 * h * par[2]);
            drift(y, h, par[0]);
            kick(y, 0.5 * h * par[2]);
            t += (float)h;
        }
        printf("%.17g %.17g %.17g %.17g %.17g %.17g\n", y[0], y[1], y[2], y[3], y[4], y[5]);
    }
    return 0;
}
#endif
