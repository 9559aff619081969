/* Right-hand sides: twins of field_axis, field_frame and field_attitude (symtop/methods/framework/space.py) and of field_angles
   (symtop/methods/framework/angles.py). -DAXIS, -DFRAME, -DATTITUDE or -DANGLES chooses one, and with it Par and DIM. */

#ifdef ANGLES
#include "sines.h"
#define DIM 6
typedef struct { double I1, I3, mgl; } Par;

static inline void field(const Par *par, const double *y, double *f) {
    double s, c;
    sines(y[0], &s, &c);
    if (s == 0.0) s = NAN;
    f[0] = y[3];
    f[1] = y[4];
    f[2] = y[5];
    double spin = par->I3 * (y[5] + y[4] * c);
    double turn = y[3] * (spin - 2.0 * par->I1 * y[4] * c) / (par->I1 * s);
    f[3] = s * (y[4] * (par->I1 * y[4] * c - spin) + par->mgl) / par->I1;
    f[4] = turn;
    f[5] = y[3] * y[4] * s - turn * c;
}

static inline int judge(const double *state, const double *step) {
    double reach = step[1] + step[2] + step[3] + step[4] + step[5];
    return chart_outcome(state[0] + step[0] + 0.0 * reach);
}
#else
#if defined(FRAME)
#define DIM 9
#elif defined(ATTITUDE)
#define DIM 7
#else
#define DIM 6
#endif
#ifdef PROJECTED
typedef struct { double I1, mgl, p_psi, energy, weight; } Par;
#elif defined(ATTITUDE)
typedef struct { double I1, mgl, lean; } Par;
#else
typedef struct { double I1, mgl, twist; } Par;
#endif

static inline void field(const Par *par, const double *y, double *f) {
#ifdef ATTITUDE
    double half = 0.5 / par->I1, px = half * y[4], py = half * y[5], pz = half * y[6];
    double right = 2.0 * (y[1] * y[3] + y[0] * y[2]), back = 2.0 * (y[2] * y[3] - y[0] * y[1]);
    double up = y[0] * y[0] - y[1] * y[1] - y[2] * y[2] + y[3] * y[3];
    double one = 1.0 / (y[0] * y[0] + y[1] * y[1] + y[2] * y[2] + y[3] * y[3]);
    right = one * right, back = one * back, up = one * up;
    double turn = 0.5 * (par->lean * (right * y[4] + back * y[5] + up * y[6]));
    f[0] = -(px * y[1] + py * y[2] + pz * y[3]) - turn * y[3];
    f[1] = px * y[0] + py * y[3] - pz * y[2] + turn * y[2];
    f[2] = py * y[0] + pz * y[1] - px * y[3] - turn * y[1];
    f[3] = pz * y[0] + px * y[2] - py * y[1] + turn * y[0];
    f[4] = -par->mgl * back;
    f[5] = par->mgl * right;
    f[6] = 0.0;
#else
    double inverse = 1.0 / par->I1, wx = inverse * y[3], wy = inverse * y[4], wz = inverse * y[5];
    f[0] = wy * y[2] - wz * y[1];
    f[1] = wz * y[0] - wx * y[2];
    f[2] = wx * y[1] - wy * y[0];
    f[3] = -par->mgl * y[1];
    f[4] = par->mgl * y[0];
    f[5] = 0.0;
#ifdef FRAME
    f[6] = wy * y[8] - wz * y[7];
    f[7] = wz * y[6] - wx * y[8];
    f[8] = wx * y[7] - wy * y[6];
#endif
#endif
}

static inline int judge(const double *state, const double *step) {
    (void)state;
    return finite_outcome(step[0] + step[1] + step[2] + step[3] + step[4] + step[5]);
}
#endif
