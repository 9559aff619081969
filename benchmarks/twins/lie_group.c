/* Twin of symtop/methods/lie_group/loop.py around one map: -DRUNGE_KUTTA lie_runge_kutta.py, -DVARIATIONAL
   lie_variational.py, -DENERGY_MOMENTUM energy_momentum.py, -DALPHA generalised_alpha.py, -DCOLLECTIVE
   collective_gauss.py.

   SHARES is the number of parts of a step, STAGES that of the stages, WEIGHTS that of the entries of a Lie table. */

#include "march.h"

#include "vectors.h"

#if defined(RUNGE_KUTTA) || defined(ALPHA)
#include "half_angle.h"
#endif

#define DIM 7

#if defined(RUNGE_KUTTA) || defined(COLLECTIVE)
typedef struct { double I1, mgl, twist; } Par;
#else
typedef struct { double I1, I3, mgl; } Par;
#endif
typedef struct { double m; Vector v, dL; long work; int outcome; } Turn;

static inline Vector gravity(const Par *par, Vector e) { return (Vector){-par->mgl * e.y, par->mgl * e.x, 0.0}; }

#if defined(ENERGY_MOMENTUM) || defined(ALPHA)

static inline Vector inertia(const Par *par, Vector e, Vector x) {
    return plus(scaled(par->I1, x), (par->I3 - par->I1) * dot(e, x), e);
}

#endif

#ifdef RUNGE_KUTTA

typedef struct { double weights[WEIGHTS], counts[STAGES], brackets, shares[SHARES]; } Rule;
typedef struct { Vector w[STAGES], f[STAGES]; } Carry;

static const double CUBIC[9] = {
    1.0 / 6, 1.0 / 120, 1.0 / 5040, 1.0 / 362880, 1.0 / 39916800, 1.0 / 6227020800, 1.0 / 1307674368000,
    1.0 / 355687428096000, 1.0 / 121645100408832000,
};

static inline Vector exponential(Vector w, Vector f, double *m, Vector *v) {
    double square = 0.25 * dot(w, w), s, cubic;
    if (square < 1.0) {
        s = 0.5 * series(square, SINE);
        *m = -square * series(square, COSINE);
        cubic = series(4.0 * square, CUBIC);
    } else {
        double x = sqrt(square), half = sin(0.5 * x);
        s = 0.5 * sin(x) / x;
        *m = -2.0 * half * half;
        cubic = (1.0 - 2.0 * s * (1.0 + *m)) / (4.0 * square);
    }
    Vector bent = cross(w, f);
    *v = scaled(s, w);
    return plus(plus(f, 2.0 * s * s, bent), cubic, cross(w, bent));
}

static inline void bracket(Vector w, Vector f, Vector x, Vector g, Vector *y, Vector *z) {
    *y = cross(w, x);
    *z = plus(cross(w, g), 1.0, cross(f, x));
}

static inline Turn turn(const Par *par, const Rule *rule, Vector e, Vector L, Carry *at, double h) {
    const Vector none = {0.0, 0.0, 0.0}, f0 = {0.0, 0.0, par->mgl};
    Turn done = {0.0, none, none, STAGES, 0};
    int row = 0;
    at->w[0] = scaled(1.0 / par->I1, L);
    at->f[0] = f0;
    for (int i = 1; i <= STAGES; i++) {
        Vector x = e, w = none, f = none;
        done.m = 0.0, done.v = none, done.dL = none;
        for (int k = 0; k < (int)rule->counts[i - 1]; k++) {
            double m;
            Vector u;
            w = none, f = none;
            for (int j = 0; j < i; j++) {
                double weight = h * rule->weights[row + j];
                w = plus(w, weight, at->w[j]);
                f = plus(f, weight, at->f[j]);
            }
            row += STAGES;
            Vector b = exponential(w, f, &m, &u);
            x = plus(x, 1.0, moved(m, u, x));
            done.dL = plus(plus(done.dL, 1.0, moved(m, u, plus(L, 1.0, done.dL))), 1.0, cross(b, x));
            double mixed = done.m + m + done.m * m - dot(u, done.v);
            done.v = plus(plus(scaled(1.0 + m, done.v), 1.0 + done.m, u), 1.0, cross(u, done.v));
            done.m = mixed;
        }
        if (i < STAGES) {
            Vector slope = scaled(1.0 / par->I1, plus(L, 1.0, done.dL)), g = f0;
            if (rule->brackets > 0.0) {
                Vector once, once_f, twice, twice_f, next, next_f, four, four_f;
                bracket(w, f, slope, g, &once, &once_f);
                bracket(w, f, once, once_f, &twice, &twice_f);
                slope = plus(plus(slope, -0.5, once), 1.0 / 12.0, twice);
                g = plus(plus(g, -0.5, once_f), 1.0 / 12.0, twice_f);
                if (rule->brackets > 2.0) {
                    bracket(w, f, twice, twice_f, &next, &next_f);
                    bracket(w, f, next, next_f, &four, &four_f);
                    slope = plus(slope, -1.0 / 720.0, four);
                    g = plus(g, -1.0 / 720.0, four_f);
                    if (rule->brackets > 4.0) {
                        bracket(w, f, four, four_f, &twice, &twice_f);
                        bracket(w, f, twice, twice_f, &next, &next_f);
                        slope = plus(slope, 1.0 / 30240.0, next);
                        g = plus(g, 1.0 / 30240.0, next_f);
                    }
                }
            }
            at->w[i] = slope;
            at->f[i] = g;
        }
    }
    return done;
}

#elif defined(VARIATIONAL)

#define MOST 60
#define ENOUGH 1e-10

typedef struct { double kind, shares[SHARES]; } Rule;
typedef struct { double unused; } Carry;

static inline Turn turn(const Par *par, const Rule *rule, Vector e, Vector L, Carry *at, double h) {
    double half = 0.5 * h, d = par->I3 - par->I1, n = 1.0, i = par->I1, x = 0.0;
    Vector kick = scaled(half, gravity(par, e)), a = scaled(half, plus(L, 1.0, kick));
    double A = dot(a, e);
    Vector across = plus(a, -A, e);
    double square = dot(across, across);
    Turn done = {0.0, kick, kick, MOST, 2};
    (void)at;
    if (rule->kind == 0.0) {
        double rate = A / par->I3;
        for (int k = 0; k < MOST; k++) {
            double along = rate * rate * n * n, D = par->I1 * par->I1 + d * d * along;
            double gap = 1.0 + along + square * n * n / D - n;
            double slope = 1.0 - 2.0 * along / n - 2.0 * square * n * par->I1 * par->I1 / (D * D);
            if (!(slope > 0.0)) return done;
            n += gap / slope;
            if (gap <= ENOUGH * slope * n) {
                done.work = k + 1, done.outcome = 0;
                break;
            }
        }
        x = rate * n;
    } else {
        double k = 0.0, low = 0.0, high = square / par->I1 + A * A / par->I3;
        for (int number = 0; number < MOST; number++) {
            double wide = par->I1 + k, j = par->I3 + k, y = A / j, bent = d * d * y * y, D = wide * wide + bent;
            double gap = par->I1 * square / D + par->I3 * y * y - k;
            double slope = 1.0 + 2.0 * par->I1 * square * (wide - bent / j) / (D * D) + 2.0 * par->I3 * y * y / j;
            if (gap > 0.0) low = k;
            else high = k;
            double after = k + gap / slope;
            if (!(low <= after && after <= high)) after = 0.5 * (low + high);
            double change = after - k;
            k = after;
            if (fabs(change) <= ENOUGH * j) {
                done.work = number + 1, done.outcome = 0;
                break;
            }
        }
        i = par->I1 + k;
        x = A / (par->I3 + k);
    }
    double bent = (par->I3 - par->I1) * x;
    Vector side = plus(scaled(i, across), -bent, cross(across, e));
    cayley(plus(scaled(x, e), n / (i * i + bent * bent), side), &done.m, &done.v);
    done.dL = plus(kick, half, gravity(par, plus(e, 1.0, moved(done.m, done.v, e))));
    return done;
}

#elif defined(ENERGY_MOMENTUM)

#define MOST 30
#define ENOUGH 1e-9

typedef struct { double shares[SHARES]; } Rule;
typedef struct { double unused; } Carry;

static inline Vector mean_axis(Vector e, Vector u) {
    double part = 1.0 / (1.0 + dot(u, u));
    return scaled(part, plus(plus(e, 1.0, cross(u, e)), dot(u, e), u));
}

static inline Vector column(
    const Par *par, Vector e, Vector u, Vector Ju, Vector mean, Vector pull, double quarter, Vector d
) {
    Vector Jd = inertia(par, e, d);
    double part = 1.0 / (1.0 + dot(u, u));
    Vector changed = plus(plus(plus(cross(d, e), dot(u, e), d), dot(d, e), u), -2.0 * dot(u, d), mean);
    Vector torque = gravity(par, scaled(part, changed));
    Vector rest = plus(plus(torque, -1.0, cross(u, torque)), -1.0, cross(d, pull));
    return plus(plus(plus(Jd, 1.0, cross(d, Ju)), 1.0, cross(u, Jd)), -quarter, rest);
}

static inline Turn turn(const Par *par, const Rule *rule, Vector e, Vector L, Carry *at, double h) {
    const Vector x = {1.0, 0.0, 0.0}, y = {0.0, 1.0, 0.0}, z = {0.0, 0.0, 1.0};
    double quarter = 0.25 * h * h;
    Vector a = scaled(0.5 * h, L), start = plus(a, quarter, gravity(par, e));
    double along = dot(start, e);
    Vector u = plus(scaled(1.0 / par->I1, start), along / par->I3 - along / par->I1, e);
    Turn done = {0.0, u, u, MOST, 2};
    (void)rule, (void)at;
    for (int k = 0; k < MOST; k++) {
        Vector mean = mean_axis(e, u), pull = gravity(par, mean), Ju = inertia(par, e, u);
        Vector rest = plus(plus(a, -1.0, Ju), -1.0, cross(u, Ju));
        rest = plus(rest, quarter, plus(pull, -1.0, cross(u, pull)));
        Vector change = solved(
            column(par, e, u, Ju, mean, pull, quarter, x), column(par, e, u, Ju, mean, pull, quarter, y),
            column(par, e, u, Ju, mean, pull, quarter, z), rest
        );
        u = plus(u, 1.0, change);
        if (fabs(change.x) + fabs(change.y) + fabs(change.z) <= ENOUGH * (1.0 + fabs(u.x) + fabs(u.y) + fabs(u.z))) {
            done.dL = scaled(h, gravity(par, mean_axis(e, u)));
            done.work = k + 1, done.outcome = 0;
            cayley(u, &done.m, &done.v);
            return done;
        }
    }
    return done;
}

#elif defined(ALPHA)

#define MOST 50
#define ENOUGH 1e-14

typedef struct { double m, f, gamma, beta, shares[SHARES]; } Rule;
typedef struct { Vector a, change; } Carry;

static inline Vector rates(const Par *par, Vector e, Vector x) {
    return plus(scaled(1.0 / par->I1, x), dot(x, e) * (1.0 / par->I3 - 1.0 / par->I1), e);
}

static inline Vector freely(const Par *par, Vector e, Vector w) { return cross(w, inertia(par, e, w)); }

static inline Vector column(const Par *par, Vector e, Vector rate, Vector J, double by, Vector d) {
    Vector Jd = inertia(par, e, d);
    return plus(Jd, by, plus(cross(d, J), 1.0, cross(rate, Jd)));
}

static inline Turn turn(const Par *par, const Rule *rule, Vector e, Vector L, Carry *at, double h) {
    const Vector x = {1.0, 0.0, 0.0}, y = {0.0, 1.0, 0.0}, z = {0.0, 0.0, 1.0};
    Vector a = at->a, w = rates(par, e, L), slope = at->change;
    double share = 1.0 / (1.0 - rule->m), last = INFINITY;
    Vector known = scaled(share, plus(scaled(rule->f, slope), -rule->m, a));
    Turn done = {0.0, a, a, MOST, 2};
    share *= 1.0 - rule->f;
    for (int k = 0; k < MOST; k++) {
        Vector b = plus(known, share, slope);
        Vector angle = scaled(h, plus(plus(w, h * (0.5 - rule->beta), a), h * rule->beta, b));
        double square = 0.25 * dot(angle, angle), s, m;
        if (square < 1.0) {
            s = 0.5 * series(square, SINE);
            m = -square * series(square, COSINE);
        } else {
            double q = sqrt(square), sine = sin(0.5 * q), cosine = cos(0.5 * q);
            s = 0.5 * (2.0 * sine * cosine / q);
            m = -2.0 * sine * sine;
        }
        Vector v = scaled(s, angle), gain = plus(scaled(h * (1.0 - rule->gamma), a), h * rule->gamma, b);
        Vector rate = plus(w, 1.0, gain), torque = gravity(par, plus(e, 1.0, moved(m, v, e)));
        torque = plus(torque, 1.0, moved(m, scaled(-1.0, v), torque));
        Vector J = inertia(par, e, rate);
        Vector rest = plus(plus(torque, -1.0, freely(par, e, rate)), -1.0, inertia(par, e, slope));
        double by = h * rule->gamma * share;
        Vector change = solved(
            column(par, e, rate, J, by, x), column(par, e, rate, J, by, y), column(par, e, rate, J, by, z), rest
        );
        double size = fabs(change.x) + fabs(change.y) + fabs(change.z);
        double scale = fabs(par->mgl) / par->I1 + rate.x * rate.x + rate.y * rate.y + rate.z * rate.z;
        slope = plus(slope, 1.0, change);
        if (size <= ENOUGH * scale || (size >= last && size <= 1e-10 * scale)) {
            at->a = plus(b, 1.0, moved(m, v, b));
            at->change = plus(slope, 1.0, moved(m, v, slope));
            done.m = m, done.v = v, done.dL = plus(inertia(par, e, gain), 1.0, moved(m, v, J));
            done.work = k + 1, done.outcome = 0;
            return done;
        }
        last = size;
    }
    return done;
}

#else

#define SWEEPS 100
#define ROUND_OFF 1e-14

typedef struct { double mu[STAGES][STAGES], b[STAGES], shares[SHARES]; } Rule;
typedef struct { double work[STAGES][9]; } Carry;

static inline Quaternion conjugate(Quaternion q) { return (Quaternion){q.w, -q.x, -q.y, -q.z}; }

static inline void field(const Par *par, Vector e, const double *y, double *out) {
    Quaternion g = {y[0], y[1], y[2], y[3]}, r = {y[4], y[5], y[6], y[7]};
    double quarter = 0.25 / par->I1, twice = 2.0 * par->mgl;
    Quaternion L = product(r, conjugate(g)), w = {0.0, quarter * L.x, quarter * L.y, quarter * L.z};
    Quaternion moves = product(w, g), turns = product(w, r), at = product(g, (Quaternion){0.0, e.x, e.y, e.z});
    out[0] = moves.w, out[1] = moves.x, out[2] = moves.y, out[3] = moves.z;
    out[4] = turns.w - twice * at.z, out[5] = turns.x - twice * at.y;
    out[6] = turns.y + twice * at.x, out[7] = turns.z + twice * at.w;
}

static inline Turn turn(const Par *par, const Rule *rule, Vector e, Vector L, Carry *at, double h) {
    double start[8] = {1.0, 0.0, 0.0, 0.0, 0.0, 2.0 * L.x, 2.0 * L.y, 2.0 * L.z}, slope[8], step[8];
    double weights[STAGES], last = INFINITY;
    double unit = 1.0 / (fabs(L.x) + fabs(L.y) + fabs(L.z) + sqrt(par->I1 * fabs(par->mgl)) + 1e-300);
    Turn done = {0.0, L, L, 0, 2};
    for (int i = 0; i < STAGES; i++) weights[i] = h * rule->b[i];
    if (STAGES > 2) {
        double inner = 0.0;
        for (int i = 1; i < STAGES - 1; i++) inner += weights[i];
        weights[0] = 0.5 * (h - inner);
        weights[STAGES - 1] = weights[0];
    }
    field(par, e, start, slope);
    for (int i = 0; i < STAGES; i++) {
        at->work[i][8] = weights[i];
        for (int m = 0; m < 8; m++) at->work[i][m] = weights[i] * slope[m];
    }
    while (done.work < SWEEPS) {
        double gap = 0.0;
        for (int i = 0; i < STAGES; i++) {
            double place[8];
            for (int m = 0; m < 8; m++) place[m] = start[m];
            for (int j = 0; j < STAGES; j++)
                for (int m = 0; m < 8; m++) place[m] = place[m] + rule->mu[i][j] * at->work[j][m];
            field(par, e, place, slope);
            for (int m = 0; m < 8; m++) {
                double value = at->work[i][8] * slope[m], change = fabs(value - at->work[i][m]);
                if (m >= 4) change = change * unit;
                if (change > gap) gap = change;
                at->work[i][m] = value;
            }
        }
        done.work++;
        if (!(0.0 < gap && gap < last)) {
            done.outcome = gap < ROUND_OFF ? 0 : 2;
            break;
        }
        last = gap;
    }
    for (int m = 0; m < 8; m++) {
        step[m] = 0.0;
        for (int i = 0; i < STAGES; i++) step[m] += at->work[i][m];
    }
    Quaternion dr = {step[4], step[5], step[6], step[7]}, back = {step[0], -step[1], -step[2], -step[3]};
    Quaternion linear = product((Quaternion){0.0, L.x, L.y, L.z}, back), bent = product(dr, back);
    done.m = step[0];
    done.v = (Vector){step[1], step[2], step[3]};
    done.dL = (Vector){
        0.5 * (dr.x + bent.x) + linear.x, 0.5 * (dr.y + bent.y) + linear.y, 0.5 * (dr.z + bent.z) + linear.z,
    };
    return done;
}

#endif

static void begin(const Par *par, const Rule *rule, const double *state, double h, Carry *carry) {
    (void)par, (void)rule, (void)state, (void)h;
    memset(carry, 0, sizeof *carry);
#ifdef ALPHA
    double w = state[0], x = state[1], y = state[2], z = state[3], right = x * z + w * y, back = y * z - w * x;
    Vector e = {right + right, back + back, w * w - x * x - y * y + z * z}, L = {state[4], state[5], state[6]};
    carry->a = rates(par, e, plus(gravity(par, e), -1.0, freely(par, e, rates(par, e, L))));
    carry->change = carry->a;
#endif
}

static inline int increment(
    const Par *par, const Rule *rule, const double *state, Carry *carry, double h, double *step, long *work
) {
    for (int i = 0; i < DIM; i++) step[i] = 0.0;
    *work = 0;
    for (int i = 0; i < SHARES; i++) {
        double w = state[0] + step[0], x = state[1] + step[1], y = state[2] + step[2], z = state[3] + step[3];
        Vector e = {2.0 * (x * z + w * y), 2.0 * (y * z - w * x), w * w - x * x - y * y + z * z};
        Vector L = {state[4] + step[4], state[5] + step[5], state[6] + step[6]};
        Turn done = turn(par, rule, e, L, carry, h * rule->shares[i]);
        *work += done.work;
        if (done.outcome) return done.outcome;
        double m = done.m + 0.5 * (1.0 + done.m) * (1.0 - (w * w + x * x + y * y + z * z));
        step[0] += m * w - (done.v.x * x + done.v.y * y + done.v.z * z);
        step[1] += m * x + (done.v.x * w + done.v.y * z - done.v.z * y);
        step[2] += m * y + (done.v.y * w + done.v.z * x - done.v.x * z);
        step[3] += m * z + (done.v.z * w + done.v.x * y - done.v.y * x);
        step[4] = step[4] + done.dL.x, step[5] = step[5] + done.dL.y, step[6] = step[6] + done.dL.z;
    }
    return finite_outcome(step[0] + step[1] + step[2] + step[3] + step[4] + step[5] + step[6]);
}

MARCH
