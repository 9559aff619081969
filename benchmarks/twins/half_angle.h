/* Series in the square of the half angle: SINE of sin(x)/x, COSINE of (1 - cos x)/x^2; for the twins of the space frame. */

static const double SINE[9] = {
    1.0, 1.0 / 6, 1.0 / 120, 1.0 / 5040, 1.0 / 362880, 1.0 / 39916800, 1.0 / 6227020800, 1.0 / 1307674368000,
    1.0 / 355687428096000,
};
static const double COSINE[9] = {
    1.0 / 2, 1.0 / 24, 1.0 / 720, 1.0 / 40320, 1.0 / 3628800, 1.0 / 479001600, 1.0 / 87178291200,
    1.0 / 20922789888000, 1.0 / 6402373705728000,
};

static inline double series(double x, const double *c) {
    double y = x * x, z = y * y;
    double low = (c[0] - c[1] * x) + y * (c[2] - c[3] * x), high = (c[4] - c[5] * x) + y * (c[6] - c[7] * x);
    return low + z * (high + z * c[8]);
}
