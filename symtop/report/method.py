"""How it was measured, as the report says it: the top, its equations, the scenes, the errors, and the truth.

Formulas are LaTeX: the page shows them as MathML, the Markdown between dollar signs.
The scenes and the bounds of the truth on them are read from the package when the report is written.
"""

import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from symtop.core.numbers import EPSILON
from symtop.model.scenes import Scene, scenes
from symtop.report.tables import table
from symtop.run.reference.truth import reference


class Block(NamedTuple):
    """A paragraph, formulas, or a table with its title: the others are empty."""

    words: str = ""
    formulas: Sequence[str] = ()
    title: str = ""
    header: Sequence[str] = ()
    rows: Sequence[Sequence[str]] = ()


class Part(NamedTuple):
    """A part of the section under a heading of its own."""

    name: str  # of its anchor
    title: str
    blocks: Sequence[Block]


LAGRANGIAN = (
    r"T - U = \frac{I_1}{2} (\dot\theta^2 + \dot\varphi^2 \,\sin^2\theta)"
    r" + \frac{I_3}{2} (\dot\psi + \dot\varphi\,\cos\theta)^2 - mgl\,\cos\theta"
)
POTENTIAL = r"\frac{(p_\varphi - p_\psi\,\cos\theta)^2}{2 I_1 \sin^2\theta} + \frac{p_\psi^2}{2 I_3} + mgl\,\cos\theta"
TOP = (
    Block(
        "A rigid body turns about a fixed point on its axis of symmetry. I1 and I3 are its moments of inertia about "
        "that point, across and along the axis; mgl is its weight times the distance of its centre of gravity. Euler's "
        "angles, z-x-z, are phi (precession), theta (the inclination of the axis from the upward vertical) and psi "
        "(spin). The Lagrangian, kinetic less potential energy, is"
    ),
    Block(formulas=[LAGRANGIAN]),
    Block("It does not depend on phi and psi. Their momenta are therefore conserved:"),
    Block(
        formulas=[
            r"p_\psi = I_3 (\dot\psi + \dot\varphi\,\cos\theta)",
            r"p_\varphi = I_1 \dot\varphi\,\sin^2\theta + p_\psi\,\cos\theta",
        ]
    ),
    Block("The inclination moves like a particle in an effective potential, and its oscillation is the nutation:"),
    Block(formulas=[r"I_1 \ddot\theta = -\frac{dV}{d\theta}", f"V = {POTENTIAL}"]),
    Block(
        "Methods [angles] integrate these angles. Methods [axis] integrate the direction e of the axis and the angular "
        "momentum L in space, with k the upward vertical:"
    ),
    Block(formulas=[r"\dot e = \frac{L \times e}{I_1}", r"\dot L = mgl\,k \times e"]),
    Block("Methods [attitude] integrate L and the quaternion q that turns the body into space:"),
    Block(
        formulas=[
            r"\dot q = \frac{1}{2} \omega q",
            r"\omega = \frac{L}{I_1} + \left(\frac{1}{I_3} - \frac{1}{I_1}\right) p_\psi\,e",
        ]
    ),
)
ENERGY = (
    "difference of the energies over E0 - min V, the energy of the nutation: the height of the start above the steady "
    "precession with the same momenta; where that is 0, over I1 omega^2/2, omega the frequency of small nutations"
)
ERRORS = {  # what is measured, and its unit
    "axis": ("angle between the axis e and the true axis r: atan2(|e x r|, e.r)", "rad"),
    "attitude": ("angle of the smallest rotation from the true quaternion r to q: 4 asin(|q - r|/2), r or -r", "rad"),
    "theta": ("difference of the inclinations", "rad"),
    "energy": (ENERGY, "1"),
    "p_phi, p_psi": ("difference of the momenta over the larger of |p_phi| and |p_psi|", "1"),
}
SAMPLED = (
    "The error of a run is the largest of its samples, which are not commensurate with the nutation, unless a table "
    "says otherwise. A step is quoted in time or as steps a nutation; a tolerance is relative."
)
EXACT = (
    "The truth is the exact motion in elliptic functions. With u = cos theta between its turning points u1 and u2, and "
    "u3 the third root of the cubic that u' squared is,"
)


def text() -> str:
    """The section below its heading, in Markdown, formulas in LaTeX."""
    return "\n\n".join(f"### {part.title}\n\n" + "\n\n".join(map(_block, part.blocks)) for part in parts())


def _block(block: Block) -> str:
    if block.rows:
        return f"**{block.title}**\n\n{table(block.header, block.rows)}"
    return block.words or "\n\n".join(f"$${formula}$$" for formula in block.formulas)


def parts() -> list[Part]:
    """The section, part by part."""
    catalogue = list(scenes().values())
    bounds = {  # of the true axis at the end of each scene, in radians
        scene.name: float(reference(scene, np.array([scene.horizon]))["axis_error_bound"].values[0])
        for scene in catalogue
    }
    return [
        Part("top", "The top and its equations", TOP),
        Part("scenes", "The scenes", _scenes(catalogue, bounds)),
        Part("errors", "What an error is", _errors()),
        Part("reference", "What the truth is", _truth(max(bounds.values()))),
    ]


def _scenes(catalogue: Sequence[Scene], bounds: dict[str, float]) -> list[Block]:
    what = ["scene", "what it is for", "nutation period", "horizon", "bound of the truth (rad)"]
    problem = ["scene", "I1", "I3", "mgl", "theta", "phi", "psi", "theta'", "phi'", "psi'"]
    uses, starts = [], []
    for scene in catalogue:
        period = f"{scene.nutation_period:.9g}" if math.isfinite(scene.nutation_period) else "infinite"
        uses.append([scene.name, scene.purpose, period, f"{scene.horizon:.6g}", f"{bounds[scene.name]:.1e}"])
        top, at = scene.top, scene.start
        numbers = (top.I1, top.I3, top.mgl, at.theta, at.phi, at.psi, at.theta_dot, at.phi_dot, at.psi_dot)
        starts.append([scene.name, *(repr(number).removesuffix(".0") for number in numbers)])
    units = ", ".join(scene.name for scene in catalogue if scene.units == "SI")
    words = (
        "A scene is a top, a start and a horizon. Times are in the unit that fits I1, I3 and mgl"
        + (f", which is the second on {units}" if units else "")
        + "; tables write s for it on every scene. Angles are in radians, and every number below is to be read as the "
        "nearest double."
    )
    return [
        Block(words),
        Block(title="Scenes", header=what, rows=uses),
        Block(title="Tops and starts", header=problem, rows=starts),
    ]


def _errors() -> list[Block]:
    rows = [[name, words, unit] for name, (words, unit) in ERRORS.items()]
    return [Block(SAMPLED), Block(title="Errors", header=["error", "what is measured", "unit"], rows=rows)]


def _truth(largest: float) -> list[Block]:
    words = (
        "phi and psi are integrals of the third kind. Nothing is integrated step by step, so that the error does not "
        "grow with the number of steps. Each value has a bound: the rounding of the evaluation and the error of the "
        "two rates times the time. At the ends of the horizons above the bound of the axis is at most "
        f"{largest:.1e} rad, {largest / EPSILON:.0f} units of rounding. `symtop.reference` gives values and bounds at "
        "any time."
    )
    formulas = [
        r"u = u_1 + (u_2 - u_1) \operatorname{sn}^2 \tau",
        r"\tau = \tau_0 + \Omega t",
        r"\Omega^2 = \frac{mgl\,(u_3 - u_1)}{2 I_1}",
    ]
    return [Block(EXACT), Block(formulas=formulas), Block(words)]
