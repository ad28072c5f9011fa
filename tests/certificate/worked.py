"""The numbers of a certificate, computed from its folder ``records`` alone by numpy.

Nothing of the program is imported: tables as they were written, equations of the 2003 paper
written out, uncertainties by central differences of the whole. The gates' and encoder's records
are those that sum (``passages``, ``rates``) or the edges of light gates (``gates``); ``python -m
tests.certificate.worked FOLDER`` prints what it finds.
"""

import csv
import json
import sys
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from math import atan, exp, inf, pi, sqrt
from pathlib import Path
from typing import Any

import numpy as np
from scipy.special import erf, fdtri, stdtrit

INCH, OUNCE, MPH = 0.0254, 0.45359237 / 16, 0.44704
UNITS = {
    "1": 1.0,
    "%": 0.01,
    "in": INCH,
    "mm": 1e-3,
    "mph": MPH,
    "oz": OUNCE,
    "deg": pi / 180,
    "rad/s": 1.0,
    "1/in": 1 / INCH,
    "oz in^2": OUNCE * INCH**2,
}
STEP = 0.5e-3  # step of the set positions [m]
Row = dict[str, Any]


@dataclass
class Known:
    """A constant of the test."""

    value: float
    u: float = 0.0
    dof: float = inf
    kind: str = "B"


@dataclass
class Line:
    """A line of the budget, with its contribution to the result."""

    name: str
    kind: str
    u: float
    dof: float
    moved: float
    value: float

    @property
    def sensitivity(self) -> float:
        return self.moved / self.u if self.u else 1.0


@dataclass
class Result:
    """A value with its budget."""

    value: float
    lines: list[Line]

    @property
    def u(self) -> float:
        return sqrt(sum(line.moved**2 for line in self.lines))

    def part(self, kind: str) -> float:
        return sqrt(sum(line.moved**2 for line in self.lines if line.kind == kind))

    @property
    def dof(self) -> float:
        fourth = sum(line.moved**4 / line.dof for line in self.lines)
        return self.u**4 / fourth if fourth else inf

    @property
    def interval(self) -> list[float]:
        half = float(stdtrit(min(self.dof, 1e9), 0.975)) * self.u
        return [self.value - half, self.value + half]


def in_si(sheet: Any) -> Any:
    """Return a procedure's keys as plain numbers in SI."""
    if isinstance(sheet, dict) and "unit" in sheet:
        unit, value = UNITS[sheet["unit"]], sheet["value"]
        return [each * unit for each in value] if isinstance(value, list) else value * unit
    if isinstance(sheet, dict):
        return {key: in_si(each) for key, each in sheet.items()}
    return sheet


def table(path: Path) -> dict[str, np.ndarray]:
    with path.open(encoding="utf-8") as file:
        rows = list(csv.reader(file))
    columns = zip(*rows[1:], strict=True)
    return {
        name: np.array([float(each or "nan") for each in column])
        for name, column in zip(rows[0], columns, strict=True)
    }


def passages(path: Path) -> tuple[np.ndarray, np.ndarray]:
    """Return time and height of the ball's center, (shot, way, gate)."""
    rows = table(path)
    shape = [int(rows[axis].max()) + 1 for axis in ("shot", "way", "gate")]
    if "edge" in rows:
        times = rows["time_s"].reshape(*shape, 2).mean(axis=-1)
        return times, np.full(times.shape, np.nan)
    return rows["time_s"].reshape(shape), rows["height_m"].reshape(shape)


def mean_of(readings: np.ndarray, step: float = 0.0) -> Known:
    """Return a mean of readings with a finite resolution."""
    n = len(readings)
    mean = sum(readings) / n
    u = sqrt(sum((each - mean) ** 2 for each in readings) / (n - 1) / n)
    least = step / sqrt(12)
    return Known(mean, max(u, least), n - 1 if u >= least else inf, "A")


def swing_factor(first: float, last: float, swings: int) -> float:
    """Return the ratio of the mean period to that of very small swings."""
    total = 0.0
    for k in range(swings):
        angle = first * (last / first) ** ((k + 0.5) / swings)
        total += 1 + angle**2 / 16 + 11 * angle**4 / 3072
    return total / swings


def slope_through(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return intercept and slope of y over x along the last axis, NaN ignored."""
    both = np.isfinite(x) & np.isfinite(y)
    n = both.sum(axis=-1).astype(float)
    n[n < 2] = np.nan
    x0, y0 = (np.where(both, each, 0).sum(axis=-1) / n for each in (x, y))
    off_x, off_y = np.where(both, x - x0[..., None], 0), np.where(both, y - y0[..., None], 0)
    slope = (off_x * off_y).sum(axis=-1) / np.where(n > 1, (off_x**2).sum(axis=-1), np.nan)
    return y0 - slope * x0, slope


def density(kelvin: float, humidity: float, pascal: float) -> float:
    """Return the density of air by CIPM-2007, Metrologia 45 (2008) 149, equations 1 to 4."""
    t = kelvin - 273.15
    saturated = exp(
        1.2378847e-5 * kelvin**2 - 1.9121316e-2 * kelvin + 33.93711047 - 6.3431645e3 / kelvin
    )
    x = humidity * (1.00062 + 3.14e-8 * pascal + 5.6e-7 * t**2) * saturated / pascal
    first = 1.58123e-6 - 2.9331e-8 * t + 1.1043e-10 * t**2
    first += (5.707e-6 - 2.051e-8 * t) * x + (1.9898e-4 - 2.376e-6 * t) * x**2
    ratio = pascal / kelvin
    z = 1 - ratio * first + ratio**2 * (1.83e-11 - 0.765e-8 * x**2)
    return 3.483740e-3 * pascal / (z * kelvin) * (1 - 0.3780 * x)


class Test:
    """The records of one test and their results."""

    __test__ = False

    def __init__(self, records: Path) -> None:
        session = json.loads((records / "session.json").read_text("utf-8"))
        self.rules: Row = in_si(tomllib.loads((records / "procedure.toml").read_text("utf-8")))
        self.known = {
            key: Known(
                each["value"], each["u"], each.get("dof") or inf, each.get("evaluation", "B")
            )
            for key, each in session["calibration"].items()
        }
        self.construction = session.get("bat_construction")
        self.records = records
        self._bench()
        self._wall()
        self._impact()
        best = {key: each.value for key, each in self.known.items()}
        self.kept: Any = 1.0
        self.kept = self._kept(self.balls(best)["e0"])
        self.lot = self._lot(best)
        self.best = self.model(best)
        self.reasons = self._judged()
        self.valid = np.array([not word for word, _ in self.reasons])
        self.weights, self.effects, self.place = self._outcome(self.metric(self.best))

    # section: the bench

    def _bench(self) -> None:
        bench, known = self.records / "bench", self.known
        for name, channel, column, instrument in (
            ("mass", "bat-mass", "mass_kg", "scale"),
            ("length", "length", "length_m", "rule"),
            ("barrel_radius", "barrel-radius", "length_m", "rule"),
            ("balance", "balance", "length_m", "stand"),
        ):
            readings = table(bench / f"{channel}.csv")[column]
            known[f"bat.{name}"] = mean_of(readings, known[f"bench.{instrument}.resolution"].value)
        rows = table(bench / "pendulum.csv")
        releases = int(rows["release"].max()) + 1
        times = rows["time_s"].reshape(releases, -1)
        first = rows["first_amplitude_rad"].reshape(releases, -1)[:, 0]
        last = rows["last_amplitude_rad"].reshape(releases, -1)[:, 0]
        self.swings = times.shape[1] - 1
        self.amplitudes = first.mean(), last.mean()
        small = [
            (each[-1] - each[0]) / self.swings / swing_factor(start, end, self.swings)
            for each, start, end in zip(times, first, last, strict=True)
        ]
        known["bat.period"] = mean_of(np.array(small))
        if (bench / "climate.csv").exists():
            self._air(table(bench / "climate.csv"))

    def _air(self, rows: Row) -> None:
        """Replace the density of the air by that of the readings at the start and the end."""
        names = ("temperature", "humidity", "pressure")
        offsets = [self.known.pop(f"bench.climate.{name}") for name in names]
        steps = [self.known.pop(f"bench.climate.{name}_resolution").value for name in names]
        shown = [rows["temperature_K"], rows["humidity"], rows["pressure_Pa"]]

        def densities(*off: float) -> list[float]:
            each = [
                values - known.value + more
                for values, known, more in zip(shown, offsets, off, strict=True)
            ]
            return [density(*reading) for reading in zip(*each, strict=True)]

        start, end = densities(0, 0, 0)
        variance = (end - start) ** 2 / 12 + (22e-6 * (start + end) / 2) ** 2
        for which in range(3):
            off = np.zeros(3)
            off[which] = sqrt(offsets[which].u ** 2 + steps[which] ** 2 / 12)
            variance += ((sum(densities(*off)) - start - end) / 2) ** 2
        self.known["hall.air.density"] = Known((start + end) / 2, sqrt(variance))

    def bat(self, x: Row) -> Row:
        """Return mass, length, z_cm, inertia_cm and radius of the barrel."""
        mass = (x["bat.mass"] - x["bench.scale.zero"]) / x["bench.scale.span"]
        length = x["bat.length"] - x["bench.rule.offset"]
        z_cm = x["bat.balance"] - x["bench.stand.offset"]
        lever = length - x["bench.pendulum.pivot_from_knob"] - z_cm
        first, last = self.amplitudes
        off = x["bench.pendulum.amplitude_offset"]
        period = x["bat.period"] / x["bench.pendulum.clock"]
        period *= swing_factor(first, last, self.swings)
        period /= swing_factor(first - off, last - off, self.swings)
        moment = mass * lever + x["bench.pendulum.clamp_moment"]
        both = (period / (2 * pi)) ** 2 * x["hall.gravity"] * moment
        return {
            "mass": mass,
            "length": length,
            "z_cm": z_cm,
            "inertia_cm": both - x["bench.pendulum.clamp_inertia"] - mass * lever**2,
            "radius": x["bat.barrel_radius"] - x["bench.rule.offset"],
        }

    # section: the wall

    def _wall(self) -> None:
        rows = table(self.records / "bench" / "ball-mass.csv")
        self.ball_readings = rows["mass_kg"].reshape(int(rows["item"].max()) + 1, -1).mean(axis=1)
        log = table(self.records / "balls" / "log.csv")
        times, _ = passages(self.records / "balls" / "gates.csv")
        seen = np.isfinite(times).all(axis=(1, 2))
        self.wall_times = times[seen]
        self.wall_ball = log["ball"][seen].astype(int)
        self.wall_speed = log["nominal_speed_m_per_s"][seen]
        there = self.wall_times[:, 0, -1] - self.wall_times[:, 0, 0]
        back = self.wall_times[:, 1, 0] - self.wall_times[:, 1, -1]
        ratio = there / back
        self.sloped = np.ptp(self.wall_speed) > 0
        columns = [1.0 * (self.wall_ball == ball) for ball in range(len(self.ball_readings))]
        if self.sloped:
            columns.append(self.wall_speed)
        matrix = np.stack(columns, axis=1)
        left = ratio - matrix @ np.linalg.lstsq(matrix, ratio, rcond=None)[0]
        dof = len(ratio) - matrix.shape[1]
        variance = float(left @ left) / dof
        for ball in range(len(self.ball_readings)):
            u = sqrt(variance / (self.wall_ball == ball).sum())
            self.known[f"wall.ball {ball}"] = Known(0.0, u, dof, "A")
        if self.sloped:
            square = self._steepness() @ self._steepness()
            self.known["balls.slope_repeatability"] = Known(0.0, sqrt(variance / square), dof, "A")

    def _steepness(self) -> np.ndarray:
        """Return the speeds of wall hits minus the mean of their ball."""
        off = self.wall_speed.copy()
        for ball in set(self.wall_ball):
            off[self.wall_ball == ball] -= self.wall_speed[self.wall_ball == ball].mean()
        return off

    def drag(self, x: Row, mass: np.ndarray) -> np.ndarray:
        area = pi * x["ball.radius"] ** 2
        return x["hall.air.density"] * x["hall.air.drag_coefficient"] * area / (2 * mass)

    def flights(
        self, x: Row, stage: str, times: np.ndarray, heights: np.ndarray, drag: np.ndarray
    ) -> Row:
        """Return speeds at the target in and out, height there, and the slope going back."""
        gates = times.shape[2]
        far = np.array([x[f"{stage}.gates.distance_{gate}"] for gate in range(gates)])
        k = drag[:, None]
        reach = np.stack([(1 - np.exp(-k * far)) / k, (np.exp(k * far) - 1) / k], axis=1)
        sign = np.array([-1.0, 1.0])
        speed = sign * slope_through(times, reach)[1] * x[f"{stage}.gates.clock"]
        found = {"in": speed[:, 0], "out": speed[:, 1]}
        if f"{stage}.gates.height_0" in x:
            zeros = np.array([x[f"{stage}.gates.height_{gate}"] for gate in range(gates)])
            fallen = x["hall.gravity"] / 2 * (reach / speed[..., None]) ** 2
            level, slope = slope_through(
                np.broadcast_to(far, times.shape), heights + zeros + fallen
            )
            found |= {"height": level[:, 0], "slope": slope[:, 1]}
        return found

    def balls(self, x: Row) -> Row:
        """Return mass and e0 of each ball at the wall's mean speed, and the slope of e0."""
        mass = (self.ball_readings - x["bench.scale.zero"]) / x["bench.scale.span"]
        nothing = np.full(self.wall_times.shape, np.nan)
        drag = self.drag(x, mass[self.wall_ball])
        flown = self.flights(x, "balls", self.wall_times, nothing, drag)
        ratio, middle = flown["out"] / flown["in"], self.wall_speed.mean()
        slope = x["ball.restitution_slope"]
        if self.sloped:
            off = self._steepness()
            slope = ratio @ off / (flown["in"] @ off) + x["balls.slope_repeatability"]
        hits = ratio - slope * (flown["in"] - middle)
        e0 = [
            hits[self.wall_ball == ball].mean() + x[f"wall.ball {ball}"]
            for ball in range(len(mass))
        ]
        shown = np.array(e0)
        drawn = shown.mean() + self.kept * (shown - shown.mean())
        return {"mass": mass, "e0": shown, "drawn": drawn, "slope": slope, "speed": middle}

    def _kept(self, e0: np.ndarray) -> np.ndarray:
        """Return the share of its deviation from the lot that each ball keeps.

        What it loses is the share of the errors in the variance of the balls.
        """
        square = float(np.square([self.known[f"wall.ball {n}"].u for n in range(len(e0))])[0])
        return max(1 - square / float(e0.var(ddof=1)), 0.0)

    def _lot(self, x: Row) -> np.ndarray:
        """Return the balls that the rules admit, a mask (ball,)."""
        balls, windows = self.balls(x), self.rules["windows"]
        e0 = balls["e0"] + balls["slope"] * (windows["ball_restitution_speed"] - balls["speed"])
        fit = (windows["ball_mass_low"] <= balls["mass"]) & (
            balls["mass"] <= windows["ball_mass_high"]
        )
        fit &= (windows["ball_restitution_low"] <= e0) & (e0 <= windows["ball_restitution_high"])
        return fit if fit.any() else ~fit

    # section: the hits at the bat

    def _impact(self) -> None:
        folder = self.records / "impact"
        log, known = table(folder / "log.csv"), self.known
        self.ball = log["ball"].astype(int)
        self.along = known["impact.cannon.along"].value if "impact.cannon.along" in known else 0.0
        self.set = log["place_m"] + self.along
        self.times, self.heights = passages(folder / "gates.csv")
        self.encoder, self.swing = (
            table(folder / f"{name}.csv") if (folder / f"{name}.csv").exists() else None
            for name in ("encoder", "swing")
        )
        if "impact.gates.height_0" not in known:
            across = table(folder / "aim.csv")["across_m"]
            square = float((across**2).mean())
            known["across_square"] = Known(square, square * sqrt(2 / len(across)), len(across), "A")
        slope_u = self.rules.get("place_slope_u", 0.0)
        self.corrects_place = bool(self.rules.get("place_slope") or slope_u)
        if self.corrects_place:
            error = slope_u * known["impact.cannon.along"].u
            known["procedure.place_slope_error"] = Known(0.0, error)

    def turn(self, length: Any) -> Any:
        """Return the angular speed of the rules [rad/s]."""
        rules = self.rules
        return rules.get("bat_speed", 0.0) / (length - rules["pivot_from_knob"] - 6 * INCH)

    def recoil_factor(self, bat: Row, mass: Any, place: Any, support: str) -> Any:
        if support == "free":
            return mass * (1 / bat["mass"] + (place - bat["z_cm"]) ** 2 / bat["inertia_cm"])
        axis = bat["length"] - self.rules["pivot_from_knob"]
        inertia = bat["inertia_cm"] + bat["mass"] * (axis - bat["z_cm"]) ** 2
        return mass * (axis - place) ** 2 / inertia

    def model(self, x: Row) -> Row:
        """Return the results of every shot for one set of constants, (shot,) each."""
        rules, bat, balls = self.rules, self.bat(x), self.balls(x)
        mass = balls["mass"][self.ball]
        flown = self.flights(x, "impact", self.times, self.heights, self.drag(x, mass))
        v, back = flown["in"], flown["out"]
        struck = self.set + x.get("impact.cannon.along", self.along) - self.along
        axis = bat["length"] - x["impact.pivot.from_knob"]
        clock = x["impact.gates.clock"]
        turned, cos = np.zeros(len(v)), np.ones(len(v))
        if self.swing is not None:
            angle = 2 * pi / (x["impact.swing.scale"] * x["impact.swing.counts_per_turn"])
            turned = angle * self.swing["counts_per_s"] * clock
            cos = np.cos(angle * self.swing["counts_at_contact"])
        lever = (axis - struck) / cos
        bat_speed = lever * turned
        relative = v * cos + bat_speed
        if "impact.gates.height_0" in x:
            square = (flown["height"] - x["impact.pivot.height"]) ** 2
        else:
            square = x["across_square"]
        sine = square / (bat["radius"] + x["ball.radius"]) ** 2
        rebound = ((back + v * (1 - cos**2)) / cos - bat_speed) / relative
        rebound = (rebound + sine) / (1 - sine)
        recoiled = rate = np.full(len(v), np.nan)
        if self.encoder is not None:
            counts = x["impact.encoder.scale"] * x["impact.encoder.counts_per_turn"]
            rate = 2 * pi * self.encoder["counts_per_s"] * clock / counts
            about = bat["inertia_cm"] + bat["mass"] * (axis - bat["z_cm"]) ** 2
            recoiled = (about * rate / (mass * lever) / v - 1 + sine) / (1 - sine)
        e_a = recoiled if rules["reads"] == "recoil" else rebound
        at = struck
        if self.corrects_place:
            e_a = e_a - rules.get("place_slope", 0.0) * (struck - self.set)
            e_a = e_a - x["procedure.place_slope_error"]
            at = self.set
        r = self.recoil_factor(bat, mass, at, rules["recoil"])
        e = e_a * (1 + r) + r
        e0 = balls["drawn"][self.ball] + balls["slope"] * (relative - balls["speed"])
        # the same hit by the mean ball of the lot at the nominal speed
        nominal = rules["ball_speed"] + self.turn(bat["length"]) * (
            bat["length"] - rules["pivot_from_knob"] - self.set
        )
        lot_e0 = balls["drawn"][self.lot].mean() + balls["slope"] * (nominal - balls["speed"])
        lot_mass = balls["mass"][self.lot].mean()
        lot_r = self.recoil_factor(bat, lot_mass, at, rules["recoil"])
        lot_e = e / e0 * lot_e0
        return {
            "bat": bat,
            "balls": balls,
            "mass": mass,
            "speed": v,
            "back": back,
            "rise": flown.get("slope"),
            "bat_speed": bat_speed,
            "turned": turned,
            "relative": relative,
            "rate": rate,
            "rebound": rebound,
            "recoiled": recoiled,
            "e_a": e_a,
            "r": r,
            "e": e,
            "e0": e0,
            "at": at + axis - struck - lever,
            "bat_performance_factor": e / e0,
            "restitution": lot_e,
            "ball_restitution": lot_e0 + 0 * e,
            "collision_efficiency": (lot_e - lot_r) / (1 + lot_r),
            "recoil_factor": self.recoil_factor(bat, lot_mass, self.set, rules["recoil"]) + 0 * e,
            "lot_r": lot_r,
            "lot_mass": lot_mass,
            "control": x.get("control.restitution_ratio", 1.0),
        }

    def metric(
        self, found: Row, exponent: float | None = None, *, corrected: bool = True
    ) -> np.ndarray:
        """Return the metric of each shot, with or without the correction for the balls."""
        rules, e = self.rules, found["restitution"]
        way = rules.get("correction", {}) if corrected else {}
        way = way or {"method": "none"}
        if way["method"] == "control-bat":
            e = e / found["control"]
        elif way["method"] == "trampoline":
            soft, hard = found["ball_restitution"], way["standard"]
            ratio = (1 - e**2) / (e**2 - soft**2)  # ratio of the stiffnesses, shell over ball
            sprung = np.sqrt((hard**2 * ratio + 1) / (ratio + 1), where=ratio > 0, out=0 * e)
            e = np.where(e > soft, sprung, e * hard / soft)
        if rules["metric"] == "restitution":
            return e
        if rules["metric"] == "bat_performance_factor":
            return e / found["ball_restitution"]
        e_a = (e - found["lot_r"]) / (1 + found["lot_r"])
        if rules["metric"] == "besr":
            return e_a + 0.5
        pitch, swung = self.field(found, exponent)
        return e_a * pitch + (1 + e_a) * swung

    def field(self, found: Row, exponent: float | None = None) -> tuple[float, np.ndarray]:
        """Return speeds of pitch and bat in the game [m/s]."""
        rules, bat, at = self.rules, found["bat"], found["at"]
        game = rules.get("game")
        if game is None:
            lever = bat["length"] - rules["pivot_from_knob"] - at
            return rules["ball_speed"], self.turn(bat["length"]) * lever
        power = game["exponent"] if exponent is None else exponent
        reach, inertia = 1.0, bat["inertia_cm"]
        if "axis_from_knob" in game:
            axis = bat["length"] - game["axis_from_knob"]
            reach = axis - at
            inertia += bat["mass"] * (axis - bat["z_cm"]) ** 2
        if game["scales_with"] == "mass":
            slower = (game["reference_mass"] / bat["mass"]) ** power
        else:
            slower = (game["reference_inertia"] / inertia) ** power
        return game["pitch_speed"], game.get(
            "angular_speed", game.get("bat_speed")
        ) * reach * slower

    # section: valid hits

    def _judged(self) -> list[tuple[str, float]]:
        """Return the name of the first window that each shot violates, and the value."""
        rules, windows, s = self.rules, self.rules["windows"], self.best
        bat, balls = s["bat"], s["balls"]
        axis = bat["length"] - rules["pivot_from_knob"]
        lever = axis - bat["z_cm"]
        percussion = bat["z_cm"] - bat["inertia_cm"] / (bat["mass"] * lever)
        own = balls["e0"] + balls["slope"] * (windows["ball_restitution_speed"] - balls["speed"])
        asked = float(self.turn(bat["length"]))
        found: list[tuple[str, float]] = []
        for n in range(len(self.ball)):
            speed, mass, e0 = s["speed"][n], s["mass"][n], own[self.ball[n]]
            # violated window, and its value
            shown = {
                "incoming ball": (not np.isfinite(speed), np.nan),
                "ball speed": (
                    abs(speed - rules["ball_speed"]) > windows["speed_tolerance"],
                    speed / MPH,
                ),
                "oz": (
                    not windows["ball_mass_low"] <= mass <= windows["ball_mass_high"],
                    mass / OUNCE,
                ),
                "e0 of the ball": (
                    not windows["ball_restitution_low"] <= e0 <= windows["ball_restitution_high"],
                    e0,
                ),
            }
            place = self.set[n]
            if "scan" in rules:
                low, high = rules["scan"]["low"] - STEP, rules["scan"]["high"] + STEP
                shown["impact position set to"] = not low <= place <= high, place / INCH
            elif "place_tolerance" in windows:
                off = abs(place - percussion)
                shown["impact position set to"] = off > windows["place_tolerance"], place / INCH
            if "rebound_angle" in windows:
                angle = abs(atan(s["rise"][n]))
                shown["rebound angle"] = angle > windows["rebound_angle"], angle * 180 / pi
            if self.encoder is not None:
                counts = self.encoder["counts_per_s"][n]
                before = abs(self.encoder["counts_per_s_before"][n] * s["rate"][n] / counts)
                unclear = self.encoder["u_counts_per_s"][n] / abs(counts)
                shown["before contact"] = before > windows.get("rate_before", inf), before
                shown["recoil rate"] = unclear > windows.get("recoil_u", inf), 100 * unclear
            if self.swing is not None:
                lever = rules["bat_speed"] / asked
                off = abs(s["turned"][n] - asked) * lever
                slant = self.swing["counts_at_contact"][n] / self.swing["counts_per_s"][n]
                slant = abs(slant * s["turned"][n])
                shown["bat speed"] = (
                    off > windows["bat_speed_tolerance"],
                    s["turned"][n] * lever / MPH,
                )
                shown["from square"] = slant > windows["contact_angle"], slant * 180 / pi
            e = s["e"][n]
            if rules["reads"] == "rebound":
                shown["returning ball"] = not np.isfinite(e), np.nan
            shown["restitution"] = not 0 < e <= 1, e
            broken = [(name, float(number)) for name, (bad, number) in shown.items() if bad]
            found.append(broken[0] if broken else ("", np.nan))
        return found

    # section: the result

    def at_place(self, place: float) -> np.ndarray:
        return np.abs(self.set - place) < STEP / 2 + 1e-9

    def scanned(self) -> tuple[np.ndarray, list[float]]:
        """Return the hits of the scan, the first at each position, and the complete positions."""
        many, own, full = int(self.rules["valid_hits"]), np.zeros(len(self.set), bool), []
        for place in sorted({round(float(each), 6) for each in self.set}):
            here = np.flatnonzero(self.valid & self.at_place(place))[:many]
            own[here] = True
            if len(here) == many:
                full.append(place)
        return own, full

    def _outcome(
        self, metric: np.ndarray, *, seeks: str | None = None
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Return the weight and the effect of each hit, and the position of the result."""
        scan = self.rules.get("scan")
        if scan is None:
            weights = self.valid / self.valid.sum()
            return weights, weights, float(self.set[self.valid].mean())
        seeks = seeks or scan.get("seeks", "metric")
        sought, gain = metric, np.ones(len(metric))
        if seeks == "batted_speed":
            pitch, swung = self.field(self.best | {"at": self.set})
            sought, gain = (metric - 0.5) * pitch + (metric + 0.5) * swung, pitch + swung
        own, full = self.scanned()
        means = [sought[own & self.at_place(place)].mean() for place in full]
        best = full[int(np.argmax(means))]
        if scan["final_hits"]:
            row: list[int] = []
            for n in np.flatnonzero(self.at_place(best) & ~own):
                if self.valid[n]:
                    row.append(int(n))
                elif scan["consecutive"]:  # an invalid shot restarts the count
                    row.clear()
            row, weights = row[-int(scan["final_hits"]) :], np.zeros(len(metric))
            weights[row] = 1 / len(row)
            return weights, weights, float(self.set[weights > 0].mean())
        near = own & np.any([self.at_place(place) for place in full], axis=0)
        near &= np.abs(self.set - best) < scan["fit_half_width"] + 2 * STEP
        far = own & (np.abs(self.set - best) < 2 * scan["fit_half_width"] + 2 * STEP)
        return self._top(near, far, metric, sought, gain, moves=seeks == "batted_speed")

    def _top(
        self,
        near: np.ndarray,
        far: np.ndarray,
        metric: np.ndarray,
        sought: np.ndarray,
        gain: np.ndarray,
        *,
        moves: bool,
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """Return weights and effects of hits near the top of a curve.

        The curve bends like a cubic through the hits that are `far` at most, and its line is fitted
        to those that are `near`. It is linear in the hits, so that the curve of one hit alone shows
        the effect of this hit on the slope.
        """
        polynomial = np.polynomial.Polynomial
        middle, width = self.set[near].mean(), self.rules["scan"]["fit_half_width"]
        x = (self.set - middle) / width

        def fit(values: np.ndarray, hits: np.ndarray, most: int) -> np.polynomial.Polynomial:
            degree = min(most, len(set(np.round(x[hits], 6))) - 1)
            return polynomial(np.polynomial.polynomial.polyfit(x[hits], values[hits], degree))

        def curve(values: np.ndarray) -> np.polynomial.Polynomial:
            bent = polynomial([0, 0, *fit(values, far, 3).coef[2:]])
            return bent + fit(values - bent(x), near, 1)

        f, low, high = curve(sought), x[near].min(), x[near].max()
        fine = np.linspace(low, high, 2001)
        where = fine[int(np.argmax(f(fine)))]
        for _ in range(30):  # Newton's method, inside the range
            if low < where < high:
                where = where - f.deriv()(where) / f.deriv(2)(where)
        where = float(min(max(where, low), high))
        ones = np.eye(len(metric))
        weights = np.array([fit(one, near, 3)(where) for one in ones]) * near
        effects = weights.copy()
        if moves:
            slopes = np.array([curve(one).deriv()(where) for one in ones]) * far
            share = np.sqrt((slopes**2).sum() / (slopes[near] ** 2).sum())
            shift = curve(metric).deriv()(where) / -f.deriv(2)(0) * share
            effects += shift * slopes * gain * near
        return weights, effects, float(middle + where * width)

    # section: uncertainty

    def moved(self) -> dict[str, tuple[Row, Row]]:
        """Return every shot with each uncertain constant one u higher and one u lower."""
        best = {key: each.value for key, each in self.known.items()}
        return {
            key: (
                self.model(best | {key: each.value + each.u}),
                self.model(best | {key: each.value - each.u}),
            )
            for key, each in self.known.items()
            if each.u > 0
        }

    def result(
        self,
        of: Callable[[Row], np.ndarray],
        moved: dict[str, tuple[Row, Row]],
        weights: np.ndarray,
        effects: np.ndarray,
    ) -> Result:
        """Return a weighted sum of hits with its budget."""
        used = weights != 0
        hits, w, k = of(self.best)[used], weights[used], effects[used]
        steps = {key: (of(up)[used] - of(down)[used]) / 2 for key, (up, down) in moved.items()}
        lines = [
            Line(
                key,
                self.known[key].kind,
                self.known[key].u,
                self.known[key].dof,
                step @ k,
                self.known[key].value,
            )
            for key, step in steps.items()
        ]
        places = np.round(self.set[used], 6)
        lines.append(self._scatter(hits, k, places, np.array(list(steps.values()))))
        self._lean(lines[-1], of(self.best), used, k, np.array(list(steps.values())))
        lines[-1].value = float(hits @ k)
        return Result(float(hits @ w), self._pooled(lines))

    def _lean(
        self, line: Line, every: np.ndarray, used: np.ndarray, k: np.ndarray, steps: np.ndarray
    ) -> None:
        """Pool the scatter of the final hits of a scan with that of other hits within an inch."""
        scan = self.rules.get("scan")
        if scan is None or not scan["final_hits"]:
            return
        near = np.abs(self.set - self.set[used].mean()) < scan["fit_half_width"] + STEP
        square, freedom = 0.0, 0
        for place in np.unique(np.round(self.set[near], 6)):
            here = every[near & ~used & self.valid & (np.abs(self.set - place) < 1e-6)]
            square += float(((here - here.mean()) ** 2).sum()) if here.size else 0.0
            freedom += max(here.size - 1, 0)
        own = float(((every[used] - every[used].mean()) ** 2).sum())
        known = float(((steps - steps.mean(axis=1, keepdims=True)) ** 2).sum())
        n = int(used.sum()) - 1
        if not (freedom and own and square) or own / n > fdtri(n, freedom, 0.99) * square / freedom:
            return
        total = (own + square) / (n + freedom)
        left = max((own - known + square) / (n + freedom), 1e-3 * total)
        line.u = line.moved = sqrt(float(k @ k) * left)
        line.dof = (n + freedom) * (left / total) ** 2

    def _scatter(
        self, hits: np.ndarray, k: np.ndarray, places: np.ndarray, steps: np.ndarray
    ) -> Line:
        """Return the scatter within positions minus the part explained by constants."""
        seen, known, free, share = [], [], [], []
        for place in sorted(set(places)):
            here = places == place
            seen.append(((hits[here] - hits[here].mean()) ** 2).sum())
            off = steps[:, here] - steps[:, here].mean(axis=1, keepdims=True)
            known.append((off**2).sum())
            free.append(here.sum() - 1)
            share.append((k[here] ** 2).sum())
        total, fourth = 0.0, 0.0
        for a, b, f, s in zip(seen, known, free, share, strict=True):
            own = a / f if f else sum(seen) / max(sum(free), 1)
            made = b / f if f else sum(known) / max(sum(free), 1)
            total += s * max(own - made, 0.0)
            fourth += (s * own) ** 2 / f if f else 0.0
        dof = total**2 / fourth if total > 0 and fourth > 0 else inf
        return Line("hits", "A", sqrt(total), dof, sqrt(total), 0.0)

    def _pooled(self, lines: list[Line]) -> list[Line]:
        """Return the budget with the pooled lines of the balls' scatter as one line."""
        balls = [line for line in lines if line.name.startswith("wall.ball")]
        u = sqrt(sum(line.u**2 for line in balls) / len(balls))
        moved = sqrt(sum(line.moved**2 for line in balls))
        pool = Line("balls.repeatability", "A", u, balls[0].dof, moved, 0.0)
        return [line for line in lines if line not in balls] + [pool]

    def bat_results(self) -> dict[str, Result]:
        """Return mass, length, balance and inertia of the bat with their budgets."""
        best = {key: each.value for key, each in self.known.items()}
        found = {}
        for name in ("mass", "length", "z_cm", "inertia_cm"):
            lines = []
            for key, each in self.known.items():
                up, down = (self.bat(best | {key: each.value + s * each.u}) for s in (1, -1))
                if each.u > 0:
                    step = (up[name] - down[name]) / 2
                    lines.append(Line(key, each.kind, each.u, each.dof, step, each.value))
            found[name] = Result(self.best["bat"][name], lines)
        return found

    def choice(self, metric: np.ndarray) -> tuple[float, float]:
        """Return the mean deficit of the chosen position below the best one, and its u."""
        scan = self.rules.get("scan")
        if scan is None or not scan["final_hits"]:
            return 0.0, 0.0
        own, full = self.scanned()
        hits = {place: metric[own & self.at_place(place)] for place in full}
        best = max(hits, key=lambda place: float(hits[place].mean()))
        squares = sum(((each - each.mean()) ** 2).sum() for each in hits.values())
        freedom = sum(len(each) - 1 for each in hits.values())
        u = sqrt(2 * squares / freedom / self.rules["valid_hits"])
        mean = square = 0.0
        for place, each in hits.items():
            if 1e-6 < abs(place - best) < scan["fine_step"] + 2 * STEP:
                # mean positive part of a normal distribution with mean d and standard deviation u
                d = each.mean() - hits[best].mean()
                chance = (1 + erf(d / u / sqrt(2))) / 2
                density = np.exp(-((d / u) ** 2) / 2) / sqrt(2 * pi)
                mean += d * chance + u * density
                square += (d**2 + u**2) * chance + d * u * density
        return mean, sqrt(square - mean**2)

    def width(self, metric: np.ndarray) -> Row | None:
        """Return the length of barrel near the maximum, by a quintic; None if it is cut off."""
        drop = self.rules.get("scan", {}).get("width_drop")
        if not drop:
            return None
        place, value = self.set[self.valid], metric[self.valid]

        def ends(values: np.ndarray) -> np.ndarray:
            curve = np.polynomial.Polynomial.fit(place, values, 5)
            fine = np.linspace(place.min(), place.max(), 40_001)
            heights = curve(fine)
            top = int(np.argmax(heights))
            below = heights < heights[top] - drop
            low = np.flatnonzero(below[:top])
            high = np.flatnonzero(below[top:])
            if not (low.size and high.size):
                raise ValueError("an end is cut off")
            found = []
            for a in (low[-1], top + high[0] - 1):  # linear between two close positions
                y = heights[a : a + 2] - heights[top] + drop
                found.append(fine[a] - y[0] * (fine[a + 1] - fine[a]) / (y[1] - y[0]))
            return np.array(found)

        try:
            low, high = ends(value)
        except ValueError:
            return None
        x = np.vander((place - place.mean()) / np.ptp(place), 6)
        hat = x @ np.linalg.pinv(x)
        left = (value - hat @ value) / (1 - np.diag(hat))
        step, square = 1e-5, 0.0
        for number in range(len(value)):
            one = step * np.eye(len(value))[number]
            wider, closer = (np.diff(ends(value + sign * one))[0] for sign in (1, -1))
            square += ((wider - closer) / (2 * step) * left[number]) ** 2
        return {"value": high - low, "u": sqrt(square), "low": low, "high": high}


def worked(records: Path) -> Row:
    """Return the numbers of a certificate's document, by its keys, from the records."""
    test = Test(records)
    rules, best, moved, used = test.rules, test.best, test.moved(), test.weights != 0
    metric = test.metric(best)
    result = test.result(test.metric, moved, test.weights, test.effects)
    lost, lost_u = test.choice(metric)
    if lost_u:
        lines = [*result.lines, Line("choice of the place", "A", lost_u, inf, lost_u, lost)]
        result = Result(result.value + lost, lines)
    total = sum(line.moved**2 for line in result.lines)
    plain = rules.get("correction", {}).get("method", "none") == "none"
    quantities = {
        name: test.result(lambda found, name=name: found[name], moved, test.weights, test.weights)
        for name in (
            "bat_performance_factor",
            "collision_efficiency",
            "restitution",
            "recoil_factor",
            "ball_restitution",
        )
        if name != rules["metric"] or not plain
    }
    which = "free" if rules["recoil"] == "pivoted" else "pivoted"
    place = best["at"]
    other = test.recoil_factor(best["bat"], best["lot_mass"], place, which)
    other_e = best["collision_efficiency"] * (1 + other) + other
    limit = rules.get("limit", rules.get("speed_limit"))
    seen = test.valid & np.isfinite(best["rebound"])
    gap = (best["rebound"] - best["recoiled"])[seen]
    check = None
    if test.encoder is not None:
        many, spread = len(gap), sqrt(float(((gap - gap.mean()) ** 2).sum())) if len(gap) else 0.0
        check = {
            "shots": many,
            "collision_efficiency": float(best["rebound"][seen].mean()) if many else None,
            "difference": float(gap.mean()) if many else None,
            "u": spread / sqrt((many - 1) * many) if many > 1 else None,
        }
    control = test.known.get("control.restitution_ratio") if not plain else None
    return {
        "metric": {
            "value": result.value,
            "u": result.u,
            "interval_95": result.interval,
            "dof": result.dof,
            "u_type_a": result.part("A"),
            "u_type_b": result.part("B"),
            "limit": limit,
            "impact_position_in": test.place / INCH,
        },
        **{name: {"value": each.value, "u": each.u} for name, each in quantities.items()},
        "bat": {
            f"{name}_{unit}": {"value": each.value, "u": each.u}
            for (name, each), unit in zip(
                test.bat_results().items(), ("kg", "m", "m", "kg_m2"), strict=True
            )
        },
        "set_aside": np.flatnonzero(~test.lot).tolist(),
        "other": {
            "recoil_factor": float(other[used] @ test.weights[used]),
            "restitution": float(other_e[used] @ test.weights[used]),
            "bat_performance_factor": float(
                (other_e / best["ball_restitution"])[used] @ test.weights[used]
            ),
        },
        "control": control and {"value": control.value, "u": control.u},
        "as_found": None if plain else _as_found(test, moved, lost, lost_u),
        "nominal_speed_mph": rules["ball_speed"] / MPH,
        "nominal_bat_speed_mph": rules.get("bat_speed", 0.0) / MPH,
        "v_rel_mph": float(best["relative"][used].mean() / MPH),
        "impact_position_in": test.place / INCH,
        "width_m": test.width(metric),
        "swing_range": [
            _swing(test, moved, each) for each in rules.get("game", {}).get("exponents", ())
        ],
        "places": [_place(test, metric, at) for at in sorted(set(test.set[test.valid]))]
        if "scan" in rules
        else [],
        # an exempt bat has no verdict by the limit
        "marginal": limit is not None
        and not (rules.get("eligibility") and test.construction == "one-piece wood")
        and result.interval[0] <= limit <= result.interval[1],
        "valid_hits": int(test.valid.sum()),
        "reasons": test.reasons,
        "shots": [_shot(test, metric, n) for n in range(len(metric))],
        "rebound_check": check,
        "choice": {"correction": lost, "u": lost_u} if lost_u else None,
        "budget": {
            line.name: {
                "value": line.value,
                "u": line.u,
                "evaluation": line.kind,
                "dof": line.dof,
                "sensitivity": line.sensitivity,
                "contribution": abs(line.moved),
                "share_percent": 100 * line.moved**2 / total,
            }
            for line in result.lines
        },
        "readings": _readings(test, metric),
    }


def _as_found(
    test: Test, moved: dict[str, tuple[Row, Row]], lost: float, lost_u: float
) -> dict[str, float]:
    """Return the metric before the correction for the balls, and its u."""
    of = test.result(
        lambda found: test.metric(found, corrected=False), moved, test.weights, test.effects
    )
    return {"value": of.value + lost, "u": sqrt(of.u**2 + lost_u**2)}


def _swing(test: Test, moved: dict[str, tuple[Row, Row]], exponent: float) -> Row:
    hits = test.metric(test.best, exponent)
    weights, _, place = test._outcome(hits)
    of = test.result(lambda found: test.metric(found, exponent), moved, weights, weights)
    return {
        "exponent": exponent,
        "value": of.value,
        "u": of.u,
        "interval_95": of.interval,
        "impact_position_in": place / INCH,
    }


def _place(test: Test, metric: np.ndarray, at: float) -> Row:
    hits = metric[test.valid & (test.set == at)]
    n, mean = len(hits), sum(hits) / len(hits)
    s = sqrt(sum((each - mean) ** 2 for each in hits) / (n - 1)) if n > 1 else None
    return {"impact_position_in": at / INCH, "hits": n, "mean": mean, "s": s}


def _shot(test: Test, metric: np.ndarray, n: int) -> Row:
    best = test.best
    turned, swung = test.encoder is not None, test.swing is not None
    return {
        "shot": n,
        "ball": int(test.ball[n]),
        "impact_position_in": test.set[n] / INCH,
        "speed_mph": best["speed"][n] / MPH,
        "bat_speed_mph": best["bat_speed"][n] / MPH if swung else None,
        "recoil_rad_per_s": best["rate"][n] if turned else None,
        "recoil_efficiency": best["recoiled"][n] if turned else None,
        "rebound_efficiency": best["rebound"][n],
        "value": metric[n],
        "used": bool(test.weights[n]),
    }


def _speed_u(distances: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Return u of the balls' speeds from the scatter of their times about a line."""
    seen = times[np.isfinite(times).all(axis=1)]
    left = np.array([t - np.polyval(np.polyfit(distances, t, 1), distances) for t in seen])
    left -= left.mean(axis=0)  # an error of the gates' positions shifts all balls equally
    noise = left.ravel() @ left.ravel() / ((distances.size - 2) * (len(seen) - 1))
    speed = (distances[0] - distances[-1]) / (times[:, 0] - times[:, -1])
    return speed**2 * np.sqrt(noise / (distances.size * distances.var()))


def _readings(test: Test, metric: np.ndarray) -> dict[str, np.ndarray]:
    """Return the columns of ``readings.csv`` that are numbers."""
    best, times = test.best, test.times
    speed = test.rules["metric"] == "batted_speed"
    columns = {
        "ball": test.ball,
        "ball_mass_oz": best["mass"] / OUNCE,
        "impact_position_in": test.set / INCH,
        "gate_time_in_us": 1e6 * (times[:, 0, -1] - times[:, 0, 0]),
        "gate_time_out_us": 1e6 * (times[:, 1, 0] - times[:, 1, -1]),
        "speed_mph": best["speed"] / MPH,
        "rebound_speed_mph": best["back"] / MPH,
        "collision_efficiency": best["e_a"],
        "rebound_efficiency": best["rebound"],
        "recoil_factor": best["r"],
        "restitution": best["e"],
        "ball_restitution": best["e0"],
        "bat_performance_factor": best["bat_performance_factor"],
        f"metric_{test.rules['metric']}{'_m_per_s' if speed else ''}": metric,
        "weight": test.weights,
        "used": test.weights != 0,
        "valid": test.valid,
    }
    gates = times.shape[2]
    if gates > 2:
        far = np.array([test.known[f"impact.gates.distance_{k}"].value for k in range(gates)])
        for way, name in enumerate(("speed_u_mph", "rebound_speed_u_mph")):
            columns[name] = np.abs(_speed_u(far, times[:, way])) / MPH
    for name, record in (("encoder", test.encoder), ("swing", test.swing)):
        if record is not None:
            columns[f"{name}_counts_per_s"] = record["counts_per_s"]
            columns[f"{name}_u_counts_per_s"] = record["u_counts_per_s"]
    if test.encoder is not None:
        columns["recoil_rad_per_s"] = best["rate"]
        columns["recoil_efficiency"] = best["recoiled"]
    if test.swing is not None:
        columns["bat_speed_mph"] = best["bat_speed"] / MPH
    return columns


if __name__ == "__main__":
    np.set_printoptions(linewidth=150)
    for name, value in worked(Path(sys.argv[1])).items():
        print(name, value)
