"""The three pitfalls are what the front page says of them."""

import numpy as np
import pytest
from symtop_studies.pitfalls import study

from symtop.measure import datasets
from tests.templates import checked_page


def test_the_pitfalls_are_there_and_the_page_says_what_was_measured(tmp_path):
    data = datasets.combine([(case, study.measure(case)) for case in study.cases(True)])
    largest = {name: study.run_of(data, study.TERM, name)["axis"].max("sample").values
               for name in (study.WITHOUT, study.WITH, study.RIGHT)}  # fmt: skip
    assert np.ptp(largest[study.WITHOUT]) < 0.01 * largest[study.WITHOUT].mean()
    assert largest[study.WITH][-1] < 0.2 * largest[study.WITH][0]
    assert largest[study.RIGHT][-1] < 1e-4
    answers = study.facts(data)
    assert answers["falling_energy"] < 0.01
    assert answers["falling"] > 0.5
    assert answers["ended"] < 1.0
    assert (answers["bad_warned"], answers["good_warned"]) == (answers["bad"], 0)
    run = study.run_of(data, study.POLE, study.AXIS).isel(setting=0)
    assert float(run["axis"].max()) < 1e-3
    assert float(run["time"].max()) == pytest.approx(2.0)
    assert (np.isfinite(run["axis"]) == np.isfinite(run["time"])).all()  # the rest is padding
    part = data.sel(variant=[study.AXIS])
    pages = [checked_page("pitfalls", runs, tmp_path, elsewhere={"three"}) for runs in (data, part)]
    assert ["A missing gyroscopic term" in page for page in pages] == [True, False]
    assert "left_chart" in pages[0]
