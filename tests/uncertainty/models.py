"""Models of the standards and one of bats, with their inputs and published results."""

from __future__ import annotations

import numpy as np

from virtual_lab.uncertainty.inputs import Input

# inputs of JCGM 100:2008, H.1: end gauge, lengths in nm, temperatures in °C
END_GAUGE = {
    "ls": Input(50_000_623, 25, dof=18),
    "d0": Input(215, 5.8, dof=24),
    "d1": Input(0, 3.9, dof=5),
    "d2": Input(0, 6.7, dof=8),
    "alpha": Input(low=9.5e-6, high=13.5e-6),
    "d_alpha": Input(low=-1e-6, high=1e-6, dof=50),
    "d_theta": Input(low=-0.05, high=0.05, dof=2),
    "theta": Input(-0.1, 0.2),
    "cycle": Input(low=-0.5, high=0.5, distribution="arcsine"),
}


def end_gauge(ls, d0, d1, d2, alpha, d_alpha, d_theta, theta, cycle):
    return ls + d0 + d1 + d2 - ls * (d_alpha * (theta + cycle) + alpha * d_theta)


# readings of JCGM 100:2008, H.2, table H.2: V, mA, rad
CIRCUIT = np.array(
    [
        [5.007, 19.663, 1.0456],
        [4.994, 19.639, 1.0438],
        [5.005, 19.640, 1.0468],
        [4.990, 19.685, 1.0428],
        [4.999, 19.678, 1.0433],
    ]
)


def circuit(v, i, phi):
    ohm = v / (1e-3 * i)
    return {"R": ohm * np.cos(phi), "X": ohm * np.sin(phi), "Z": ohm}


# readings of JCGM 100:2008, H.3, table H.6: reading and correction, °C
THERMOMETER = np.array(
    [
        [21.521, -0.171],
        [22.012, -0.169],
        [22.512, -0.166],
        [23.003, -0.159],
        [23.507, -0.164],
        [23.999, -0.165],
        [24.513, -0.156],
        [25.002, -0.157],
        [25.503, -0.159],
        [26.010, -0.161],
        [26.511, -0.160],
    ]
)

# inputs of JCGM 101:2008, 9.3: mass calibration, mg and kg/m³, as the deviation from 100 g
MASS = {
    "m_rc": Input(100_000, 0.050),
    "dm_rc": Input(1.234, 0.020),
    "air": Input(low=1.10, high=1.30),
    "rho_w": Input(low=7000, high=9000),
    "rho_r": Input(low=7950, high=8050),
}


def mass(m_rc, dm_rc, air, rho_w, rho_r):
    return (m_rc + dm_rc) * (1 + (air - 1.2) * (1 / rho_w - 1 / rho_r)) - 100_000


# inputs of JCGM 101:2008, 9.4: comparison loss in a calibration of microwave power meters, r = 0
SQUARES = {"x1": Input(0.010, 0.005), "x2": Input(0.0, 0.005)}


def squares(x1, x2):
    return x1**2 + x2**2


# inputs of a moving bat, SI: a benchmark of engines, not the budget of a rig
BPF = {
    "gap": Input(low=0.3046, high=0.3050),
    "t_in": Input(0.011363, 5e-6),
    "t_out": Input(0.012843, 8e-6),
    "ball": Input(low=0.1450, high=0.1456),
    "bat": Input(low=0.7995, high=0.8005),
    "balance": Input(0.5524, 0.5e-3),
    "period": Input(1.4390, 0.5e-3, dof=9),
    "pivot": Input(low=0.1521, high=0.1527),
    "impact": Input(low=0.6837, high=0.6867, distribution="triangular"),
    "e0": Input(0.5, 0.003, dof=11),
    "spin": Input(25.0, 0.05, dof=5),
}


def bpf(gap, t_in, t_out, ball, bat, balance, period, pivot, impact, e0, spin):
    inertia = period**2 * 9.80665 * bat * (balance - pivot) / (4 * np.pi**2)
    arm = impact - pivot
    recoil = ball * arm**2 / inertia
    efficiency = (gap / t_out - spin * arm) / (gap / t_in + spin * arm)
    return (efficiency * (1 + recoil) + recoil) / e0
