"""The order of a method on a body without symmetry.

It is the slope of attitude errors against the exact motion, or the integrated one of a heavy body, by the rule of every
study (`symtop.measure.order`). Energy and momentum are judged over a long run as on a top (`constants`). A method may
be of higher order on one body than on others, as Fasso's is: that refutes nothing.
"""

import math

import numpy as np

from symtop.judging.claims.subject import Subject
from symtop.judging.findings import Finding, Measured, undecided, yes_no
from symtop.measure.accuracy import error_table
from symtop.measure.order import CLEARLY, order, order_verdict

PERIODS = 3.0  # natural periods, of the runs of the order
LEAST, COARSEST, FINEST, FALLS = 3.0, 300.0, 1e5, 11.0  # steps a natural period, and decades that errors fall by
RUNS = {False: 40, True: 20}  # of the order; the second with --quick


def measure(subject: Subject) -> list[Finding]:
    """The finding on the order."""
    method, scene, quick = subject.method, subject.scene, subject.quick
    period, power = scene.nutation_period, method.order or 1
    coarsest, horizon = max(LEAST, COARSEST / power**2), PERIODS * period
    counts = np.geomspace(coarsest, min(coarsest * 10.0 ** (FALLS / power), FINEST), RUNS[quick])
    settings = [period / count for count in counts]
    if method.adaptive:
        settings = [max(10.0**-power, method.least_tolerance) for power in np.linspace(2.0, 11.0, RUNS[quick])]
    table = error_table(scene, method, settings, horizon)
    step = table["step_size"].values if method.fixed_step else horizon / table["steps"].values
    error, bound = table["attitude"].values, table["attitude_bound"].values
    fit = order(step, error, bound, 2.0 * math.pi / period, method.order, symmetric=method.symmetric)
    verdict, why = order_verdict(method.order, fit), f"attitude {fit} on {scene.name}"
    if not math.isfinite(fit.slope):
        return [undecided("order", yes_no(method.order), fit.reason)]
    if verdict == "refuted" and fit.slope - fit.interval > (method.order or 0) + CLEARLY:
        verdict, why = "measured", f"{why}: here the error falls with a higher power"
    measured = Measured("order", fit.slope, text=f"{fit.slope:.2f}")
    return [Finding("order", yes_no(method.order), measured, verdict, why, fit.slope, fit.interval)]
