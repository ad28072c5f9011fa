"""Flights with drag, compiled because the arrays are too short for numpy to be efficient."""

from __future__ import annotations

from math import sqrt

from numba import njit

from virtual_lab.units import Array


@njit(cache=True, error_model="numpy")
def fly_with_drag(states: Array, pull: Array, drag: Array, dt: Array, steps: int) -> None:
    """Move positions along their flights by `dt`, with gravity and drag, and overwrite `states`.

    The method is Runge-Kutta of fourth order.

    Parameters
    ----------
    states
        x, y and their velocities, (row, position, 4); overwritten with the result.
    pull
        Acceleration without drag, (row, position, 2).
    drag
        Relative loss of speed per unit of path, (row,).
    dt
        Time by which each position is moved, (position,); it may be negative.
    steps
        Number of Runge-Kutta steps per position.
    """
    for row in range(states.shape[0]):
        k = drag[row]
        for n in range(states.shape[1]):
            x, y, vx, vy = states[row, n]
            px, py = pull[row, n]
            step = dt[n] / steps
            for _ in range(steps):
                loss = k * sqrt(vx * vx + vy * vy)
                ax, ay = px - loss * vx, py - loss * vy
                ux, uy = vx + step / 2 * ax, vy + step / 2 * ay
                loss = k * sqrt(ux * ux + uy * uy)
                bx, by = px - loss * ux, py - loss * uy
                ux, uy = vx + step / 2 * bx, vy + step / 2 * by
                loss = k * sqrt(ux * ux + uy * uy)
                cx, cy = px - loss * ux, py - loss * uy
                ux, uy = vx + step * cx, vy + step * cy
                loss = k * sqrt(ux * ux + uy * uy)
                x += step * (vx + step / 6 * (ax + bx + cx))
                y += step * (vy + step / 6 * (ay + by + cy))
                vx += step / 6 * (ax + 2 * (bx + cx) + px - loss * ux)
                vy += step / 6 * (ay + 2 * (by + cy) + py - loss * uy)
            states[row, n, 0] = x
            states[row, n, 1] = y
            states[row, n, 2] = vx
            states[row, n, 3] = vy
