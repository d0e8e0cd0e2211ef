"""The worked examples of the guides, to the digits that they print, with the product's own functions."""

from __future__ import annotations

import math

import numpy as np
import pytest
from reference import gum_h as gum

from tango_cnc.uncertainty.coverage import factor, independent_factor, shortest, symmetric, tolerance, validate
from tango_cnc.uncertainty.study import correlation, propagate, welch_satterthwaite


def test_h1_end_gauge() -> None:
    l_s, d, delta_alpha, theta, alpha_s, delta_theta = gum.H1_VALUES
    length = l_s + d - l_s * (delta_alpha * theta + alpha_s * delta_theta)
    sensitivity = np.array([[1.0, 1.0, -l_s * theta, 0.0, 0.0, -l_s * alpha_s]])
    variance = propagate(sensitivity, np.diag(gum.H1_STD**2))[0, 0]
    parts = (sensitivity[0] * gum.H1_STD)[:, None] ** 2
    dof = float(welch_satterthwaite(parts, 1 / gum.H1_DOF)[0])
    assert round(length) == gum.H1_PRINTED["l"]
    assert round(math.sqrt(variance)) == gum.H1_PRINTED["u"]
    assert math.floor(dof) == gum.H1_PRINTED["dof"]
    assert round(float(factor(0.99, math.floor(dof))) * round(math.sqrt(variance))) == gum.H1_PRINTED["U99"]


def test_h1_second_order_terms_by_monte_carlo() -> None:
    """Two products of inputs with zero mean are invisible to the linear propagation (H.1.7); trials see them."""
    rng = np.random.default_rng(1)
    x = gum.H1_VALUES + gum.H1_STD * rng.standard_normal((400_000, 6))
    length = x[:, 0] + x[:, 1] - x[:, 0] * (x[:, 2] * x[:, 3] + x[:, 4] * x[:, 5])
    assert round(float(np.std(length))) == gum.H1_PRINTED["u_with_second_order"]


def resistance(x: np.ndarray) -> np.ndarray:
    """(…, 3) V, I, φ → (…, 3) R, X, Z."""
    v, i, phi = np.moveaxis(x, -1, 0)
    return np.stack([v / i * np.cos(phi), v / i * np.sin(phi), v / i], axis=-1)


def sensitivities(x: np.ndarray) -> np.ndarray:
    v, i, phi = x
    c, s = math.cos(phi), math.sin(phi)
    return np.array([[c / i, -v * c / i**2, -v * s / i], [s / i, -v * s / i**2, v * c / i], [1 / i, -v / i**2, 0]])


def r_rounded(matrix: np.ndarray) -> np.ndarray:
    return np.round(matrix, 3)


def test_h2_resistance_and_reactance() -> None:
    mean = gum.H2_DATA.mean(axis=0)
    inputs = np.cov(gum.H2_DATA.T) / len(gum.H2_DATA)
    r_in = correlation(inputs)
    names = ["V", "I", "phi"]
    for (a, b), printed in gum.H2_INPUT_CORRELATION.items():
        assert r_in[names.index(a), names.index(b)] == pytest.approx(printed, abs=1.01e-3)
    found = propagate(sensitivities(mean), inputs)
    y, u, r = resistance(mean), np.sqrt(np.diag(found)), correlation(found)
    for i, name in enumerate("RXZ"):
        assert y[i] == pytest.approx(gum.H2_PRINTED[name][0], abs=5.1e-4)
    # From the data u(X) is 0.2956; the guide goes on from standard uncertainties rounded to two digits, and prints 0.295.
    assert u == pytest.approx([gum.H2_PRINTED[name][1] for name in "RXZ"], rel=0.003)
    rounded = propagate(sensitivities(mean), r_rounded(r_in) * np.outer(gum.H2_INPUT_STD, gum.H2_INPUT_STD))
    assert [round(float(x), 3) for x in np.sqrt(np.diag(rounded))] == [gum.H2_PRINTED[name][1] for name in "RXZ"]
    for (a, b), printed in gum.H2_CORRELATION.items():
        assert round(float(r["RXZ".index(a), "RXZ".index(b)]), 3) == printed


def test_h3_calibration_of_a_thermometer() -> None:
    columns = np.column_stack([np.ones(11), gum.H3_READING - 20.0])
    inverse = np.linalg.inv(columns.T @ columns)
    y = inverse @ columns.T @ gum.H3_CORRECTION
    rest = gum.H3_CORRECTION - columns @ y
    s = math.sqrt(rest @ rest / 9)
    covariance = propagate(inverse @ columns.T, s**2 * np.eye(11))
    u = np.sqrt(np.diag(covariance))
    assert (round(y[0], 4), round(u[0], 4)) == gum.H3_PRINTED["y1"]
    assert (round(y[1], 5), round(u[1], 5)) == gum.H3_PRINTED["y2"]
    assert round(correlation(covariance)[0, 1], 3) == gum.H3_PRINTED["r"]
    assert round(s, 4) == gum.H3_PRINTED["s"]
    at = np.array([[1.0, 10.0]])
    assert round(float((at @ y)[0]), 4) == gum.H3_PRINTED["at_30"][0]
    assert round(math.sqrt(propagate(at, covariance)[0, 0]), 4) == gum.H3_PRINTED["at_30"][1]


def test_supplement_2_resistance_and_reactance_as_mean_and_as_student() -> None:
    mean = gum.S2_DATA.mean(axis=0)
    squares = (gum.S2_DATA - mean).T @ (gum.S2_DATA - mean)
    for divisor, printed in ((30, gum.S2_GAUSSIAN), (6, gum.S2_STUDENT)):
        found = propagate(sensitivities(mean), squares / divisor)
        for i, name in enumerate("RXZ"):
            assert round(math.sqrt(found[i, i]), 3) == printed[name]
        assert round(1 - correlation(found)[1, 2], 5) == gum.S2_ONE_MINUS_R_XZ


@pytest.mark.parametrize(("common", "printed"), list(gum.S2_ADDITIVE.items()))
def test_supplement_2_additive_model(common: float, printed: tuple[float, float]) -> None:
    found = propagate(np.array([[1.0, 0, 1], [0, 1, 1]]), np.diag([1.0, 1.0, common]))
    assert (found[0, 0], correlation(found)[0, 1]) == pytest.approx(printed, rel=1e-12)


@pytest.mark.parametrize(("x1", "r", "u_radius", "u_angle"), gum.S2_POLAR)
def test_supplement_2_polar_coordinates(x1: float, r: float, u_radius: float, u_angle: float) -> None:
    inputs = 0.010**2 * np.array([[1, r], [r, 1]])
    found = propagate(np.array([[1.0, 0.0], [0.0, 1 / x1]]), inputs)
    assert np.sqrt(np.diag(found)) == pytest.approx([u_radius, u_angle], rel=1e-12)
    assert correlation(found)[0, 1] == pytest.approx(r, abs=1e-12)


def test_polar_coordinates_near_the_origin_are_where_the_linear_propagation_fails() -> None:
    """(0.001, 0) with u = 0.010: the radius is Rayleigh distributed nearly, not normal about 0.001 (JCGM 102:2011, 9.3)."""
    rng = np.random.default_rng(2)
    radius = np.hypot(0.001 + 0.010 * rng.standard_normal(50_000), 0.010 * rng.standard_normal(50_000))
    std = np.array([0.010])
    check = validate(std, ((radius - 0.001) / std)[:, None], 0.95, 1)
    assert not check.agrees[0]
    assert check.std_ratio[0] == pytest.approx(math.sqrt(2 - math.pi / 2), rel=0.02)


def test_supplement_1_mass_calibration() -> None:
    """δm = (m_Rc + δm_Rc)(1 + (ρ_a − ρ_a0)(1/ρ_W − 1/ρ_R)) − m_nom; the term of second order is half of the variance."""
    rng = np.random.default_rng(3)
    count = 1_000_000
    reference, small = 100_000 + 0.050 * rng.standard_normal(count), 1.234 + 0.020 * rng.standard_normal(count)
    air, weight, ours = rng.uniform(1.10, 1.30, count), rng.uniform(7000, 9000, count), rng.uniform(7950, 8050, count)
    values = (reference + small) * (1 + (air - 1.2) * (1 / weight - 1 / ours)) - 100_000
    low, high = shortest(values[:, None], 0.95)
    assert round(float(values.mean()), 3) == round(gum.S1_MASS["y"], 3)
    assert float(values.std()) == pytest.approx(gum.S1_MASS["u"], abs=2e-4)
    # Where the shortest interval lies is hardly determined, how long it is very well.
    assert high[0] - low[0] == pytest.approx(np.ptp(gum.S1_MASS["interval"]), abs=5e-4)
    assert round(math.hypot(0.050, 0.020), 4) == gum.S1_MASS["linear_u"]


def test_supplement_1_sum_of_four_rectangular_inputs() -> None:
    rng = np.random.default_rng(4)
    unit = rng.uniform(-math.sqrt(3), math.sqrt(3), (1_000_000, 4))
    for widths, key in (((1, 1, 1, 1), "equal"), ((1, 1, 1, 10), "one_wide")):
        values = unit @ np.array(widths, dtype=float)
        (u, interval), ends = gum.S1_SUM[key], symmetric(values[:, None], 0.95)
        assert float(values.std()) == pytest.approx(u, rel=5e-3)
        assert (ends[0][0], ends[1][0]) == pytest.approx(interval, rel=5e-3)


def test_numerical_tolerance_is_half_of_the_last_digit() -> None:
    """0.35 V is 35 · 10⁻² V with two digits and 4 · 10⁻¹ V with one (JCGM 101:2008, 7.9.2)."""
    assert tolerance(0.35, 2) == pytest.approx(0.005)
    assert tolerance(0.35, 1) == pytest.approx(0.05)
    assert tolerance(np.array([32.0, 0.00996, 0.0]), 1) == pytest.approx([5.0, 0.005, 0.0])


def test_coverage_factors() -> None:
    assert float(factor(0.95)) == pytest.approx(1.96, abs=5e-4)
    assert float(factor(0.95, 12.0)) == pytest.approx(2.18, abs=5e-3)
    assert [round(independent_factor(q, 0.95), 1) for q in (1, 2, 5, 10)] == [2.0, 2.2, 2.6, 2.8]
