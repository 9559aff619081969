"""May timed cases run side by side, one on each core? A trial of half a second says whether they disturb each other.

Workers time the same short run of a compiled method, one of them alone and all of them at once, in turns. Beside others
it takes as long as alone where cores share nothing that a run needs; it takes up to twice as long where two of them are
threads of one core, and longer still where there are more workers than cores. The times of a case are compared with
each other more than with those of other cases, and one case has a scene's methods in random order: what is left of a
disturbance meets all of them.
"""

import math
import os
import statistics
import time
from concurrent.futures import Executor
from typing import NamedTuple

from symtop.measure.timing import bare_run
from symtop.methods.framework.registry import integrator
from symtop.model.scenes import scene

METHOD, CHART, SCENE, STEPS, STEP = "strang", "axis", "spheroid", 4000, 1e-3  # a run takes 0.1 ms
SPAN = 0.03  # seconds of a worker in one turn
TURNS = 7
TRIES = 20  # to have all workers at once, the first time when they have to start
DISTURBED = 1.05  # times as long as alone: beyond it timed cases run one after another (1.00 to 1.03 on two cores)


class Turn(NamedTuple):
    """What one worker timed."""

    process: int
    begun: float  # on the clock that all processes share
    ended: float
    seconds: float  # of a run, in the mean: a worker that waits for a core counts the wait


def turn() -> Turn:
    """Time runs for `SPAN` seconds."""
    run = bare_run(scene(SCENE), integrator(METHOD), CHART, STEP, STEPS * STEP)
    run()  # its kernel may have to be compiled
    begun, count = time.monotonic(), 0
    while (ended := time.monotonic()) < begun + SPAN:
        run()
        count += 1
    return Turn(os.getpid(), begun, ended, (ended - begun) / count)


def slowdown(pool: Executor, size: int) -> float:
    """How many times longer a run takes while `size` workers of a pool run; infinite if they never did at once."""

    def at_once() -> list[Turn]:
        return [future.result() for future in [pool.submit(turn) for _ in range(size)]]

    for _ in range(TRIES):
        if len({one.process for one in at_once()}) == size:
            break
    ratios = []
    for _ in range(TURNS):
        alone, together = pool.submit(turn).result(), at_once()
        shared = min(one.ended for one in together) - max(one.begun for one in together)
        if shared > 0.5 * SPAN:
            ratios.append(max(one.seconds for one in together) / alone.seconds)
    return statistics.median(ratios) if ratios else math.inf
