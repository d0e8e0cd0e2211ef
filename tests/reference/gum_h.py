"""Input data and printed results of JCGM 100:2008 annex H.1–H.3 and JCGM 102:2011 clause 9 (facts, no text)."""

from __future__ import annotations

import numpy as np

# H.1, end gauge: estimates, standard uncertainties and degrees of freedom; lengths nm, temperatures °C, expansion 1/°C.
H1_NAMES = ("l_s", "d", "delta_alpha", "theta", "alpha_s", "delta_theta")
H1_VALUES = np.array([50_000_623.0, 215.0, 0.0, -0.1, 11.5e-6, 0.0])
H1_STD = np.array([25.0, 9.7, 0.58e-6, 0.41, 1.2e-6, 0.029])
H1_DOF = np.array([18.0, 25.6, 50.0, np.inf, np.inf, 2.0])
H1_PRINTED = {"l": 50_000_838.0, "u": 32.0, "dof": 16, "U99": 93.0, "u_with_second_order": 34.0}

# H.2, Table H.2: V (V), I (A), φ (rad), five simultaneous observations.
H2_DATA = np.array(
    [
        [5.007, 19.663e-3, 1.0456],
        [4.994, 19.639e-3, 1.0438],
        [5.005, 19.640e-3, 1.0468],
        [4.990, 19.685e-3, 1.0428],
        [4.999, 19.678e-3, 1.0433],
    ]
)
H2_INPUT_STD = np.array([0.0032, 0.0095e-3, 0.00075])
H2_PRINTED = {"R": (127.732, 0.071), "X": (219.847, 0.295), "Z": (254.260, 0.236)}
H2_CORRELATION = {("R", "X"): -0.588, ("R", "Z"): -0.485, ("X", "Z"): 0.993}
H2_INPUT_CORRELATION = {("V", "I"): -0.355, ("V", "phi"): 0.858, ("I", "phi"): -0.645}

# H.3, Table H.6: thermometer readings (°C) and corrections (°C); reference temperature 20 °C.
H3_READING = np.array([21.521, 22.012, 22.512, 23.003, 23.507, 23.999, 24.513, 25.002, 25.503, 26.010, 26.511])
H3_CORRECTION = np.array([-0.171, -0.169, -0.166, -0.159, -0.164, -0.165, -0.156, -0.157, -0.159, -0.161, -0.160])
H3_PRINTED = {"y1": (-0.1712, 0.0029), "y2": (0.00218, 0.00067), "r": -0.930, "s": 0.0035, "at_30": (-0.1494, 0.0041)}

# JCGM 102:2011, 9.4: six observations; the covariance of the inputs as of a mean (9.4.2.2) and as of Student's t (9.4.2.5).
S2_DATA = np.vstack([H2_DATA, [4.999, 19.661e-3, 1.0445]])
S2_GAUSSIAN = {"R": 0.058, "X": 0.241, "Z": 0.193}
S2_STUDENT = {"R": 0.130, "X": 0.540, "Z": 0.431}
S2_ONE_MINUS_R_XZ = 0.00749

# JCGM 102:2011, 9.2.2 and 9.2.4 (common input of variance 1 and 9): variance of an output and correlation.
S2_ADDITIVE = {1.0: (2.0, 0.5), 9.0: (10.0, 0.9)}
# JCGM 102:2011, 9.3, linear propagation of (x1, 0) with u = 0.010 into polar coordinates: x1, r, u(radius), u(angle).
S2_POLAR = ((0.001, 0.0, 0.010, 10.0), (0.010, 0.0, 0.010, 1.0), (0.100, 0.0, 0.010, 0.100), (0.100, 0.9, 0.010, 0.100))

# JCGM 101:2008, 9.3, calibration of a weight: printed estimate, u and interval of 95 %, in mg from 100 g; linear: 0.0539.
S1_MASS = {"y": 1.2340, "u": 0.0754, "interval": (1.0834, 1.3825), "linear_u": 0.0539}
# JCGM 101:2008, 9.2.3 and 9.2.4: sum of four rectangular inputs of unit variance; one of them ten times wider.
S1_SUM = {"equal": (2.0, (-3.88, 3.88)), "one_wide": (10.1, (-17.0, 17.0))}
