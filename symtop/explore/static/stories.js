// Presets: a scene, two methods, a step, and what to watch. The numbers in the sentences are measured.

export const STORIES = {
  cusp: {
    scene: "cusp", integrator: "stormer-verlet", second: "midpoint", step_size: 0.33,
    watch: "The axis comes to rest at each cusp; with 4 steps a nutation both methods reach the cusps at wrong times. Raise the step to 0.45: Stormer-Verlet leaves its phase curve and fails, midpoint stays near it.",
  },
  loop: {
    scene: "loop", integrator: "rk4", second: "gauss-4", step_size: 0.26,
    watch: "The axis draws loops; with 5 steps a nutation rk4 changes the energy by a tenth and its orbit leaves the exact curve. Gauss-4 keeps the energy to 1e-12 and stays on the curve, although its axis is wrong by 0.02 rad.",
  },
  sleeping: {
    scene: "sleeping-unstable", integrator: "rk4", second: "midpoint", step_size: 0.71,
    watch: "Let go almost upright below the threshold spin of 2, the top falls and rises again; with this step rk4 does so at the wrong time. Raise psi' to 2.5: the top sleeps, and both methods stay upright.",
  },
  "pole jump": {
    scene: "grazing", integrator: "midpoint", second: "strang", step_size: 0.07,
    watch: "The axis passes the upper pole at 0.06 degrees, where Euler angles turn by half a turn in one step: midpoint in angles ends there with a message. Strang moves a quaternion and passes the pole.",
  },
  resonance: {
    scene: "steady-fast", integrator: "stormer-verlet", second: "strang", step_size: 0.2,
    watch: "The steady precession is exact for Stormer-Verlet until the step reaches 1/pi of a nutation, 0.202. Move the step from 0.2 to 0.21: a rounding error grows at every step until the run fails, while Strang only wobbles.",
  },
  "tennis-racket": {
    scene: "tennis-racket", integrator: "lie-variational", second: "gauss-4", step_size: 0.6,
    watch: "A free body let go about its middle axis flips over again and again, exactly at t = 14.9, 42.4, 69.9 and 97.5. Both methods take ten steps a turn and keep the energy to 1e-15; gauss-4 flips on time, lie-variational at 13.3, 37.7, 62.2 and 86.7. A step of 0.1 leaves it 0.2 too early: kept energy does not say when.",
  },
};
