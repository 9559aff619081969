"""JSBSim: a body without aerodynamics whose translation is frozen; a couple of two external forces is the torque.

The planet does not rotate. Space and body turn into JSBSim's axes, z down, by S = diag(1, -1, -1).
"""

import functools
import math
import tempfile
from importlib import metadata
from pathlib import Path as File
from typing import Any

import numpy as np

from benchmarks.engines import FREE, Setting
from benchmarks.engines.common import Body, Path, Recorder, quaternion

ENGINE = "JSBSim"
S = np.diag([1.0, -1.0, -1.0])
EULER, ADAMS_BASHFORTH_2, BUSS_2 = 1, 3, 7  # its numbers of integrators
XML = """<?xml version="1.0"?>
<fdm_config name="top" version="2.0" release="ALPHA"><fileheader/>
<planet><rotation_rate>0.0</rotation_rate></planet><metrics/>
<mass_balance><ixx unit="SLUG*FT2">{I1!r}</ixx><iyy unit="SLUG*FT2">{I1!r}</iyy><izz unit="SLUG*FT2">{I3!r}</izz>
<emptywt unit="LBS">32.0</emptywt><location name="CG" unit="IN"><x>0</x><y>0</y><z>0</z></location></mass_balance>
<ground_reactions/><propulsion/><flight_control name="none"/><aerodynamics/>
<external_reactions>
<force name="tip" frame="LOCAL"><location unit="IN"><x>0</x><y>0</y><z>12</z></location>
<direction><x>0</x><y>0</y><z>1</z></direction></force>
<force name="cg" frame="LOCAL"><location unit="IN"><x>0</x><y>0</y><z>0</z></location>
<direction><x>0</x><y>0</y><z>-1</z></direction></force>
</external_reactions></fdm_config>"""


def _run(jsbsim: Any, attitude: int, rate: int, body: Body, h: float, steps: int) -> Path:
    engine, recorder = jsbsim.FGFDMExec(None), Recorder()
    engine.set_debug_level(0)
    with tempfile.TemporaryDirectory() as folder:
        place = File(folder) / "aircraft" / "top"
        place.mkdir(parents=True)
        (place / "top.xml").write_text(XML.format(I1=body.I1, I3=body.I3), encoding="utf-8")
        engine.set_aircraft_path(str(place.parent))
        engine.load_model("top")
    engine.set_dt(h)
    turn, w = S @ body.rotation @ S, S @ body.velocity_body
    begin = {
        "ic/phi-rad": math.atan2(turn[2, 1], turn[2, 2]), "ic/theta-rad": -math.asin(turn[2, 0]),
        "ic/psi-true-rad": math.atan2(turn[1, 0], turn[0, 0]), "ic/p-rad_sec": w[0], "ic/q-rad_sec": w[1],
        "ic/r-rad_sec": w[2], "ic/h-sl-ft": 30000.0, "ic/lat-geod-deg": 0.0, "ic/long-gc-deg": 0.0,
        "simulation/integrator/position/rotational": attitude, "simulation/integrator/rate/rotational": rate,
        "simulation/integrator/position/translational": 0, "simulation/integrator/rate/translational": 0,
        "external_reactions/tip/magnitude": body.mgl, "external_reactions/cg/magnitude": body.mgl,
    }  # fmt: skip
    for name, value in begin.items():
        engine[name] = float(value)
    engine.run_ic()
    state = engine.get_propagate()
    for step in range(steps + 1):
        if step:
            engine.run()
        axes = S @ np.array(state.get_Tl2b()).T @ S
        rates = np.array([engine[f"velocities/{name}i-rad_sec"] for name in "pqr"])
        recorder.add(quaternion(axes), axes @ (S @ rates))
    return recorder.path()


def settings() -> list[Setting]:
    """The default and the best of its pairs of order two."""
    import jsbsim

    jsbsim.FGJSBBase().debug_lvl = 0
    version = metadata.version("jsbsim")
    rows = (
        ("Euler, Euler (default)", EULER, EULER, "jsbsim-default"),
        ("Buss2, AB2", BUSS_2, ADAMS_BASHFORTH_2, "jsbsim-buss2"),
    )
    return [
        Setting(ENGINE, version, name, FREE, method, functools.partial(_run, jsbsim, attitude, rate))
        for name, attitude, rate, method in rows
    ]
