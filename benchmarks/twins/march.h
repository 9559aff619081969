/* The stepping loop of the C twins: what symtop/methods/framework/loop.py compiles around every kernel family.

   A family's file defines DIM, the structs Par, Rule and Carry, and

       static void begin(const Par *, const Rule *, const double *state, double h, Carry *)
       static int increment(const Par *, const Rule *, const double *state, Carry *, double h, double *step, long *work)

   and ends with MARCH. Sizes that numba knows when it compiles (the length of a table) are macros here; the numbers
   of a table are data on both sides. Par and Rule hold nothing but doubles, in the order of the Python records.
   Outcomes: 0 ok, any other number stops the run. */

#include <math.h>
#include <string.h>

static inline void add(double *high, double *low, double increment) { /* Knuth's two-sum */
    double addend = increment + *low, total = *high + addend, virtual_part = total - *high;
    *low = (*high - (total - virtual_part)) + (addend - virtual_part);
    *high = total;
}

#define ADD(high, low, increment) add(high, low, increment) /* a family whose steps keep what they round off has another */

static inline int finite_outcome(double value) { return isfinite(value) ? 0 : 3; }

static inline int chart_outcome(double theta) {
    if (0.0 < theta && theta < M_PI) return 0;
    return isfinite(theta) ? 1 : 3;
}

#define MARCH                                                                                                        \
    /* advance `state` by n steps; returns the number of steps done, and the work they took in `work` */            \
    long march(const double *numbers, const double *table, double *state, double h, long n, long *work) {            \
        Par par;                                                                                                     \
        Rule rule;                                                                                                   \
        Carry carry;                                                                                                 \
        double now[DIM], low[DIM] = {0.0}, step[DIM];                                                                \
        long k, total = 0;                                                                                           \
        memcpy(&par, numbers, sizeof par);                                                                           \
        memcpy(&rule, table, sizeof rule);                                                                           \
        memcpy(now, state, sizeof now);                                                                              \
        begin(&par, &rule, now, h, &carry);                                                                          \
        for (k = 0; k < n; k++) {                                                                                    \
            long effort = 0;                                                                                         \
            if (increment(&par, &rule, now, &carry, h, step, &effort)) break;                                        \
            total += effort;                                                                                         \
            for (int i = 0; i < DIM; i++) ADD(&now[i], &low[i], step[i]);                                            \
        }                                                                                                            \
        memcpy(state, now, sizeof now);                                                                              \
        *work = total;                                                                                               \
        return k;                                                                                                    \
    }
