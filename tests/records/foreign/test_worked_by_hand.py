"""The worked example for students: its numbers by plain arithmetic, and by the program.

The reduction of the package is not called: tables are read by pandas, and the equations are
written out. Every number printed in ``worked_by_hand.md`` must round from what is computed, and
what the program reduces must round to what is printed.
"""

from __future__ import annotations

import re
from functools import cache
from math import exp, pi, radians

import numpy as np
import pandas as pd
import pytest

from tests.foreign_laboratory.make import HERE, RECORDS
from virtual_lab.api import reduce

PAGE = (HERE / "worked_by_hand.md").read_text("utf-8")
ROW = re.compile(r"^\| `(\w+)` \| .* \| (-?[\d.]+(?:e-?\d+)?) \| [^|]+ \|$", re.MULTILINE)
RING = re.compile(r"^\| ring (\d) \| ([\d.]+) \| ([\d.]+) \|$", re.MULTILINE)

INCH, OUNCE, MPH = 0.0254, 0.45359237 / 16, 0.44704  # m, kg, m/s
G = 386.0886 * INCH  # m/s^2
D_FAR, D_NEAR = 21.6535 * INCH, 9.8425 * INCH  # m, both pairs of gates
AIR, DRAG, R = 1.19, 0.4, 1.4523 * INCH  # kg/m^3, 1, m
SLOPE = -0.001 / MPH  # s/m, of e0
V_NOM = 60 * MPH
AXIS = 6 * INCH  # from the knob, of the pendulum and of the rig
CLAMP_I, CLAMP_S = 10.935 * OUNCE * INCH**2, 1.3887 * OUNCE * INCH


def printed() -> dict[str, str]:
    return dict(ROW.findall(PAGE))


def rings() -> np.ndarray:
    """Return frequency [Hz] and decay [1/s] of each ring, as printed."""
    return np.array([[float(f), float(decay)] for _, f, decay in RING.findall(PAGE)])


def table(name: str, **how: str) -> pd.DataFrame:
    return pd.read_csv(RECORDS / name, encoding="utf-8-sig", **how)


def speed_in(kappa: float, time: float) -> float:
    return (exp(-kappa * D_NEAR) - exp(-kappa * D_FAR)) / (kappa * time)


def speed_back(kappa: float, time: float) -> float:
    return (exp(kappa * D_FAR) - exp(kappa * D_NEAR)) / (kappa * time)


def turning(contact: np.ndarray, rings: np.ndarray) -> tuple[np.ndarray, float]:
    """Return the rate [counts/s] of each shot 0.7 ms after contact, and the residual squares."""
    encoder = table("encoder.csv")
    ms = encoder["t [ms]"].to_numpy()
    mask = ms > 1e3 * contact.max() + 3
    t = ms[mask] / 1e3 - ms[mask][0] / 1e3
    start = contact + 0.7e-3 - ms[mask][0] / 1e3
    columns = [t**0, t, t**2, t**3]
    for frequency, decay in rings:
        columns.append(np.exp(-decay * t) * np.cos(2 * pi * frequency * t))
        columns.append(np.exp(-decay * t) * np.sin(2 * pi * frequency * t))
    matrix = np.column_stack(columns)
    counts = encoder.drop(columns="t [ms]").to_numpy()[mask]
    fitted, *_ = np.linalg.lstsq(matrix, counts, rcond=None)
    residual = float(((counts - matrix @ fitted) ** 2).sum())
    return fitted[1] + 2 * fitted[2] * start + 3 * fitted[3] * start**2, residual


@cache
def by_hand() -> dict[str, float]:
    """Return every quantity of the page in its printed unit."""
    x: dict[str, float] = {}
    weigh_and_swing(x)
    mass, kappa, e0_of = hit_the_wall(x)
    hit_the_bat(x, mass, kappa, e0_of)
    return x


def weigh_and_swing(x: dict[str, float]) -> None:
    """Add sections 1 to 3: the bat on the bench and on the rig."""
    bat = table("bat.csv")
    x["M_shown"] = bat["weight (oz)"].mean()
    x["M"] = x["M_shown"] * OUNCE
    x["L"] = bat["length (in)"].mean() * INCH
    x["z_cm"] = bat["balance point (in)"].mean() * INCH
    x["R_b"] = bat["barrel radius (in)"].mean() * INCH
    swings = table("swings.csv")
    periods, factors = [], []
    for row in swings.itertuples():
        first, last = radians(row.start_deg), radians(row.end_deg)
        theta = [first * (last / first) ** ((k + 0.5) / 10) for k in range(10)]
        factors.append(sum(1 + a**2 / 16 + 11 * a**4 / 3072 for a in theta) / 10)
        periods.append((row.t10 - row.t0) / 10 / 1e3)
    x["T_1"], x["F_1"] = periods[0], factors[0]
    x["T"] = sum(t / f for t, f in zip(periods, factors, strict=True)) / len(periods)
    x["d"] = x["L"] - AXIS - x["z_cm"]
    x["S"] = x["M"] * x["d"] + CLAMP_S
    x["I_both"] = (x["T"] / (2 * pi)) ** 2 * G * x["S"]
    x["I_cm"] = x["I_both"] - CLAMP_I - x["M"] * x["d"] ** 2
    x["z"] = table("shots.csv").place_in[0] * INCH
    x["z_p"] = x["L"] - AXIS
    x["I_p"] = x["I_cm"] + x["M"] * (x["z_p"] - x["z_cm"]) ** 2
    x["b"] = x["z_p"] - x["z"]


def hit_the_wall(x: dict[str, float]) -> tuple[pd.Series, pd.Series, pd.Series]:
    """Add section 4; return mass [kg], drag [1/m] and e0 of each ball."""
    mass = table("balls.csv").groupby("ball").mass_oz.mean() * OUNCE
    kappa = AIR * DRAG * pi * R**2 / (2 * mass)
    x["m"], x["kappa"] = mass[1], kappa[1]
    wall = table("wall-gates.csv").merge(table("wall-shots.csv"), on="shot")
    middle = {
        gate: (wall[f"{gate} broke"] + wall[f"{gate} cleared"]) / 2e6
        for gate in ("in 1", "in 2", "back 1", "back 2")
    }
    x["t_wall_in"] = (middle["in 2"] - middle["in 1"])[0] * 1e6
    x["t_wall_back"] = (middle["back 1"] - middle["back 2"])[0] * 1e6
    hits = []
    for hit, ball in enumerate(wall.ball):
        v = speed_in(kappa[ball], middle["in 2"][hit] - middle["in 1"][hit])
        w = speed_back(kappa[ball], middle["back 1"][hit] - middle["back 2"][hit])
        hits.append(w / v - SLOPE * (v - V_NOM))
        if hit == 0:
            x["v_wall"], x["w_wall"], x["e0_hit"] = v, w, hits[0]
    e0_of = pd.Series(hits).groupby(wall.ball).mean()
    x["e0_ball"], x["all_balls"] = e0_of[1], e0_of.mean()
    within = sum((e0 - e0_of[ball]) ** 2 for e0, ball in zip(hits, wall.ball, strict=True))
    x["u_ball"] = (within / (48 - 12) / 4) ** 0.5
    x["kept"] = 1 - x["u_ball"] ** 2 / e0_of.var(ddof=1)
    drawn = x["all_balls"] + x["kept"] * (e0_of - x["all_balls"])
    x["e0_drawn"], x["e0_lot"] = drawn[1], drawn.mean()
    return mass, kappa, drawn


def flights() -> tuple[pd.Series, np.ndarray]:
    """Return the time between the gates and the time of contact [s] of each shot at the bat."""
    gates = table("gates.csv")
    passages = gates[gates.way == 1].groupby(["shot", "gate"]).time_us.mean().unstack() / 1e6
    duration = passages[2] - passages[1]
    return duration, (passages[2] + D_NEAR * duration / (D_FAR - D_NEAR)).to_numpy()


def hit_the_bat(x: dict[str, float], mass: pd.Series, kappa: pd.Series, e0_of: pd.Series) -> None:
    """Add sections 5 to 7."""
    duration, contact = flights()
    rates, x["left"] = turning(contact, rings())
    omega = 2 * pi * rates / 10000
    x["t_in"], x["contact"] = duration[1] * 1e6, contact[0] * 1e3
    x["rate"], x["omega"] = rates[0], omega[0]
    marks = table("marks.csv", sep=";", decimal=",")
    x["across"] = (marks.across_mm**2).mean()
    x["sin2"] = x["across"] / 1e6 / (x["R_b"] + R) ** 2
    for n, ball in enumerate(table("shots.csv").ball):
        v = speed_in(kappa[ball], duration[n + 1])
        back = x["I_p"] * omega[n] / (mass[ball] * x["b"]) - v
        e_a = (back / v + x["sin2"]) / (1 - x["sin2"])
        r = mass[ball] * x["b"] ** 2 / x["I_p"]
        e = e_a * (1 + r) + r
        e0 = e0_of[ball] + SLOPE * (v - V_NOM)
        x[f"BPF_{n + 1}"] = e / e0
        if n == 0:
            x |= {"v": v, "v_f": back, "e_A": e_a, "r": r, "e": e, "e0": e0}
    x["BPF"] = sum(x[f"BPF_{n}"] for n in range(1, 7)) / 6


def half_a_digit(text: str) -> float:
    """Return half of the last digit of a printed number."""
    mantissa, _, exponent = text.partition("e")
    return 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def agrees(text: str, value: float) -> bool:
    return abs(float(text) - value) <= half_a_digit(text) * (1 + 1e-6)


def test_every_number_on_the_page_is_computed_and_every_one_computed_is_there() -> None:
    assert printed().keys() == by_hand().keys()
    assert len(ROW.findall(PAGE)) == len(printed())
    wrong = {
        name: (text, by_hand()[name])
        for name, text in printed().items()
        if not agrees(text, by_hand()[name])
    }
    assert wrong == {}


def test_the_rings_printed_leave_the_least_squares() -> None:
    """A step of any frequency or decay, up or down, increases the residual squares."""
    _, contact = flights()
    best = rings()
    assert best.shape == (6, 2)
    _, least = turning(contact, best)
    for place in np.ndindex(best.shape):
        for step in (-1.0, 1.0):
            other = best.copy()
            other[place] += step * (0.2, 1.0)[place[1]]
            assert turning(contact, other)[1] > least, (place, step)


def test_the_program_gives_the_same_to_every_digit_printed() -> None:
    certification = reduce(RECORDS).certification
    shots, bat = certification.shots, certification.bat
    found = {
        "M": bat["mass"].value,
        "L": bat["length"].value,
        "z_cm": bat["z_cm"].value,
        "I_cm": bat["inertia_cm"].value,
        "m": shots.ball_mass[0],
        "v": shots.speed[0],
        "rate": certification.readings.recoil.rate[0],
        "omega": shots.recoil_rate[0],
        "r": shots.recoil_factor[0],
        "e_A": shots.collision_efficiency[0],
        "e": shots.restitution[0],
        "e0": shots.ball_restitution[0],
        "e0_lot": certification.quantities["ball_restitution"].value,
        "BPF": certification.quantities["bat_performance_factor"].value,
    } | {f"BPF_{n + 1}": factor for n, factor in enumerate(shots.bat_performance_factor)}
    wrong = {name: value for name, value in found.items() if not agrees(printed()[name], value)}
    assert wrong == {}
    fit = certification.readings.recoil
    assert fit.ring_frequency == pytest.approx(rings()[:, 0], abs=0.006)
    assert fit.ring_decay == pytest.approx(rings()[:, 1], abs=0.006)


def test_the_constants_are_those_of_the_form() -> None:
    """The constants written above equal those in the laboratory's form."""
    known = reduce(RECORDS).certification.session.calibration
    for key, value in {
        "hall.gravity": G,
        "bench.pendulum.clamp_inertia": CLAMP_I,
        "bench.pendulum.clamp_moment": CLAMP_S,
        "balls.gates.distance_0": D_FAR,
        "impact.gates.distance_1": D_NEAR,
        "hall.air.density": AIR,
        "ball.radius": R,
        "ball.restitution_slope": SLOPE,
    }.items():
        assert known[key].value == pytest.approx(value, rel=1e-15), key
