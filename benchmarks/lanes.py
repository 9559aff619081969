"""Many tops, or bodies, in lanes: nanoseconds a step of every method that has them, against one alone, on one core.

    python -m benchmarks.lanes

The tops are `MEMBERS` neighbours of spheroid with the step of `benchmarks.kernels`, and a call is all that
`FixedStep.many` does for them. The kernel for one and the lanes are interleaved in random order. Bodies are neighbours
of heavy-brick. Beside them stand a second thread, on pieces of the members as `symtop.ensemble` makes them, and
heyoka's batch mode (`Batch`).

Eight lanes are not eight times as fast where the kernel for one has much to do at a time: a processor that begins two
operations a cycle on eight doubles begins three on one. By its machine code a step of eight takes at least, in cycles,
77 with strang[axis], 90 with strang[attitude], 124 with rk4[axis], 196 with rk4[attitude], 266 with rk4[angles]: half
the operations, and 8 for each of its divisions. At 3.6 GHz that is 2.7, 3.1, 4.3, 6.8 and 9.2 ns a step and top, and
the kernels for one of rk4, at 25, 36 and 58 ns, are 5.9, 5.3 and 6.3 times that: 7 is out of reach of any loop around
this arithmetic. On Lie groups nearly two operations a cycle begin in the kernel for one: 310 cycles of eight tops with
rkmk-se3-2, 10.8 ns a step and top, are an eighth of its 86 ns.
"""

import argparse
from collections.abc import Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np

import symtop
from benchmarks import kernels, twin
from benchmarks.pages import Table
from symtop.core.parallel import in_threads
from symtop.measure.timing import timings
from symtop.methods.framework.lanes import W, members_of
from symtop.methods.framework.loop import FixedStep, inside
from symtop.methods.runge_kutta.pairs import PAIRS
from symtop.methods.taylor import heyoka
from symtop.model import charts
from symtop.model.charts import BODY
from symtop.model.exact.closed_form import ClosedForms
from symtop.model.top import flat

MEMBERS = 4 * W
SPREAD = 0.001  # of theta, or of a body's first rate, from one neighbour to the next
SCENES = kernels.SCENE, "heavy-brick"  # of tops and of bodies
CALL, FASTER = 2e-3, 6  # seconds, long against the set-up of a member; rough speed-up by lanes
BATCHES, BATCH = 25, 0.002
ON_GROUPS = "explicit on Lie groups"
OTHERS, OF_BODIES = "other implicit", "bodies without symmetry"
WIDE = "series, exact-discrete and pairs with fixed steps"
LEAST = {  # required speed over the kernel for one, by kind
    "explicit": 7.0, ON_GROUPS: 5.0, "midpoint and trapezoidal": 6.0, "gauss": 3.0, OTHERS: 3.0, OF_BODIES: 3.0,
}  # fmt: skip
FIXED = {f"{pair.name}-fixed" for pair in PAIRS}
UNLIMITED = {"series", "exact-discrete"} | FIXED  # one step uses vectors already, or is mostly a dependency chain
THREADED = {("strang", "axis"): 20_000, ("srkn-14-6", "attitude"): 3000}  # steps: some 10 ms a piece
PIECES = 8  # for two threads
HORIZON = 8.0
TOLERANCES = (1e-6, 1e-9)
RIVAL = ("srkn-14-6", "axis")  # run in lanes with the error that heyoka reaches
LADDER = np.unique(np.rint(np.geomspace(8, 2000, 120)).astype(int))  # steps, 5 % apart


class Row(NamedTuple):
    """One method in lanes: nanoseconds a step and member."""

    name: str
    chart: str
    alone: float
    in_lanes: float
    ratio: float
    ratio_low: float
    ratio_high: float


class Threads(NamedTuple):
    """The speed-up of one method by two threads."""

    name: str
    chart: str
    ratio: float  # the time of one thread over that of two
    ratio_low: float
    ratio_high: float


class Batch(NamedTuple):
    """heyoka's batch mode to t = `HORIZON`, and a method in lanes that is as accurate; seconds a top."""

    tolerance: float
    error: float  # of the axis, the largest of all tops
    steps: int  # of the method in lanes
    batch: float
    alone: float  # heyoka's integrator for one
    in_lanes: float


class LaneTimes(NamedTuple):
    """All measurements of this benchmark."""

    rows: Sequence[Row]
    threads: Sequence[Threads]
    batches: Sequence[Batch]


def members(count: int = MEMBERS, name: str = kernels.SCENE) -> np.ndarray:
    """Neighbours of a scene: (count, 9), of a body (count, 14)."""
    scene = symtop.scene(name, bodies=True)
    numbers = np.tile(flat(scene.top, scene.start), (count, 1))
    numbers[:, 11 if scene.of_body else 3] += SPREAD * np.arange(count)
    return numbers


def kind_of(name: str, chart: str) -> str:
    """The kind of a method that a limit of `LEAST` is set for, or `WIDE`."""
    if chart == BODY:
        return OF_BODIES
    if name in UNLIMITED:
        return WIDE
    method = symtop.integrator(name)
    if method.explicit:
        return ON_GROUPS if method.family == "lie-group" else "explicit"
    if name in ("midpoint", "trapezoidal"):
        return "midpoint and trapezoidal"
    return "gauss" if name.startswith("gauss-") else OTHERS


def limit_of(name: str, chart: str) -> str:
    """The limit as the table shows it."""
    limit = LEAST.get(kind_of(name, chart))
    return "not set" if limit is None else f"{limit:g}"


def solver_of(name: str, chart: str) -> FixedStep:
    """The solver of a row."""
    solver = inside(symtop.integrator(name).solvers[chart])
    assert solver is not None
    return solver


def together(solver: FixedStep, count: int, h: float, steps: int, scene: str = kernels.SCENE) -> Any:
    """A function that runs `count` members for this many steps."""
    arguments = members(count, scene), np.full(count, h), np.full((count, 1), steps)
    return lambda: solver.many(*arguments, compiling=True)


def on_bodies() -> dict[tuple[str, str], twin.Kernel]:
    """The kernels for a body without symmetry, and the numbers that they run on."""
    scene = symtop.scene(SCENES[1], bodies=True)
    h = scene.nutation_period / kernels.PER_NUTATION
    return {
        (name, BODY): twin.kernel_of(method, BODY, scene, h)
        for name, method in symtop.integrators().items()
        if BODY in method.solvers and inside(method.solvers[BODY])
    }


def steps() -> list[Row]:
    """Every method with lanes beside its kernel for one."""
    solvers, calls, counts = dict[tuple[str, str], FixedStep](), [], []
    for key, kernel in (kernels.kernels() | on_bodies()).items():
        solver = inside(symtop.integrator(key[0]).solvers[key[1]])
        if solver is None or not solver.in_lanes:
            continue
        solvers[key] = solver
        probe = timings([partial(twin.ours, kernel, kernels.CHECKED)], batches=3, batch=kernels.BATCH)[0]
        length = kernels.within(kernel, int(CALL / probe.best * kernels.CHECKED))
        lane = kernels.within(kernel, max(200, FASTER * length // MEMBERS))
        counts.append((length, lane * MEMBERS))
        calls += [partial(twin.ours, kernel, length), together(solver, MEMBERS, kernel.h, lane, SCENES[key[1] == BODY])]
    timed = timings(calls, batches=BATCHES, batch=BATCH)
    rows = []
    for key, (length, total), alone, beside in zip(solvers, counts, timed[::2], timed[1::2], strict=True):
        gain, *spread = (total / length * value for value in kernels.ratio(alone, beside))
        rows.append(Row(*key, alone.best / length * 1e9, beside.best / total * 1e9, gain, *spread))
    return rows


def threads() -> list[Threads]:
    """Two threads against one, on pieces as `symtop.ensemble` makes them."""
    h, rows = symtop.scene(kernels.SCENE).nutation_period / kernels.PER_NUTATION, []
    for (name, chart), steps in THREADED.items():
        piece = together(solver_of(name, chart), MEMBERS, h, steps)

        def run_pieces(count: int, piece: Any = piece) -> list[Any]:
            return list(in_threads(lambda _: piece(), range(PIECES), count))

        one, two = timings([partial(run_pieces, count) for count in (1, 2)], batches=BATCHES, batch=BATCH)
        rows.append(Threads(name, chart, *kernels.ratio(one, two)))
    return rows


class Batches:
    """heyoka on many tops, to t = `HORIZON`."""

    def __init__(self, numbers: np.ndarray, tolerance: float) -> None:
        import heyoka as hy

        system, self.wide = heyoka.equations("axis"), hy.recommended_simd_size()
        tops = [heyoka.start_numbers("axis", "double", *top) for top in members_of(numbers)]
        self.states, self.pars = np.array([state for state, _ in tops]), np.array([par[:2] for _, par in tops])
        self.single = heyoka.stepper("axis", "double", tolerance)
        self.batch = hy.taylor_adaptive_batch(system, np.zeros((len(system), self.wide)), tol=tolerance)
        self.steps_a_top = np.nan  # of the last call side by side

    def one_by_one(self) -> np.ndarray:
        """The last states, by the integrator for one."""
        single, ended = self.single, np.empty_like(self.states)
        for i in range(len(ended)):
            single.time, single.state[:], single.pars[:] = 0.0, self.states[i], self.pars[i]
            single.propagate_until(HORIZON)
            ended[i] = single.state
        return ended

    def side_by_side(self) -> np.ndarray:
        """The last states, in batches; the last of them repeats the last top where tops do not fill it."""
        batch, wide, steps, ended = self.batch, self.wide, 0, np.empty_like(self.states)
        for i in range(0, len(ended), wide):
            indices = np.minimum(np.arange(i, i + wide), len(ended) - 1)
            batch.set_time(0.0)
            batch.state[:], batch.pars[:] = self.states[indices].T, self.pars[indices].T
            batch.propagate_until(HORIZON)
            ended[indices] = batch.state.T
            steps += sum(count for *_, count in batch.propagate_res)
        self.steps_a_top = steps / (-(-len(ended) // wide) * wide)
        return ended


def batches() -> list[Batch]:
    """heyoka's batch mode beside its integrator for one and beside lanes, all on one core."""
    numbers = members()
    true = ClosedForms(numbers).axis(np.full((MEMBERS, 1), HORIZON))[:, 0]
    rival = solver_of(*RIVAL)
    ladder = [(int(steps), together(rival, MEMBERS, HORIZON / steps, int(steps))) for steps in LADDER]
    errors = [charts.axis_distance(call().states[:, 0, :3], true).max() for _, call in ladder]
    rows = []
    for tolerance in TOLERANCES:
        runs = Batches(numbers, tolerance)
        error = float(charts.axis_distance(runs.side_by_side()[:, :3], true).max())
        steps, call = next(entry for entry, reached in zip(ladder, errors, strict=True) if reached <= error)
        calls = [runs.side_by_side, runs.one_by_one, call]
        rows.append(Batch(tolerance, error, steps, *(t.best / MEMBERS for t in timings(calls, BATCHES, BATCH))))
    return rows


def verdict(measured: LaneTimes) -> list[str]:
    """Sentences: how much faster lanes are, compared with threads and heyoka's batches."""
    sentences = []
    for kind in (*LEAST, WIDE):
        rows = sorted((row for row in measured.rows if kind_of(*row[:2]) == kind), key=lambda row: row.ratio)
        if not rows:
            continue
        limit, least = LEAST.get(kind), rows[0]
        fast = "no limit is set"
        if limit is not None:
            enough = sum(row.ratio >= limit for row in rows)
            fast = f"{enough} of {len(rows)} methods make at least {limit:g} times the steps of their kernel for one"
        sentences.append(
            f"In lanes on one core, {kind}: {fast}; {rows[len(rows) // 2].ratio:.1f} times in the median, "
            f"and {least.ratio:.1f} times with {least.name}[{least.chart}], the least."
        )
    sentences += [
        f"Two threads run {row.name}[{row.chart}] in lanes {row.ratio:.2f} times as fast." for row in measured.threads
    ]
    sentences += [
        f"heyoka's batch mode at a tolerance of {row.tolerance:g} takes {row.batch * 1e6:.1f} us a top to t = "
        f"{HORIZON:g}, and {row.alone * 1e6:.1f} us alone; {RIVAL[0]}[{RIVAL[1]}] in lanes takes "
        f"{row.in_lanes * 1e6:.1f} us to the same error of {row.error:.0e}."
        for row in measured.batches
    ]
    return sentences


def tables(measured: LaneTimes) -> list[Table]:
    """The tables of the report."""
    return [
        Table(
            f"A step of {MEMBERS} tops, or bodies, in lanes, one core",
            ["method", "ns a step, alone", "in lanes", "times as fast", "spread of the fifths", "limit"],
            [
                [f"{row.name}[{row.chart}]", f"{row.alone:.1f}", f"{row.in_lanes:.2f}", f"{row.ratio:.1f}",
                 f"{row.ratio_low:.1f} to {row.ratio_high:.1f}", limit_of(*row[:2])]
                for row in measured.rows
            ],
        ),
        Table(
            "Lanes on two threads against one",
            ["method", "times as fast", "spread of the fifths"],
            [
                [f"{row.name}[{row.chart}]", f"{row.ratio:.2f}", f"{row.ratio_low:.2f} to {row.ratio_high:.2f}"]
                for row in measured.threads
            ],
        ),
        Table(
            f"{MEMBERS} tops to t = {HORIZON:g}, one core: heyoka's batch mode and lanes",
            ["tolerance", "error of the axis", "us a top in batches", "alone", f"{RIVAL[0]}[{RIVAL[1]}]", "steps"],
            [
                [f"{row.tolerance:g}", f"{row.error:.1e}", f"{row.batch * 1e6:.2f}", f"{row.alone * 1e6:.2f}",
                 f"{row.in_lanes * 1e6:.2f}", str(row.steps)]
                for row in measured.batches
            ],
        ),
    ]  # fmt: skip


def measure() -> LaneTimes:
    """Measure steps, threads and batches."""
    return LaneTimes(steps(), threads(), batches())


if __name__ == "__main__":
    argparse.ArgumentParser(description=str(__doc__).partition("\n")[0]).parse_args()  # it has --help alone
    measured = measure()
    print("\n".join([*(table.text for table in tables(measured)), *verdict(measured)]))
