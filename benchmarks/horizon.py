"""Runs of up to 10^8 nutations: does the phase diagram's prediction hold beyond the runs of the study?

    python -m benchmarks.horizon [--nutations 1e8]        two minutes of a quiet core; writes results/horizon.json

One method on eight natural tops. The laws of growth are fitted to what the runs showed up to 10^4 nutations, as the
study of cost does, and compared with what they show later.
"""

import argparse
from pathlib import Path

import numpy as np

from benchmarks import measured, pages
from benchmarks.pages import Table
from symtop.core import netcdf
from symtop.methods.framework.registry import integrator
from symtop.report.formats import counted, listed
from symtop.runner import scripts

NAME, STEPS, TOPS, SEED = "takahashi-imada[axis]", 8.74, 8, 1
FINE = 1118.72  # steps a nutation of the runs in which rounding dominates and grows as a random walk
FITTED = 1e4  # nutations


def main() -> None:
    """Run, compare, print and write down."""
    scripts.install()
    from symtop_studies.cost import far, laws

    parser = argparse.ArgumentParser(description="Predicted against measured errors of very long runs")
    parser.add_argument("--nutations", type=float, default=1e8)
    parser.add_argument("--results", type=Path, default=Path("results"))
    options = parser.parse_args()
    if options.nutations < 10.0 * FITTED:
        parser.error(f"--nutations must be at least {10.0 * FITTED:g}, not {options.nutations:g}")
    facts, tops = measured.circumstances(), far.tops_of(TOPS, SEED)
    ends = far.horizons()[far.horizons() <= 1.0001 * options.nutations]
    ((errors, work),) = far.measured(integrator(NAME), tops, [far.Request(STEPS, ends, np.inf)])
    ((fine, work_2),) = far.measured(integrator(NAME), tops, [far.Request(FINE, ends[ends <= 1.0001 * FITTED], np.inf)])
    times = far.horizons()
    known = np.full((len(far.QUANTITIES), 2, times.size, TOPS), np.nan)
    fitted = ends <= 1.0001 * FITTED
    known[:, 0, : ends.size][:, fitted] = errors[:, fitted]
    known[:, 1, : fine.shape[1]], drifts = fine, far.drifts_of(integrator(NAME))
    prediction = far.predicted(known, np.stack([work, work_2]), times, far.grain_of(tops), drifts=drifts)["error"][:, 0]
    later = [horizon for horizon in 10.0 ** np.arange(5, 9) if horizon <= 1.0001 * ends[-1]]
    lines, ratios, parts = [], [], []
    for place, quantity in enumerate(far.QUANTITIES):
        largest = np.maximum.accumulate(errors[place], axis=0)
        lines.append([quantity])
        counts = []
        for horizon in later:
            error = largest[int(np.argmin(np.abs(ends - horizon)))]
            ratio = error / prediction.sel(quantity=quantity).sel(horizon=horizon, method="nearest").values
            good = ratio[(error < laws.SATURATED) & np.isfinite(ratio)]
            ratios += good.tolist()
            counts.append(str(good.size))
            lines[-1].append(
                f"{np.median(good):.3g} ({good.min():.3g} to {good.max():.3g}), {counted(good.size, 'top')}"
                if good.size
                else "none"
            )
        parts.append(f"of the {quantity} on {listed(counts if len({*counts}) > 1 else counts[:1])}")
    title = f"Measured over predicted error of {NAME}, median (least to most) of the tops whose motion is not lost"
    table = Table(title, ["quantity", *(f"{horizon:.0e} nutations" for horizon in later)], lines)
    print("\n".join(" | ".join(line) for line in [table.header, *lines]))
    places = listed([f"{horizon:.0e}" for horizon in later])
    sentence = (
        f"Errors of {NAME} at {STEPS} steps a nutation on {TOPS} random tops were predicted from runs of up to "
        f"{FITTED:.0e} nutations and measured at {places}: they are {min(ratios):.2g} to {max(ratios):.2g} "
        f"times the prediction, on the tops whose motion is not lost by then: {', '.join(parts)}."
    )
    options.results.mkdir(exist_ok=True)
    page = pages.findings(
        "horizon", "Very long runs", "Do predictions hold up to a hundred million nutations?", [sentence],
        "A ratio near one is a prediction that holds. A motion is lost when its axis is off by "
        f"{laws.SATURATED} rad.", [table],
        cases=1, **measured.record(facts, "python -m benchmarks.horizon"),
    )  # fmt: skip
    netcdf.write_json(options.results / "horizon.json", page)


if __name__ == "__main__":
    main()
