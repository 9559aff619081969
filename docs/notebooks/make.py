"""Writes the notebooks beside this file from the pages below, with their outputs: python docs/notebooks/make.py.

A page is Markdown; its Python blocks become code cells, which share one namespace. What a cell prints becomes its
output, and each figure that it leaves open an image of 80 dots per inch.
"""

import base64
import contextlib
import io
import json
import os
import re
import tempfile
from pathlib import Path
from typing import Any

import matplotlib as mpl

mpl.use("Agg")
import matplotlib.pyplot as plt

HERE = Path(__file__).resolve().parent

FIRST = """\
# A first run

One top, one method, compared with the exact motion.

```python
import symtop

scene = symtop.scene("spheroid")
print(scene.top)
print(f"one nutation takes {scene.nutation_period:.4f} s, the run {scene.horizon:g} s")
```

`simulate` returns an `xarray.Dataset`; `errors` compares it with the truth, sample by sample.

```python
run = symtop.simulate(scene, "strang", step_size=0.01)
wrong = symtop.errors(run)
print(run.attrs["outcome_message"], "-", run.attrs["force_evaluations"], "force evaluations")
for name in ("axis", "attitude", "energy"):
    print(f"{name:<9} largest error {float(wrong[name].max(skipna=False)):.0e}")
```

```python
ax = symtop.plot(run)
```

**What does a smaller step buy?** A sweep over steps, as one dataset. A method of order p is a line of slope
p.

```python
import numpy as np

data = symtop.sweep(scene, ["midpoint", "strang", "rk4", "gauss-4"], step_size=np.geomspace(1e-3, 0.05, 8), quiet=True)
for name in data["variant"].values:
    error = data["axis"].sel(variant=name).values[0]
    slope = np.log(error[3] / error[1]) / np.log(data["step_size"].values[0, 0, 3] / data["step_size"].values[0, 0, 1])
    print(f"{name:<9} slope {slope:.1f}")
ax = symtop.plot(data)
```

**A run that goes wrong** is announced before it starts:

```python
symtop.simulate("goldstein", "midpoint", step_size=0.1, horizon=1000.0, guard=print);
```
"""

OWN = """\
# A method of your own

A table of numbers, or a function `step(f, t, y, h)`. Here: Ralston's method of order 3, from its tableau, and
Heun's as a function.

```python
import symtop

ralston = symtop.runge_kutta("ralston-3", ((), (1 / 2,), (0, 3 / 4)), (2 / 9, 1 / 3, 4 / 9), order=3)
run = symtop.simulate("spheroid", ralston, step_size=0.005)
print(f"largest axis error {float(symtop.errors(run)['axis'].max(skipna=False)):.0e} rad")
```

Beside the methods that are here, at the same steps:

```python
data = symtop.sweep("spheroid", [ralston, "rk4", "strang"], per_nutation=[50, 100, 200, 400, 800], quiet=True)
ax = symtop.plot(data, x="force_evaluations")
```

A plain function on the equations of the top, `f = symtop.field(chart, top)`. The state on the axis is (e, L):
the unit vector along the axis and the angular momentum.

```python
import numpy as np


def heun(f, t, y, h):
    k = f(t, y)
    return y + h / 2 * (k + f(t + h, y + h * k))


scene = symtop.scene("spheroid")
f = symtop.field("axis", scene.top)
times, states = np.linspace(0.0, 2.0, 2001), [f.state(scene.start)]
for t in times[:-1]:
    states.append(heun(f, t, states[-1], times[1]))
wrong = symtop.errors({"time": times, "axis": np.array(states)[:, :3]}, scene)
print(f"largest axis error {float(wrong['axis'].max(skipna=False)):.0e} rad")
```

`symtop judge my.py:heun --order 2` on the command line, or `symtop.judge` with a function from a file,
measures order, symplecticity, symmetry, what is conserved and how errors grow, beside what is claimed.
"""

MANY = """\
# An ensemble

A verdict on one top may be luck. `population` draws tops from a written-down distribution, the same on every
machine; `ensemble` runs a method on all of them.

```python
import symtop

tops = symtop.population(500, seed=1)
print(dict(tops.sizes), sorted(str(name) for name in tops.data_vars)[:4])
runs = symtop.ensemble(tops, "strang", per_nutation=100, nutations=10, samples=41, quiet=True)
print(runs.attrs["execution"], "-", (runs["outcome"] == "ok").sum().item(), "of", runs.sizes["member"], "ended ok")
```

Quantiles over the tops of the error of the energy against time. The band holds 98 of 100 tops.

```python
ax = symtop.plot(runs, members=tops, quantity="energy")
```

The median of the largest axis error, method by method, at the same number of steps in a nutation:

```python
import numpy as np

from symtop.report.spread import largest, member_errors

for name in ("stormer-verlet", "strang", "takahashi-imada", "rk4[axis]", "gauss-4[axis]"):
    runs = symtop.ensemble(tops, name, per_nutation=100, nutations=10, samples=41, quiet=True)
    worst = largest(member_errors(tops, runs, "axis"))
    print(f"{name:<16} {np.quantile(worst, 0.5, method='inverted_cdf'):.0e} rad")
```
"""


def outputs(source: str, names: dict[str, Any]) -> list[dict[str, Any]]:
    """What a cell prints and draws."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output):
        exec(compile(source, "cell", "exec"), names)
    shown: list[dict[str, Any]] = []
    if output.getvalue():
        shown.append({"output_type": "stream", "name": "stdout", "text": output.getvalue().splitlines(keepends=True)})
    for number in plt.get_fignums():
        picture = io.BytesIO()
        plt.figure(number).savefig(picture, dpi=80, metadata={"Software": None})
        data = {"image/png": base64.b64encode(picture.getvalue()).decode()}
        shown.append({"output_type": "display_data", "metadata": {}, "data": data})
    plt.close("all")
    return shown


def write(name: str, page: str) -> None:
    """Run the cells of one notebook and write it."""
    names: dict[str, Any] = {}
    cells: list[dict[str, Any]] = []
    for number, part in enumerate(re.split(r"```python\n(.*?)```", page, flags=re.DOTALL)):
        text, is_code = part.strip(), number % 2 == 1
        if not text:
            continue
        source = text.splitlines(keepends=True)
        cell = {
            "cell_type": "code" if is_code else "markdown",
            "id": f"cell-{number}",
            "metadata": {},
            "source": source,
        }
        if is_code:
            cell |= {"execution_count": number // 2 + 1, "outputs": outputs(text, names)}
        cells.append(cell)
    kernel = {"kernelspec": {"display_name": "Python 3", "language": "python", "name": "python3"}}
    book = {"cells": cells, "metadata": kernel, "nbformat": 4, "nbformat_minor": 5}
    (HERE / f"{name}.ipynb").write_text(json.dumps(book, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        for name, page in (("first-run", FIRST), ("own-method", OWN), ("ensemble", MANY)):
            write(name, page)
