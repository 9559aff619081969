/* Vectors in space, as symtop/methods/engines/engines.py has them, and the rotations of symtop/methods/lie_group/loop.py. */

typedef struct { double x, y, z; } Vector;
typedef struct { double w, x, y, z; } Quaternion;

static inline double dot(Vector a, Vector b) { return a.x * b.x + a.y * b.y + a.z * b.z; }

static inline Vector cross(Vector a, Vector b) {
    return (Vector){a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

static inline Vector scaled(double s, Vector a) { return (Vector){s * a.x, s * a.y, s * a.z}; }

static inline Vector plus(Vector a, double s, Vector b) { return (Vector){a.x + s * b.x, a.y + s * b.y, a.z + s * b.z}; }

static inline Quaternion product(Quaternion a, Quaternion b) {
    return (Quaternion){
        a.w * b.w - a.x * b.x - a.y * b.y - a.z * b.z,
        a.w * b.x + a.x * b.w + a.y * b.z - a.z * b.y,
        a.w * b.y - a.x * b.z + a.y * b.w + a.z * b.x,
        a.w * b.z + a.x * b.y - a.y * b.x + a.z * b.w,
    };
}

static inline Vector moved(double m, Vector v, Vector x) { /* p x p* - x for p = (1 + m, v) */
    Vector c = cross(v, x);
    return scaled(2.0, plus(cross(v, c), 1.0 + m, c));
}

static inline void cayley(Vector u, double *m, Vector *v) {
    double square = dot(u, u), root = sqrt(1.0 + square);
    *m = -square / (root * (1.0 + root));
    *v = scaled(1.0 / root, u);
}

static inline Vector solved(Vector a, Vector b, Vector c, Vector y) { /* Cramer's rule for columns a, b, c */
    Vector bc = cross(b, c), ca = cross(c, a), ab = cross(a, b);
    double inverse = 1.0 / dot(a, bc);
    return (Vector){inverse * dot(bc, y), inverse * dot(ca, y), inverse * dot(ab, y)};
}
