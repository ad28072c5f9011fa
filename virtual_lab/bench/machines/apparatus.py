"""The apparatus: the machines of one laboratory, which carry out actions and produce readings.

On the bench only this module, `checks`, `firing` and `sketching` know the truth. A reading depends
only on the laboratory and on the entries before the action, so a day can be continued from its log
or replayed with another action. The random numbers of a reading or shot depend on its number, not
on the order of the actions.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from math import sqrt
from typing import Any, NamedTuple

import numpy as np

from virtual_lab.bench.day.actions import Action
from virtual_lab.bench.day.arguments import LENGTHS, MASSES
from virtual_lab.bench.day.day import Day, DayEvent, Display, evolve
from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.entries import entry_of_record
from virtual_lab.bench.day.protocol import checklist
from virtual_lab.bench.day.table import Consequences, action_table, channels, repairs
from virtual_lab.bench.machines.checks import CheckStandards, reopen_with, speed_ratio
from virtual_lab.bench.machines.firing import Firing, alter_instrument, specimen_at
from virtual_lab.bench.machines.sketching import sketch_of
from virtual_lab.errors import InputError
from virtual_lab.lab import BatTest, Laboratory, TestDay
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.rounding import decimals
from virtual_lab.records import REFERENCE_MASS, MassReadings, Record
from virtual_lab.records.session import entry_of_constant
from virtual_lab.simulation.faults import FaultSet
from virtual_lab.simulation.faults.fault import instrument_of, with_sheet
from virtual_lab.simulation.instruments.indicator import quantise
from virtual_lab.simulation.physics.beam import Free
from virtual_lab.simulation.physics.modes import modes_of
from virtual_lab.simulation.stations.rig import RigOutput, ShotPlan, Stage, Station
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DEGREE, Array

MILLIMETRE, GRAM = 1e-3, 1e-3


class Reading(NamedTuple):
    """Result of an action: records by channel, values on the display, changed constants, sketch."""

    records: Mapping[str, Record] = {}
    shown: Display = ()
    constants: Mapping[str, Estimate] = {}
    sketch: Mapping[str, Any] = {}


@dataclass(frozen=True)
class Apparatus:
    """The machines of one laboratory, and the specimens on them."""

    laboratory: Laboratory

    # cache: machines by the set of repaired faults
    machines_by_repairs: dict[frozenset[str], Apparatus] = field(default_factory=dict)

    def at(self, day: Day) -> Apparatus:
        """Return the machines after the repairs of a day, that is without the repaired faults."""
        setup = self.laboratory.setup
        repaired = day.repaired_faults & set(setup.faults.names)
        if not repaired:
            return self
        if repaired not in self.machines_by_repairs:
            faults_left = tuple(
                fault for fault in setup.faults.faults if fault.name not in repaired
            )
            laboratory = self.laboratory
            self.machines_by_repairs[repaired] = Apparatus(
                reopen_with(laboratory, FaultSet(faults=faults_left))
            )
        return self.machines_by_repairs[repaired]

    @cached_property
    def firing(self) -> Firing:
        return Firing(self.laboratory)

    def shots(self, day: Day) -> list[tuple[ShotPlan, RigOutput]]:
        """Return plan and output of each shot of a day, fired by the machines as they were then."""
        before, shots = day.until(0), []
        for event in day.events:
            if event.action == "fire":
                firing = self.at(before).firing
                shots.append(firing.shot(firing.conditions(before)))
            before = evolve(before, event)
        return shots

    @cached_property
    def checks(self) -> CheckStandards:
        return CheckStandards(self.laboratory)

    def play(self, day: Day, action: Action) -> DayEvent:
        """Carry out an action that `decide` allowed. Return its event, whose price is still 0."""
        read = self.at(day)._actions.get(action.name)
        reading = read(day, action) if read else Reading()
        if action.name in repairs():
            reading = self._repair(day, action)
        return DayEvent(
            number=len(day.events) + 1,
            action=action.name,
            arguments=dict(action.arguments),
            seconds=0.0,
            records={name: entry_of_record(record) for name, record in reading.records.items()},
            shown=reading.shown,
            constants={
                key: entry_of_constant(estimate) for key, estimate in reading.constants.items()
            },
            sketch=reading.sketch,
        )

    def finish(self, desk: Desk) -> BatTest:
        """Return the completed test of a day, with its truth, for the certificate and the seal.

        Raises `InputError` with the name of a missing record.
        """
        day, machines = desk.day, self.at(desk.day)
        laboratory = machines.laboratory
        wall = machines.firing.wall(day.times("hit-wall") - 1)
        balls = replace(machines.firing.balls(day), used=desk.preparation.used[0, 0])
        plans, rounds = zip(*self.shots(day), strict=True)
        test_day = TestDay(
            laboratory=replace(laboratory, specimen=replace(laboratory.specimen, balls=balls)),
            sessions=desk.block,
            bench=machines._bench(laboratory),
            wall=wall,
            preparation=desk.preparation,
            plans=plans,
            rounds=rounds,
            reduced=desk.reduced,
            readings=desk.readings,
        )
        return test_day.finish_with(desk.block).of(0)

    @property
    def _table(self) -> Consequences:
        return action_table().consequences

    @cached_property
    def _actions(self) -> Mapping[str, Callable[[Day, Action], Reading]]:
        return {
            **dict.fromkeys(channels(), self._measure),
            "weigh-check-mass": self._check_mass,
            "reweigh-balls": self._reweigh_balls,
            "swing-clamp": self._swing_clamp,
            "gauge-balls": self._gauge_balls,
            "tap-bat": self._tap,
            "hit-wall": self._hit_wall,
            "recheck-balls": self._recheck_balls,
            "measure-pivot": self._measure_pivot,
            "compare-clock": self._standard(self.checks.clock),
            "fire-check-ball": self._standard(self.checks.ball),
            "gauge-gates": self._gauge_gates,
            "fire-check-cylinder": self._standard(self.checks.cylinder),
            "aim-paper": self._aim_paper,
            "re-aim": self._re_aim,
            "fire": self._fire,
            "reduce": self._reduce,
            "enter-result": self._enter_result,
            "start-checklist": lambda day, _: Reading(shown=checklist(day, end=False)),
            "end-checklist": lambda day, _: Reading(shown=checklist(day, end=True)),
        }

    def _repair(self, day: Day, action: Action) -> Reading:
        """Return the rows to display after a repair: its outcome, and the readings to repeat."""
        sheets = action_table().actions
        faults = set(self.laboratory.setup.faults.names) - day.repaired_faults
        finding = "repaired" if faults & set(sheets[action.name].mends) else "nothing was broken"
        readings = "; ".join(sheets[name].title for name in sheets[action.name].again)
        return Reading(
            shown=(
                ("repair", finding, ""),
                *((("measure again", readings, ""),) if readings else ()),
            )
        )

    def _standard(self, check: Callable[[int], Display]) -> Callable[[Day, Action], Reading]:
        """Return the action that uses a check standard; `check` gets the number of earlier uses."""
        return lambda day, action: Reading(shown=check(day.times(action.name)))

    # the bench

    def _measure(self, day: Day, action: Action) -> Reading:
        """Read one channel of the bench, with as many repeats as its data sheet states.

        A repeated measurement gets new random errors.
        """
        channel, arguments = channels()[action.name], action.arguments
        earlier = day.times(action.name)
        station: Any = self.laboratory.stations[Stage.BENCH]
        spec = station.spec
        station = self._actual_scale(day, station)
        if not day.level:
            station = alter_instrument(
                station, "stand", offset=station.stand.true["offset"] + self._table.unlevel
            )
        if not day.clamped:
            station = alter_instrument(station, "pendulum", clamp_inertia=0.0, clamp_moment=0.0)
        if action.name == "swing":
            station = _set_swing(station, arguments, self._table)
        turns = earlier + 1
        more = replace(spec, repeats=spec.repeats * turns, releases=spec.releases * turns)
        stations = {**self.laboratory.stations, Stage.BENCH: replace(station, spec=more)}
        records = self._bench(replace(self.laboratory, stations=stations)).records
        record: Any = records[channel]
        with_balls = ("store", REFERENCE_MASS) if channel == "ball-mass" else ()
        companions = ("climate", *with_balls)
        extra = {name: records[name] for name in companions if name in records}
        if action.name == "swing":
            new = slice(spec.releases * earlier, None)
            record = replace(
                record,
                times=record.times[new],
                first_amplitude=record.first_amplitude[new],
                last_amplitude=record.last_amplitude[new],
            )
            durations = record.times[:, -1] - record.times[:, 0]
            return Reading({channel: record} | extra, _number_rows("release", durations, "s"))
        readings = record.readings[:, spec.repeats * earlier :]
        if arguments.get("end") == "knob":
            readings = self._length - readings
        unit, display = ("g", GRAM) if channel.endswith("mass") else ("mm", MILLIMETRE)
        unit_factor = (MASSES if unit == "g" else LENGTHS)[str(arguments["entered_as"])] / display
        words = "ball" if channel == "ball-mass" else "reading"
        means = readings.mean(axis=1) if words == "ball" else readings[0]
        return Reading(
            {channel: replace(record, readings=readings * unit_factor)} | extra,
            _number_rows(words, means / display, unit),
        )

    def _bench(self, laboratory: Laboratory) -> RigOutput:
        balls = np.arange(laboratory.rules.spec.balls)
        nothing = np.full(balls.shape, np.nan)
        plan = ShotPlan(slot=balls, ball=balls, speed=nothing, place=nothing)
        return laboratory.play(Stage.BENCH, plan)

    @cached_property
    def _length(self) -> float:
        return float(self._bench(self.laboratory).truth["length"])

    def _actual_scale(self, day: Day, station: Station) -> Station:
        if day.tared:
            return station
        scale: Any = station
        crept = self._table.untared * float(self.laboratory.draws.normal("rehearsal.tare"))
        return alter_instrument(station, "scale", zero=scale.scale.true["zero"] + crept)

    def _check_mass(self, day: Day, action: Action) -> Reading:
        mass = self._table.check_mass
        readings = self._weigh(day, action, mass, "rehearsal.check-mass")[0]
        certified = ("certified", mass / GRAM, "g")
        return Reading(shown=(*_number_rows("reading", readings / GRAM, "g"), certified))

    def _reweigh_balls(self, day: Day, action: Action) -> Reading:
        """Weigh some balls again. Show the readings beside the values that were entered."""
        entered = Desk(day).session.records.get("bench", {}).get("ball-mass")
        if not isinstance(entered, MassReadings):
            raise InputError(
                action.name, "balls", None, "have no masses yet: weigh-balls comes first"
            )
        balls = np.arange(self._table.balls_again)
        mass = self.laboratory.specimen.balls.mass[balls]
        readings = self._weigh(day, action, mass, "rehearsal.reweigh", balls)
        return Reading(
            shown=_pair_rows(
                ("on the display", readings.mean(axis=1) / GRAM),
                ("as entered", entered.readings[balls].mean(axis=1) / GRAM),
                "g",
            )
        )

    def _weigh(self, day: Day, action: Action, mass: Any, stream: str, *slots: Any) -> Array:
        """Return new readings of the scale [kg], shape (item, repeat); `mass` is the true mass."""
        station: Any = self._actual_scale(day, self.laboratory.stations[Stage.BENCH])
        repeats, earlier = station.spec.repeats, day.times(action.name)
        draws, turns = self.laboratory.draws, earlier + 1
        record = station.scale.weigh(mass, repeats * turns, draws, stream, *slots)
        return np.asarray(record.readings[:, repeats * earlier :])

    def _swing_clamp(self, day: Day, action: Action) -> Reading:
        """Measure the moment of inertia of the clamp, and use it if the trainee chose so."""
        station: Any = self.laboratory.stations[Stage.BENCH]
        error = self._table.clamp_u * self._reading_error(day, action)
        measured = station.pendulum.true["clamp_inertia"] + error
        entered = day.morning.calibration["bench.pendulum.clamp_inertia"].value
        estimate = Estimate(
            value=round(float(measured), 8), u=self._table.clamp_u, source="swung alone, on the day"
        )
        use = action.arguments["use"] == "measured"
        return Reading(
            constants={"bench.pendulum.clamp_inertia": estimate} if use else {},
            shown=tuple(
                (f"clamp, {word}", round(float(inertia) * 1e6, 1), "kg mm²")
                for word, inertia in (("measured", measured), ("as entered", entered))
            ),
        )

    def _reading_error(self, day: Day, action: Action) -> float:
        """Return the error of a manual reading, in standard uncertainties."""
        number = np.array([day.times(action.name)])
        return float(self.laboratory.draws.normal(f"rehearsal.{action.name}", slots=number)[0])

    def _gauge_balls(self, day: Day, action: Action) -> Reading:
        balls = specimen_at(Stage.IMPACT, self.laboratory).balls
        slots = np.arange(balls.mass.size) + balls.mass.size * day.times(action.name)
        errors = self.laboratory.draws.normal("rehearsal.gauge-balls", slots=slots)
        diameters = 2 * balls.spec.radius + self._table.ball_gauge_u * errors
        return Reading(shown=_number_rows("ball", np.round(diameters / MILLIMETRE, 2), "mm"))

    def _tap(self, day: Day, action: Action) -> Reading:
        """Show the first bending frequency of the bat [Hz] in its present condition."""
        bat = specimen_at(Stage.IMPACT if day.fired else Stage.BENCH, self.laboratory).bat
        frequency = float(modes_of(bat.body, Free(), 1).bending_frequencies[0])
        noise = self._table.tap_u * self._reading_error(day, action)
        return Reading(shown=(("first bending frequency", round(frequency + noise, 1), "Hz"),))

    # the wall

    def _hit_wall(self, day: Day, action: Action) -> Reading:
        play = self.firing.wall(day.times(action.name))
        means = np.round(_ratios(play, day.balls), 4)
        return Reading(play.records, _number_rows("ball", means, "rebound speed / incoming speed"))

    def _recheck_balls(self, day: Day, action: Action) -> Reading:
        """Fire some balls at the wall again. Show the speed ratios beside the earlier ones."""
        morning = Desk(day).last("hit-wall")
        if morning is None:
            raise InputError(action.name, "balls", None, "have no e0 yet: hit-wall comes first")
        count = self._table.balls_again
        play = self.firing.wall_again(day, count, day.times(action.name))
        return Reading(
            shown=_pair_rows(
                ("now", np.round(_ratios(play, count), 4)),
                ("before", np.array([value for _, value, _ in morning.shown[:count]])),
                "rebound speed / incoming speed",
            )
        )

    # the impact rig

    def _measure_pivot(self, day: Day, action: Action) -> Reading:
        pivot = instrument_of(self.laboratory.stations[Stage.IMPACT], "pivot")
        surveyed = day.morning.calibration["impact.pivot.from_knob"]
        error = self._table.pivot_rule_u * self._reading_error(day, action)
        measured = _millimetres("axis from the knob, measured", pivot.true["from_knob"] + error, 1)
        return Reading(
            shown=(measured, _millimetres("axis from the knob, surveyed", surveyed.value, 1))
        )

    def _gauge_gates(self, day: Day, action: Action) -> Reading:
        station: Any = self.laboratory.stations[Stage.IMPACT]
        gates = station.gates
        table, number = self._table, np.array([day.times(action.name)])
        errors = self.laboratory.draws.normal(
            "rehearsal.gauge-gates", gates.distances.size, number
        )[0]
        distances = quantise(gates.distances + table.gauge_u * errors, table.gauge_step)
        certified = [gates.stated[f"distance_{at}"].value for at in range(distances.size)]
        rows = [
            row
            for at, (gauged, stated) in enumerate(zip(distances, certified, strict=True))
            for row in (
                _millimetres(f"gate {at + 1}, gauged", gauged, 2),
                _millimetres(f"gate {at + 1}, certificate", stated, 2),
            )
        ]
        constants = {
            f"impact.gates.distance_{at}": Estimate(
                value=float(gauged), u=table.gauge_u, source="gauge bar, on the day"
            )
            for at, gauged in enumerate(distances)
        }
        used = constants if action.arguments["use"] == "gauge" else {}
        return Reading(shown=tuple(rows), constants=used)

    def _aim_paper(self, day: Day, action: Action) -> Reading:
        station: Any = self.firing.station_aimed_at(day.shift)
        stream, earlier = f"{self.laboratory.setup.rig}.aim", day.times(action.name)
        # the first aim paper equals that of a test without the bench
        marks = station.cannon.mark(
            self.laboratory.draws, f"{stream}.{earlier}" if earlier else stream
        )
        along = _millimetres("mean along", marks.along.mean(), 1)
        across = _millimetres("mean across", marks.across.mean(), 1)
        return Reading({"aim": marks}, (along, across))

    def _re_aim(self, day: Day, action: Action) -> Reading:
        """Move the aim. The session then contains the requested position, with a larger u."""
        aim = Desk(day).session.calibration.get("impact.cannon.along")
        if aim is None:
            return Reading()
        displacement = float(action.arguments["along"]) * MILLIMETRE
        u = sqrt(aim.u**2 + self._table.aim_setting**2)
        return Reading(
            constants={"impact.cannon.along": replace(aim, value=aim.value + displacement, u=u)}
        )

    def _fire(self, day: Day, _: Action) -> Reading:
        shot = self.firing.conditions(day)
        records = self.firing.shot(shot)[1].records
        return Reading(
            {name: record for name, record in records.items() if name != "aim"},
            sketch=sketch_of(self.firing, shot),
        )

    # the result

    def _reduce(self, day: Day, _: Action) -> Reading:
        """Reduce the accepted hits. Raises `InputError` with the name of a missing record."""
        desk = Desk(day)
        certification, rules = desk.certification, desk.rules.spec
        bat = tuple(("rule for the bat", each.sentence, "") for each in certification.findings)
        if certification.metric is None:
            return Reading(shown=(("no result", "; ".join(certification.reasons), ""), *bat))
        printed = METRICS[rules.metric]
        metric = certification.metric
        value, u = printed.in_unit(metric.value), printed.in_unit(metric.u)
        low, high = (f"{printed.in_unit(end):.{decimals(u)}f}" for end in metric.interval_95)
        rows: list[tuple[str, float | str, str]] = [
            (printed.words, float(f"{value:.4g}"), printed.unit),
            ("standard uncertainty", float(f"{u:.2g}"), printed.unit),
            ("95 % interval", f"{low} to {high}", printed.unit),
        ]
        if rules.metric_limit is not None:
            limit = printed.in_unit(rules.metric_limit)
            rows.append(("limit", f"{limit:.{printed.places}f}", printed.unit))
        return Reading(shown=(*rows, *bat))

    def _enter_result(self, day: Day, action: Action) -> Reading:
        """Show the entered results, compared with those of the records except in an exam."""
        results = Desk(day).entered_results(action.arguments)
        if not results:
            allowed = "is missing: enter at least one of r, e_A, e and BPF"
            raise InputError(action.name, "result", None, allowed)
        rows: list[tuple[str, float | str, str]] = []
        for each in results:
            rows.append((each.name, each.entered, ""))
            if day.exam:
                continue
            if each.deviation is None:
                word = "the records give no result yet"
            else:
                word = (
                    "agrees"
                    if each.agrees
                    else f"differs by {each.deviation:+.1f} standard uncertainties"
                )
            rows.append((f"{each.name}, compared with the records", word, ""))
        return Reading(shown=tuple(rows))


def _set_swing(station: Any, arguments: Mapping[str, Any], table: Consequences) -> Station:
    """Return the bench with the requested amplitude, number of swings and timing of the pendulum.

    A fault can enlarge the amplitude: it multiplies the requested one by the same ratio.
    """
    by_hand = (
        {"timer_jitter": table.hand_reaction, "timer_resolution": table.hand_step}
        if arguments["clock"] == "hand"
        else {}
    )
    # ratio to the amplitude without a fault
    ratio = station.pendulum.spec.release_amplitude / (4.0 * DEGREE)
    return with_sheet(
        station,
        "pendulum",
        release_amplitude=min(float(arguments["amplitude"]) * ratio, 90.0) * DEGREE,
        swings=int(arguments["swings"]),
        **by_hand,
    )


def _ratios(play: RigOutput, balls: int) -> Array:
    """Return the mean ratio of rebound to incoming speed at the wall, shape (ball,)."""
    log: Any = play.records["log"]
    ratio = speed_ratio(play.records["gates"])
    return np.array([np.nanmean(ratio[log.ball == ball]) for ball in range(balls)])


def _pair_rows(first: tuple[str, Array], second: tuple[str, Array], unit: str) -> Display:
    """Return two rows per ball for the display, one of each named array, shape (ball,)."""
    return tuple(
        (f"ball {ball}, {word}", float(f"{value:.7g}"), unit)
        for ball, values in enumerate(zip(first[1], second[1], strict=True), 1)
        for word, value in zip((first[0], second[0]), values, strict=True)
    )


def _millimetres(quantity: str, length: float, places: int) -> tuple[str, float, str]:
    return quantity, round(float(length) / MILLIMETRE, places), "mm"


def _number_rows(word: str, values: Any, unit: str) -> Display:
    return tuple(
        (f"{word} {number}", float(f"{value:.7g}"), unit)
        for number, value in enumerate(np.ravel(values), 1)
    )
