"""judge(): anybody's integrator against its claims, in a process of its own, verdict by verdict."""

from collections.abc import Callable, Collection
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import xarray as xr

from symtop.core.errors import SymtopError, one_of
from symtop.judging import sandbox, text_report, trajectory
from symtop.judging.claims.subject import Request
from symtop.judging.findings import Finding, Ledger
from symtop.judging.sandbox import About
from symtop.methods.framework.registry import ENERGY_ERRORS
from symtop.model.charts import CHARTS
from symtop.model.scenes import Scene, scene as find_scene

Listener = Callable[[About | Finding], object]


@dataclass(frozen=True)
class StepLedger(Ledger):
    """The findings on a step that came through an adapter; shown as the report of the command."""

    about: About
    implied: frozenset[str] = frozenset()  # claims that follow from those that were made

    def __str__(self) -> str:
        lines = [text for one in self.findings if (text := text_report.line(one))]
        head = text_report.heading(self.about._asdict(), self.scene)
        return "\n".join([head, *lines, text_report.summary(self.findings, self.implied)])

    def dataset(self) -> xr.Dataset:
        """As of any ledger, with attributes that say what was judged."""
        return super().dataset().assign_attrs(self.about._asdict(), scene=self.scene)


def judge(
    target: Any, *, form: str | None = None, chart: str = "axis", scene: "str | Scene" = "spheroid",
    order: int | None = None, symplectic: bool | None = None, symmetric: bool | None = None,
    explicit: bool | None = None, conserves: Collection[str] | None = None, energy: str | None = None,
    adaptive: bool = False, quick: bool = False, tell: Listener | None = None,
) -> StepLedger:  # fmt: skip
    """Judge anything that steps: its order, structure, invariants and drift on the top, beside what is claimed of it.

    `target` is one of (`form` says which where it does not show)

        ode       a function step(f, t, y, h) -> y for y' = f(t, y), or "FILE.py:NAME"
        separable a function step(state, h, dT, dV) -> state of (theta, p_theta), or "FILE.py:NAME"
        rotation  a function step(q, w, h, inertia, torque) -> q, w of a rigid body, or "FILE.py:NAME"
        scipy     a class derived from scipy.integrate.OdeSolver, or "FILE.py:NAME"; with `adaptive`, at a tolerance
        diffrax   an instance of a solver, such as diffrax.Tsit5(), or "FILE.py:NAME"
        torch     a function step(f, t, y, h) -> y on batches of tensors, y of shape (batch, 6), or "FILE.py:NAME"
        jax       the same on batches of JAX arrays, compiled by jax.jit
        shared    "FILE.so" or "FILE.so:NAME": void step(double *y, double h, const double *par, long n)
        program   a command that reads one line and writes states (see `symtop.judging.adapters.program`)

    or states without a method: a CSV or netCDF file, a Dataset or a mapping (`symtop.judging.trajectory`), whose
    errors, drift and laws of growth are found.

    `chart` says what y is: "axis" (e, L), shape (6,); "attitude" (q, L), shape (7,); "angles" (theta, phi, psi and
    their rates), shape (6,), in radians and the units of the scene's top. Claims that are not made are measured all
    the same. `conserves` holds names such as "p_phi", "energy"; `energy` is "kept" or "bounded". The step runs in a
    process of its own: one that hangs or crashes costs a verdict and says so. `quick` takes ten seconds at most.
    `tell` is handed what is judged and then each finding, as they are made.

    Returns a `StepLedger`: ``ledger["order"]`` is a finding, ``print(ledger)`` shows all of them,
    ``ledger.dataset()`` is the same as a Dataset, ``ledger.refuted`` names the claims that are false. Raises
    SymtopError for a target that cannot be loaded and claims that make no sense.
    """
    one_of("chart", chart, CHARTS)
    if energy not in ENERGY_ERRORS:
        raise SymtopError(f"energy must be 'kept', 'bounded' or None, not {energy!r}", "energy")
    claims = {"order": order, "symplectic": symplectic, "symmetric": symmetric, "explicit": explicit}
    request = Request(
        target, form, chart, adaptive, find_scene(scene), quick,
        claims | {"conserves": conserves, "energy_error": energy},
    )  # fmt: skip
    made = request.claimed()  # claims that make no sense are refused before anything is loaded
    listen = tell or (lambda _: None)
    if form is None and trajectory.is_trajectory(target):
        if {order, symplectic, symmetric, explicit} != {None}:
            raise SymtopError("a trajectory shows no order, symplecticity, symmetry or cost: claim what it conserves")
        about = About(Path(target).stem if isinstance(target, (str, Path)) else "trajectory", "", "", 0.0)
        shown = trajectory.findings(target, request.scene, made.conserves or frozenset(), energy)
        listen(about)
        for one in shown:
            listen(one)
        return StepLedger(about.name, request.scene.name, tuple(shown), {}, about)
    findings: list[Finding] = []
    traces: dict[str, Any] = {}
    for event in sandbox.run(request):
        if isinstance(event, About):
            about = event
            listen(about)
            continue
        for one in event.findings:
            listen(one)
        findings += event.findings
        traces |= event.traces
    if not findings:
        raise SymtopError("it cannot be judged: its process ended before it was open")
    implied = {"time"} | ({"energy"} if energy is None and "energy" not in (conserves or ()) else set())
    return StepLedger(about.name, request.scene.name, tuple(findings), traces, about, frozenset(implied))
