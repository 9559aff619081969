/* Twin of symtop/methods/taylor/series.py, or with -DATTITUDE of attitude_series.py, of order 16.

   Vectors of four doubles are gcc's; a product is fused with a sum where the Python kernel fuses them. The spin that is
   added to a sample is no part of a step; the caller does it. */

#include "march.h"

#ifdef ATTITUDE
#define PLACE 4
#define LAST ORDER
#else
#define PLACE 3
#define LAST (ORDER + 1)
#endif
#define DIM (PLACE + 3)
#define ORDER 16

typedef struct { double I1, mgl, twist; } Par;
typedef struct { double turn, pull; } Rule;
typedef struct { double nothing; } Carry;
typedef double Four __attribute__((vector_size(32)));
typedef long long Lanes __attribute__((vector_size(32)));

#if defined(__FMA__) && defined(__AVX__)
#include <immintrin.h>
static inline Four fused(Four a, Four b, Four c) { return _mm256_fmadd_pd(a, b, c); }
#else
static inline Four fused(Four a, Four b, Four c) {
    return (Four){fma(a[0], b[0], c[0]), fma(a[1], b[1], c[1]), fma(a[2], b[2], c[2]), fma(a[3], b[3], c[3])};
}
#endif

static inline Four all(double x) { return (Four){x, x, x, x}; }
static inline Four swapped(Four x) { return __builtin_shuffle(x, (Lanes){1, 0, 2, 3}); }
static inline Four height(Four x) { return __builtin_shuffle(x, (Lanes){2, 2, 2, 2}); }

/* sum over 0 < j < n of U[j] X[n - j], the terms first that are known first, and then U[n] X[0] if `newest` */
static inline __attribute__((always_inline)) Four products(const Four *U, const Four *X, int n, int newest) {
    Four chain[2];
    int k = 0;
#pragma GCC unroll 16
    for (int d = n / 2; d >= 1; d--) {
        chain[k % 2] = k < 2 ? U[d] * X[n - d] : fused(U[d], X[n - d], chain[k % 2]);
        k++;
        if (n - d != d) {
            chain[k % 2] = k < 2 ? U[n - d] * X[d] : fused(U[n - d], X[d], chain[k % 2]);
            k++;
        }
    }
    if (newest) {
        chain[k % 2] = k < 2 ? U[n] * X[0] : fused(U[n], X[0], chain[k % 2]);
        k++;
    }
    return k == 1 ? chain[0] : chain[0] + chain[1];
}

/* sum by pairs of neighbours; overwrites the row */
static inline __attribute__((always_inline)) Four sum(Four *row, int count) {
#pragma GCC unroll 8
    while (count > 1) {
        int pairs = count / 2, odd = count % 2;
#pragma GCC unroll 16
        for (int i = 0; i < pairs; i++) row[i] = row[2 * i] + row[2 * i + 1];
        if (odd) row[pairs] = row[count - 1];
        count = pairs + odd;
    }
    return row[0];
}

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    (void)par, (void)rule, (void)state, (void)h;
    carry->nothing = 0.0;
}

static int increment(const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work) {
    (void)par, (void)carry, (void)h;
    double a = rule->turn, m = rule->pull, wx = state[PLACE], wy = state[PLACE + 1], p = state[PLACE + 2];
#ifdef ATTITUDE
    double qw = state[0], qx = state[1], qy = state[2], qz = state[3];
    double zr = 2.0 * fma(qx, qz, qw * qy), zi = 2.0 * fma(qy, qz, -(qw * qx));
    double upper = fma(qw, qw, qz * qz), lower = fma(qx, qx, qy * qy), u = upper - lower, length = upper + lower;
    double norm = length * length;
#else
    double zr = state[0], zi = state[1], u = state[2], norm = fma(zr, zr, fma(zi, zi, u * u));
#endif
    double P = a * p, ar = a * wx, ai = a * wy, ku = m * u * a, square = fma(ar, ar, ai * ai);
    double c1 = fma(2.0, ku, fma(P, P, square)), c0 = fma(P, fma(ar, zr, fma(ai, zi, P * u)), -(m * norm * a));
    double u1 = fma(ar, zi, -(ai * zr)), twice = fma(u, fma(3.0, ku, -c1), c0);
    Four S[LAST + 1], U[LAST + 1], row[ORDER + 1], A = all(a), M = all(m);
    Four turn = {-P, P, 0.0, 0.0}, U0 = {u, u, 0.0, 0.0};
    Four G = {ar, ai, fma(2.0, ku, c1 * (-1.0 / 3.0)), 0.0};
    S[1] = (Four){-zi, zr, u1, 0.0};
    S[2] = fused(swapped(S[1]), turn, (Four){u * ar, u * ai, twice, 0.0}) * all(0.5);
    U[1] = height(S[1]), U[2] = height(S[2]);
#pragma GCC unroll 16
    for (int n = 1; n < LAST - 1; n++) {
        Four product = n == 1 ? U0 * S[1] : fused(U0, S[n], products(U, S, n, 0));
        Four bent = fused(product * M, A, U[n] * G), turned = turn * all(1.0 / (n + 2));
        double per = 1.0 / ((n + 1) * (n + 2));
        S[n + 2] = fused(swapped(S[n + 1]), turned, bent * (Four){per, per, 3.0 * per, 3.0 * per});
        U[n + 2] = height(S[n + 2]);
    }
    for (int n = 2; n <= ORDER; n++) row[n - 2] = S[n];
    Four whole = S[1] + sum(row, ORDER - 1);
#ifdef ATTITUDE
    Four X[ORDER + 1];
    double real1 = fma(P, qw, fma(ar, qy, -(ai * qx))), imag1 = -fma(P, qz, fma(ar, qx, ai * qy));
    double real2 = fma(ar, qw, ai * qz) - P * qy, imag2 = fma(ai, qw, fma(P, qx, -(ar * qz)));
    double pull = m * length * a, base = fma(0.25, fma(P, P, square), 0.5 * ku);
    double rest1 = ku - fma(0.5, pull, base), rest2 = ku - fma(-0.5, pull, base);
    Four rest = {rest1, rest1, rest2, rest2};
    X[0] = (Four){qw, -qz, qy, -qx};
    X[1] = (Four){0.5 * imag1, -0.5 * real1, 0.5 * imag2, -0.5 * real2};
    X[2] = rest * X[0] * all(0.5);
#pragma GCC unroll 16
    for (int n = 1; n < ORDER - 1; n++) {
        Four bent = fused(products(U, X, n, 1) * M, A, rest * X[n]);
        X[n + 2] = bent * all(1.0 / ((n + 1) * (n + 2)));
    }
    for (int n = 2; n <= ORDER; n++) row[n - 2] = X[n];
    Four halves = X[1] + sum(row, ORDER - 1);
    step[0] = halves[0], step[1] = -halves[3], step[2] = halves[2], step[3] = -halves[1];
#else
    for (int n = 2; n <= ORDER + 1; n += 2) {
        Four term = S[n] * all(n);
        row[n / 2 - 1] = n < ORDER + 1 ? fused(S[n + 1], all(n + 1), term) : term;
    }
    Four bent = sum(row, (ORDER + 1) / 2);
    step[0] = bent[1], step[1] = -bent[0], step[2] = whole[2];
#endif
    step[PLACE] = m * whole[0], step[PLACE + 1] = m * whole[1], step[PLACE + 2] = 0.0;
    *work = 1;
    double seen = 0.0;
    for (int i = 0; i < PLACE + 2; i++) seen += step[i];
    return finite_outcome(seen);
}

MARCH
