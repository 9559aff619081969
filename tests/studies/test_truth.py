"""The truth study: its facts are those of its data, and its page says them."""

import numpy as np
import xarray as xr
from symtop_studies.truth import facts, study
from symtop_studies.truth.measures import BOUND, ERROR, bound_ratios

from symtop.measure import datasets
from symtop.runner.study import Case
from tests.templates import checked_page


def test_facts_and_page_follow_from_the_errors_and_a_broken_bound_is_counted(tmp_path):
    cases = [Case("spheroid", name, {"horizons": [8.0, 20.0]}) for name in ("closed form", "double, attitude")]
    data = datasets.combine([(case, study.measure(case)) for case in cases])
    answers = facts.facts(data)
    assert answers["closed_form"] == float(data[ERROR].sel(variant="closed form").max()) < 1e-14
    assert answers["integrated"] > answers["closed_form"]
    assert (answers["bounds"], answers["bounds_held"]) == (4, 4)
    assert answers["quadruple"] is None
    worse = data.assign({ERROR: data[ERROR].where(data["horizon"] < 10.0, 2.0 * data[BOUND])})
    assert facts.facts(worse)["bounds_held"] == 2
    variant = data.assign({ERROR: data[ERROR].where(data["horizon"] < 10.0, 0.5 * data[ERROR].min())})
    assert facts.facts(variant)["integrated_after"] == 8.0  # the worst is not the last
    assert answers["printed_met"] <= answers["printed"] < answers["published"]
    ratios = xr.Dataset({ERROR: ("run", [1.0, 2.0, 4.0, np.nan]), BOUND: ("run", [2.0, 1.0, 40.0, 1.0])})
    assert bound_ratios(ratios) == (3, 1, 2.0)
    assert facts.tables(data)["sources"]["time (s)"].tolist() == [20.0, 20.0]  # each at its longest
    assert "quadruple precision, which" not in checked_page("truth", data, tmp_path)  # there was none
    assert np.isfinite(facts.facts(data)["bound_ratio"])
