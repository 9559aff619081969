"""Check case 2 of NASA's flight simulations, a free brick: the exact motion, and published histories.

    python -m benchmarks.check_case                            attitude and rates at 10, 20 and 30 s
    python -m benchmarks.check_case sim_01.csv sim_02.csv ...  and the largest errors of these files

The files are those of the NASA Engineering and Safety Center's check cases, with the columns ``time`` (s),
``longitude_deg``, ``eulerAngle_deg_Yaw``, ``_Pitch``, ``_Roll`` and ``bodyAngularRateWrtEi_deg_s_Roll``, ``_Pitch``,
``_Yaw``. Their Euler angles are against the local axes (north, east, down) on the equator, which turn eastward with the
Earth, about north: q_local = (cos x, -sin x, 0, 0) q, x = (longitude + turn of the Earth)/2. The scene's do not turn.
Source: Murri, Jackson, Shelton, Check-Cases for Verification of 6-Degree-of-Freedom Flight Vehicle Simulations,
NASA/TM-2015-218675.
"""

import argparse
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

import symtop
from symtop.core.errors import SymtopError
from symtop.model.body import rotated
from symtop.model.charts import attitude_distance

EARTH = 7.292115e-5  # rad/s
SCENE = "check-case-2"
ANGLES = [f"eulerAngle_deg_{name}" for name in ("Yaw", "Pitch", "Roll")]
RATES = [f"bodyAngularRateWrtEi_deg_s_{name}" for name in ("Roll", "Pitch", "Yaw")]


def truth(times: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Quaternions (n, 4) and rates in body axes (n, 3), deg/s."""
    motion, moments = symtop.reference(SCENE, times), symtop.scene(SCENE, bodies=True).top.moments
    quaternion = motion["quaternion"].to_numpy()
    inside = rotated(quaternion * [1.0, -1.0, -1.0, -1.0], motion["momentum"].to_numpy())
    return quaternion, np.degrees(inside / np.array(moments))


def yaw_pitch_roll(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Degrees, (n, 3)."""
    return Rotation.from_quat(np.roll(quaternion, -1, axis=-1)).as_euler("ZYX", degrees=True)


def largest_errors(path: Path) -> tuple[float, float]:
    """Of a file: of the attitude in degrees, of a rate in deg/s."""
    try:
        table = pd.read_csv(path)[["time", "longitude_deg", *ANGLES, *RATES]].astype(float)
    except (OSError, KeyError, ValueError) as error:
        raise SymtopError(f"{path} must be a history with the columns of the check case: {error}") from error
    times = table["time"].to_numpy()
    quaternion, rates = truth(times)
    longitude = np.radians(table["longitude_deg"].to_numpy()) + EARTH * times
    east = Rotation.from_rotvec(longitude[:, None] * [-1.0, 0.0, 0.0])
    local = east * Rotation.from_quat(np.roll(quaternion, -1, axis=-1))
    published = Rotation.from_euler("ZYX", table[ANGLES].to_numpy(), degrees=True)
    angles = attitude_distance(published.as_quat(), local.as_quat())
    return float(np.degrees(angles.max())), float(np.abs(table[RATES].to_numpy() - rates).max())


def main() -> None:
    """Print the motion and the errors."""
    parser = argparse.ArgumentParser(description="The free brick of check case 2")
    parser.add_argument("files", nargs="*", type=Path)
    times = np.array([10.0, 20.0, 30.0])
    quaternion, rates = truth(times)
    print("t (s)  yaw, pitch, roll (degrees); rates (deg/s)")
    for time, angles, rate in zip(times, yaw_pitch_roll(quaternion), rates, strict=True):
        print(f"{time:5g}  {', '.join(f'{x:.13g}' for x in angles)}; {', '.join(f'{x:.13g}' for x in rate)}")
    for path in parser.parse_args().files:
        attitude, rate = largest_errors(path)
        print(f"{path.name}: attitude {attitude:.2g} degrees, rates {rate:.2g} deg/s")


if __name__ == "__main__":
    try:
        main()
    except SymtopError as error:
        raise SystemExit(f"check_case: {error}") from error
