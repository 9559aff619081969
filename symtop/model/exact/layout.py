"""Index of each constant of the closed form in its array (a faster argument of compiled code than a NamedTuple)."""

KIND, UPRIGHT, P_PSI, W3, I1, PERIOD, PHI_PER_PERIOD, PSI_PER_PERIOD, THETA_LOW, THETA_HIGH = range(10)
SIGN_DOWN, SIGN_UP, FLOOR_SIGN, TWIST_DOWN, TWIST_UP, MAY_STOP, HYPERBOLIC, SCALE = range(10, 18)
ARITHMETIC, RATE_ERROR, VALUE_ERROR = range(18, 21)
REST_DOWN, REST_UP, REST_RATE = range(21, 24)
BEND = 24  # a cubic
QUARTERS, PHI_LINE, PSI_LINE = 28, 32, 36  # lines: rate and start, two doubles each
PHI_TURNS, DOWN_TURNS, UP_TURNS = 40, 44, 48  # lines in turns: phi, and half of phi + psi and phi - psi (upright)
FLOOR, CROWN = 52, 74  # frames of the lower and the upper turning point
STATUS = 96  # of the constants in double-double or quad-double, see `symtop.model.exact.constants`
ENERGY, P_PHI = 97, 98
NEAR_REAL, NEAR_IMAG, FAR_REAL, FAR_IMAG = 0, 4, 8, 12  # in a frame: cubics,
NEAR_GROWTH, FAR_GROWTH, STEEPNESS, LEAN, LEANING, THROUGH = range(16, 22)  # and numbers
SIZE = 99

RESTS, MOVES, CLIMBS = 0.0, 1.0, 2.0  # kinds of motion
EXACTLY, DOUBLE_DOUBLE, QUAD_DOUBLE, DIGITS = 0.0, 1.0, 2.0, 3.0  # arithmetic used
