/* DOP853 with SciPy's control of the step as a plain loop, for symtop/methods/runge_kutta/pairs.py; AXIS, ATTITUDE or ANGLES.

   `table` holds the twelve rows of a (its last row is b), the weights of both error estimates, a row of 12 doubles each;
   terms whose coefficient is zero are left out by their place, as Hairer's program does. No samples but the end. */

#include <math.h>
#include <string.h>

static inline int finite_outcome(double value) { return isfinite(value) ? 0 : 3; }
static inline int chart_outcome(double theta) { return 0.0 < theta && theta < M_PI ? 0 : isfinite(theta) ? 1 : 3; }

#include "fields.h"

#define STAGES 12

typedef double Slopes[STAGES + 1][DIM];

static const int first[STAGES] = {1, 1, 2, 2, 3, 3, 3, 3, 3, 3, 3, 5}; /* the terms 1 .. first-1 of a row are zero */

static inline void sum(const double *row, int from, int terms, const double *start, Slopes slopes, double h, double *out) {
    double weight = h * row[0];
    for (int m = 0; m < DIM; m++) out[m] = start[m] + weight * slopes[0][m];
    for (int j = from; j < terms; j++) {
        weight = h * row[j];
        for (int m = 0; m < DIM; m++) out[m] += weight * slopes[j][m];
    }
}

static inline double rms(const double *vector, const double *state, const double *other, double tolerance) {
    double total = 0.0;
    for (int m = 0; m < DIM; m++) {
        double part = vector[m] / (tolerance + fmax(fabs(state[m]), fabs(other[m])) * tolerance);
        total += part * part;
    }
    return sqrt(total / DIM);
}

static inline double start_step(const Par *par, const double *y, const double *f, double end, double tolerance) {
    double d0 = rms(y, y, y, tolerance), d1 = rms(f, y, y, tolerance), moved[DIM], bent[DIM];
    double trial = fmin(d0 < 1e-5 || d1 < 1e-5 ? 1e-6 : 0.01 * d0 / d1, end);
    for (int m = 0; m < DIM; m++) moved[m] = y[m] + trial * f[m];
    field(par, moved, bent);
    for (int m = 0; m < DIM; m++) bent[m] -= f[m];
    double d2 = rms(bent, y, y, tolerance) / trial, most = fmax(d1, d2);
    double guess = most <= 1e-15 ? fmax(1e-6, 1e-3 * trial) : pow(0.01 / most, 0.125);
    return fmin(fmin(100.0 * trial, guess), end);
}

/* advance `state` to `end`; returns the steps, and the force evaluations in `work`; -1 if a step gets too small */
long integrate(
    const double *numbers, const double *table, double *state, double tolerance, double end, long *work
) {
    Par par;
    Slopes slopes;
    double y[DIM], new[DIM], place[DIM], wrong[DIM], zero[DIM] = {0.0}, t = 0.0;
    long steps = 0;
    memcpy(&par, numbers, sizeof par);
    memcpy(y, state, sizeof y);
    field(&par, y, slopes[0]);
    double step = start_step(&par, y, slopes[0], end, tolerance);
    *work = 2;
    while (t < end) {
        double least = 10.0 * (nextafter(t, INFINITY) - t), grow = 10.0;
        if (step < least) step = least;
        for (;;) {
            if (step < least) return -1;
            double after = fmin(t + step, end), h = after - t;
            for (int i = 1; i < STAGES; i++) {
                sum(table + STAGES * (i - 1), first[i - 1], i, y, slopes, h, place);
                field(&par, place, slopes[i]);
            }
            sum(table + STAGES * (STAGES - 1), first[STAGES - 1], STAGES, y, slopes, h, new);
            field(&par, new, slopes[STAGES]);
            *work += STAGES;
            sum(table + STAGES * STAGES, 5, STAGES, zero, slopes, h, wrong);
            double five = rms(wrong, y, new, tolerance);
            sum(table + STAGES * (STAGES + 1), 5, STAGES, zero, slopes, h, wrong);
            double three = rms(wrong, y, new, tolerance);
            double error = five == 0.0 && three == 0.0 ? 0.0 : five * five / sqrt(five * five + 0.01 * three * three);
            double change = error == 0.0 ? 10.0 : 0.9 * pow(error, -0.125);
            if (error < 1.0) {
                step = h * fmin(grow, change);
                t = after;
                break;
            }
            step = h * fmax(0.2, change);
            grow = 1.0;
        }
        steps++;
        if (judge(new, zero)) return -1;
        memcpy(y, new, sizeof y);
        memcpy(slopes[0], slopes[STAGES], sizeof slopes[0]);
    }
    memcpy(state, y, sizeof y);
    return steps;
}
