"""The free brick of NASA's check case 2: published digits of its motion, and histories of simulators against it."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import symtop
from benchmarks.check_case import ANGLES, EARTH, RATES, largest_errors, truth, yaw_pitch_roll
from symtop.core.errors import SymtopError

# mpmath: the closed form and a Taylor series in 60 digits agree in all that are shown; degrees, and degrees a second
EXACT = {
    10.0: ((-4.31861073067739, 3.74448482493602, -65.9772500239938),
           (-2.41890222169288, -23.5525695195605, 28.1285926300414)),
    20.0: ((-6.36379156986781, 4.06909796412636, 4.22159045867153),
           (-5.42273468006839, 22.7159305764525, 28.6082817473166)),
    30.0: ((-4.29769350049079, -3.81026674049925, -56.0259821311546),
           (12.6183907759142, -17.3974747616114, 31.1195888869443)),
}  # fmt: skip


def test_the_motion_has_the_digits_of_two_independent_ways() -> None:
    quaternion, rates = truth(np.array([*EXACT]))
    angles, expected = zip(*EXACT.values(), strict=True)
    np.testing.assert_allclose(yaw_pitch_roll(quaternion), angles, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(rates, expected, rtol=0.0, atol=1e-13)
    brick = symtop.RigidBody.from_brick(2.26796, (0.2032, 0.1016, 0.05715))  # 5 pounds, 8 x 4 x 2.25 inches
    np.testing.assert_allclose(symtop.scene("check-case-2", bodies=True).top.moments, brick.moments, rtol=1e-6)


def history(folder: Path, offset: float = 0.0, earth: float = EARTH) -> Path:
    """Writes the exact motion as a history, in axes that turn with the Earth; `offset` degrees on the yaw."""
    times = np.arange(0.0, 31.0)
    quaternion, rates = truth(times)
    half = -0.5 * earth * times
    w, x, y, z = quaternion.T
    c, s = np.cos(half), np.sin(half)
    table = pd.DataFrame({"time": times, "longitude_deg": 0.0})
    table[ANGLES] = yaw_pitch_roll(np.stack([c * w - s * x, c * x + s * w, c * y - s * z, c * z + s * y], axis=1))
    table[RATES] = rates
    table[ANGLES[0]] += offset
    table.to_csv(folder / "history.csv", index=False, float_format="%.17g")
    return folder / "history.csv"


def test_a_history_is_judged_and_another_table_refused(tmp_path):
    attitude, rate = largest_errors(history(tmp_path))
    assert attitude < 1e-12
    assert rate < 1e-13
    assert largest_errors(history(tmp_path, offset=0.01))[0] == pytest.approx(0.01, rel=1e-9)
    # without the Earth's rotation it is off by what that is in 30 s
    assert largest_errors(history(tmp_path, earth=0.0))[0] == pytest.approx(np.degrees(30.0 * EARTH), rel=1e-9)
    (tmp_path / "other.csv").write_text("time,yaw\n0,0\n")
    with pytest.raises(SymtopError, match="must be a history with the columns of the check case"):
        largest_errors(tmp_path / "other.csv")
