"""The catalog of faults: errors of people and documents, of timing, and of the machine."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import tau
from typing import Any

import numpy as np

from virtual_lab.records import BoardRecord
from virtual_lab.simulation.faults.fault import (
    Fault,
    FaultContext,
    change_constant,
    change_sheet,
    with_sheet,
)
from virtual_lab.simulation.stations.rig import ShotPlan, Specimen, Stage, Station
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.units import DEGREE, INCH, MPH, OUNCE

Arrays = Mapping[str, Any]


class Edge:
    """Indices into gate times, (shot, direction, gate, ..., edge)."""

    IN, OUT = 0, 1
    FIRST_GATE, LAST_GATE = 0, -1  # in the order from the cannon to the target
    BROKEN, CLEARED = 0, 1


FAR_SWING, USUAL_SWING = 20 * DEGREE, 4 * DEGREE  # amplitudes at which the pendulum is released
DAMP_ROOM = 0.75  # relative humidity of a room in which balls are kept by mistake
SCRAPS = 0.6  # share of the balls that are preceded by fragments of a bad sabot


def misread(factor: float) -> Callable[[Any, FaultContext], Arrays]:
    """Return a hook for `Fault.record` that multiplies each reading by `factor`.

    A hook is a function by which a fault changes a simulated test. This hook takes the record of an
    instrument, and the context of the fault, which it ignores. It returns a mapping with the key
    ``readings``, an array of the shape and unit of the readings in the record.
    """
    return lambda record, _: {"readings": record.readings * factor}


def from_knob(record: Any, context: FaultContext) -> Arrays:
    """Return readings of a bat's balance point that are wrongly measured from the knob [m].

    The result is a mapping with the key ``readings``, an array of the shape of the readings in the
    record. The laboratory uses these readings as distances from the tip.
    """
    return {"readings": float(context.play.truth["length"]) - record.readings}


def usual_amplitude(record: Any, _: FaultContext) -> Arrays:
    """Return amplitudes of a pendulum that an operator writes down from habit, not as read [rad].

    The result is a mapping with the keys ``first_amplitude`` and ``last_amplitude``, each with one
    value per release of the pendulum, (release,). The values are the recorded amplitudes times
    `USUAL_SWING` / `FAR_SWING`, which is below 1.
    """
    ends = ("first_amplitude", "last_amplitude")
    return {end: getattr(record, end) * (USUAL_SWING / FAR_SWING) for end in ends}


def clamp_forgotten(constants: Mapping[str, Estimate]) -> Mapping[str, Estimate]:
    """Return the calibration with a value of 0 for the moment of inertia of the pendulum's clamp.

    The uncertainty of this value and all other constants are unchanged. Raises `KeyError` if the
    calibration does not have this constant.
    """
    key = "bench.pendulum.clamp_inertia"
    return {**constants, key: replace(constants[key], value=0.0)}


def livelier(specimen: Specimen) -> Specimen:
    """Return a copy of the specimen in which the ball-wall restitution e0 is 0.02 higher.

    All balls are changed. The fault ``wrong-lot`` uses the changed balls for the hits at the bat.
    The wall test of e0 is made with the original balls.
    """
    balls = specimen.balls
    return replace(specimen, balls=replace(balls, restitution=balls.restitution + 0.02))


def not_conditioned(specimen: Specimen) -> Specimen:
    """Return a copy of the specimen in which the balls were kept in a damp room.

    The relative humidity of the room is 75 %. If the ball-wall restitution of the balls does not
    depend on the humidity, they are unchanged.
    """
    return replace(specimen, balls=specimen.balls.after_storage(DAMP_ROOM))


def worn_out(specimen: Specimen) -> Specimen:
    """Return a copy of the specimen in which ball 3, counted from 0, is worn.

    Its ball-wall restitution e0 is 0.04 lower. The specimen must belong to one laboratory; a
    specimen of a block of laboratories is not allowed. Raises `IndexError` if it has fewer than
    four balls.
    """
    restitution = specimen.balls.restitution.copy()
    restitution[3] -= 0.04
    return replace(specimen, balls=replace(specimen.balls, restitution=restitution))


def crack(specimen: Specimen) -> Specimen:
    """Return a copy of the specimen with a cracked bat: its elastic moduli are 10 % lower.

    The frequencies of its bending modes are therefore 5 % lower.
    """
    bat, share = specimen.bat, 0.9
    material = replace(
        bat.body.material,
        youngs_modulus=bat.body.material.youngs_modulus * share,
        shear_modulus=bat.body.material.shear_modulus * share,
    )
    return replace(specimen, bat=replace(bat, bodies=(replace(bat.body, material=material),)))


def out_of_round(record: Any, context: FaultContext) -> Arrays:
    """Return the gate times of balls that are out of round by up to 1.5 mm.

    The front and the back radius of a ball differ, and both change from gate to gate. Therefore the
    ball breaks and clears a beam early or late. If the ball only grazes a beam, it can miss it;
    both times are then NaN. `record` is the gates' record without the fault. `context` holds
    station, plan and random numbers. The result is a mapping with the key ``times`` [s], an array
    of the shape of the times in the record.
    """
    times, truth = record.times, context.play.truth
    speed = truth["speed"]
    rebound_speed = truth.get("rebound_speed", truth.get("ball_restitution", 0) * speed)
    speeds = np.stack([speed, np.abs(rebound_speed)], axis=1)[:, :, None, None]
    shape = (*times.shape[1:3], 2)
    turn = tau * (context.chance(f".{context.stage.value}", shape) - 0.5)
    delay = 1.5e-3 * np.sin(turn) * np.array([-1.0, 1.0]) / speeds
    beams = times.ndim - delay.ndim
    times = times + delay.reshape(*delay.shape[:3], *(1,) * beams, 2)
    times[times[..., Edge.CLEARED] <= times[..., Edge.BROKEN]] = np.nan
    return {"times": times}


def swap(record: Any, context: FaultContext) -> Arrays:
    """Return the gate times after an exchange of shots 1 and 4, counted from 0.

    The times are unchanged if the plan does not contain both shots. `record` is the gates' record
    without the fault. `context` holds station, plan and random numbers. The result is a
    mapping with the key ``times`` [s], an array of the shape of the times in the record.
    """
    slot = context.plan.slot
    first, second = (np.flatnonzero(slot == shot) for shot in (1, 4))
    filed = np.arange(len(slot))
    if first.size and second.size:
        filed[first], filed[second] = second, first
    return {"times": record.times[filed]}


def every_second_missed(record: Any, context: FaultContext) -> Arrays:
    """Return gate times in which the gate nearest the bat misses every second incoming ball.

    The times of this gate are NaN for the incoming balls of shots 1, 3, 5, …, counted from 0.
    `record` is the gates' record without the fault. `context` holds station, plan and random
    numbers. The result is a mapping with the key ``times`` [s], an array of the shape of the times
    in the record.
    """
    times = record.times.copy()
    times[context.plan.slot % 2 == 1, Edge.IN, Edge.LAST_GATE] = np.nan
    return {"times": times}


def cleared_twice(record: Any, context: FaultContext) -> Arrays:
    """Return gate times with a late end of some passages at the gate nearest the bat.

    In about 60 % of the shots, the gate reports twice that the incoming ball left the beam. Only
    the second report is recorded. It is 0.4 ms late.

    Parameters
    ----------
    record
        Record of the gates without the fault.
    context
        Context of the record: station, plan and random numbers.

    Returns
    -------
    Arrays
        A mapping with the key ``times`` [s]. Its array has the shape of the times in the record.
    """
    times = record.times.copy()
    times[context.random_mask(0.6), Edge.IN, Edge.LAST_GATE, ..., Edge.CLEARED] += 0.4e-3
    return {"times": times}


def scraps_of_beams(station: Station) -> Station:
    """Return the station with sabot fragments that fly ahead of 60 % of the balls.

    The fragments break beams of the light boards. A station without light boards is returned
    unchanged.
    """
    return change_sheet("gates", sabot_rate=SCRAPS)(station) or station


def scraps_ahead(record: Any, context: FaultContext) -> Arrays:
    """Return gate times in which sabot fragments break the beam of the first gate before the ball.

    `record` is the gates' record without the fault. `context` holds station, plan and random
    numbers. A sabot is the carrier in which the cannon fires the ball. In about 60 % of the shots,
    fragments of the sabot fly 30 mm ahead of the ball. The result is a mapping with the key
    ``times`` [s], an array of the shape of the times in the record. For light boards the mapping is
    empty; the simulation of the boards includes the fragments.
    """
    if isinstance(record, BoardRecord):
        return {}
    times, struck = record.times.copy(), context.random_mask(SCRAPS)
    times[struck, Edge.IN, Edge.FIRST_GATE, Edge.BROKEN] -= (
        0.03 / context.play.truth["speed"][struck]
    )
    return {"times": times}


def drifting(record: Any, context: FaultContext) -> Arrays:
    """Return the gate times of the wall test, with rebound speeds that rise from hit to hit.

    The apparent ball-wall restitution e0 rises by 6 % from the first to the last hit of the plan.
    `record` is the gates' record without the fault. `context` holds station, plan and random
    numbers. The result is a mapping with the key ``times`` [s], an array of the shape of the times
    in the record.
    """
    times, slot = record.times.copy(), context.plan.slot
    rebounds = times[:, Edge.OUT]
    start = rebounds[:, Edge.LAST_GATE, Edge.BROKEN][:, None, None]
    progress = (slot - slot.min()) / max(np.ptp(slot), 1)  # share of the wall check of this box
    faster = (1 + 0.06 * progress)[:, None, None]
    times[:, Edge.OUT] = start + (rebounds - start) / faster
    return {"times": times}


def too_slow(plan: ShotPlan) -> ShotPlan:
    """Return the plan with all nominal speeds 3 mph (1.34 m/s) lower."""
    return replace(plan, speed=plan.speed - 3 * MPH)


def slipping(record: Any, context: FaultContext) -> Arrays:
    """Return the counts of an encoder with a coupling that slips in about 60 % of the shots.

    In such a shot the encoder loses 20 counts at a random time. `record` is the encoder's record
    without the fault. `context` holds station, plan and random numbers. The result is a
    mapping with the key ``counts``, an array (shot, sample).
    """
    samples = record.counts.shape[1]
    when = 0.3 + 0.6 * context.chance(".when")
    slipped = np.arange(samples) > samples * when[:, None]
    return {"counts": record.counts - 20.0 * (slipped & context.random_mask(0.6)[:, None])}


def loose(record: Any, context: FaultContext) -> Arrays:
    """Return the encoder counts if the bat has a play of 0.3 degrees in its clamp.

    The encoder follows the bat only beyond this play. `record` is the encoder's record without the
    fault. `context` holds station, plan and random numbers. The result is a mapping with
    the key ``counts``, an array (shot, sample). Raises `KeyError` for a station without an encoder.
    """
    counts = record.counts
    width = np.round(0.3 / 360 * counts_per_turn(context))
    with_play = np.empty_like(counts)
    last = counts[:, 0]
    for sample in range(counts.shape[1]):
        last = np.clip(last, counts[:, sample] - width, counts[:, sample])
        with_play[:, sample] = last
    return {"counts": with_play}


def still_swinging(record: Any, context: FaultContext) -> Arrays:
    """Return the encoder counts for a bat that still swings at 0.3 rad/s when the ball is fired.

    `record` is the encoder's record without the fault. `context` holds station, plan and random
    numbers. The direction of the swing is random from shot to shot. The result is a mapping with
    the key ``counts``, an array (shot, sample). Raises `KeyError` for a station without an encoder.
    """
    direction = np.where(context.random_mask(0.5), 1.0, -1.0)
    rotation = counts_per_turn(context) / tau * 0.3 * record.times
    return {"counts": record.counts + np.round(direction[:, None] * rotation)}


def counts_per_turn(context: FaultContext) -> float:
    """Return the counts per turn of the encoder according to the calibration of the laboratory.

    Raises `KeyError` if the station of the `context` has no encoder.
    """
    return context.station.calibration["encoder.counts_per_turn"].value


def _at_bench(name: str, channel: str, record: Callable[[Any, FaultContext], Arrays]) -> Fault:
    return Fault(name=name, stage=Stage.BENCH, channel=channel, record=record)


def _at_bat(name: str, channel: str, record: Callable[[Any, FaultContext], Arrays]) -> Fault:
    return Fault(name=name, channel=channel, record=record)


CATALOGUE: Mapping[str, Fault] = {
    fault.name: fault
    for fault in (
        # The recorder's clock is fast, far beyond the limit of its data sheet.
        Fault(name="gate-clock", station=change_constant("gates", "clock", times=1 + 100e-6)),
        _at_bat("gate-doubles", "gates", cleared_twice),
        _at_bat("gate-misses", "gates", every_second_missed),
        # The gate nearest the bat was moved toward the cannon after its survey.
        Fault(name="gate-moved", station=change_constant("gates", "distance", plus=1e-3)),
        Fault(name="sabot-trip", station=scraps_of_beams, channel="gates", record=scraps_ahead),
        Fault(name="wall-drift", stage=Stage.BALLS, channel="gates", record=drifting),
        # The aim is above the bat's axis, or too far from its tip.
        Fault(name="aim-across", station=change_constant("cannon", "across", plus=0.3 * INCH)),
        Fault(name="aim-along", station=change_constant("cannon", "along", plus=0.5 * INCH)),
        _at_bat("bat-not-at-rest", "encoder", still_swinging),
        # A dry bearing has a drag torque [N m], and under the impact the friction of a plain
        # bearing.
        Fault(
            name="bearing-friction",
            station=change_sheet("pivot", constant_torque=1.0, friction=0.1),
        ),
        Fault(name="cannon-slow", plan=too_slow),
        # The encoder has half the counts per turn of its data sheet.
        Fault(name="encoder-half-counts", station=change_constant("encoder", "scale", times=0.5)),
        _at_bat("encoder-play", "encoder", loose),
        _at_bat("encoder-slip", "encoder", slipping),
        Fault(name="pivot-off", station=change_constant("pivot", "from_knob", plus=5e-3)),
        # Errors of people and documents.
        _at_bench("balance-from-knob", "balance", from_knob),
        # Two digits were transposed: 5.152 oz for 5.125 oz.
        _at_bench("ball-mass-typed", "ball-mass", misread(5.152 / 5.125)),
        Fault(name="ball-out-of-round", stage=None, channel="gates", record=out_of_round),
        Fault(name="ball-worn-out", stage=None, specimen=worn_out),
        Fault(name="balls-not-conditioned", stage=None, specimen=not_conditioned),
        Fault(name="bat-cracked", specimen=crack),
        Fault(name="clamp-forgotten", stage=None, calibration=clamp_forgotten),
        # The scale showed ounces, which were entered as grams.
        _at_bench("ounces-as-grams", "ball-mass", misread(1e-3 / OUNCE)),
        _at_bench("bat-ounces-as-grams", "bat-mass", misread(1e-3 / OUNCE)),
        Fault(
            name="pendulum-wide",
            stage=Stage.BENCH,
            station=lambda bench: with_sheet(bench, "pendulum", release_amplitude=FAR_SWING),
            channel="pendulum",
            record=usual_amplitude,
        ),
        _at_bat("records-swapped", "gates", swap),
        # A dish of 2 g was left on the scale when bat and balls were weighed.
        Fault(
            name="scale-not-tared",
            stage=Stage.BENCH,
            station=change_constant("scale", "zero", plus=2e-3),
        ),
        Fault(name="wrong-lot", specimen=livelier),
    )
}
