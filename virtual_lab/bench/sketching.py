"""What is handed over of a shot as seen from above: what happened in kind, its numbers blurred.

An animation drawn to 5 mm would give e_A to 0.0003. So the rebound is off by a draw of the day
and one of the shot, which no number of shots averages out, and the bat's turn by another. After
the day is handed in, `plan_of_shot` gives the shot as it was.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from virtual_lab.bench.day import Day, evolve
from virtual_lab.bench.firing import Firing, ShotConditions
from virtual_lab.bench.slow_motion import Motion, contact_words
from virtual_lab.simulation.cannon_station import RestingBatStation
from virtual_lab.simulation.flights import RestingBat, Surroundings, scene_of
from virtual_lab.simulation.motion import play
from virtual_lab.simulation.motion.played import PlanView, plan_view
from virtual_lab.simulation.physics.beam import beam_of
from virtual_lab.simulation.rig import Stage

__all__ = ["REBOUND_BLUR", "TURN_BLUR", "blurred", "plan_of_shot", "sketch_of", "true_motion"]

REBOUND_BLUR = (0.03, 0.03)  # standard deviation of e_A: of a day, of a shot
TURN_BLUR = (0.1, 0.1)  # of the bat's turn, as a share: of a day, of a shot
WATCHED = 0.15  # s after the contact, as long as an encoder writes
LONGER = 0.5  # s, of a ball that meets more than the bat
SQUARE = 0.008  # m off the bat's axis, within which a ball is seen to come straight back


def sketch_of(firing: Firing, shot: ShotConditions) -> dict[str, Any]:
    """Return the sketch of a shot, in the form of JSON.

    `struck`, what was struck in turn, nothing by a ball that never came; and of one that met the
    bat `way` and `side`, to which it then flew, `rebound`, e_A, and `turn`, the rate that the blow
    gave the bat [rad/s], both blurred.
    """
    if shot not in firing.sketches:
        firing.sketches[shot] = _sketched(firing, shot)
    return firing.sketches[shot]


def _sketched(firing: Firing, shot: ShotConditions) -> dict[str, Any]:
    truth = firing.shot(shot)[1].truth
    efficiency, across = (float(truth[name][0]) for name in ("collision_efficiency", "across"))
    met = bool(np.isfinite(efficiency))
    seen = plan_of_shot(firing, shot)
    others = {contact.struck: None for contact in seen.contacts} if seen else {}
    struck = [*others] or ["bat"] * met
    if not met:
        return {"struck": struck}
    side = "straight" if abs(across) < SQUARE else "up" if across > 0 else "down"
    way = "back" if truth["rebound_speed"][0] > 0 else "on"
    rebound, turn = blurred(firing, shot, efficiency)
    return {"struck": struck, "way": way, "side": side, "rebound": rebound, "turn": turn}


def blurred(firing: Firing, shot: ShotConditions, efficiency: float) -> tuple[float, float]:
    """Return e_A and the rate of the bat [rad/s] as an eye would have them."""
    draws = firing.laboratory.draws
    day = draws.normal("rehearsal.sketch-day", 2)
    own = draws.normal("rehearsal.sketch", 2, np.array([shot.shot]))[0]
    off = REBOUND_BLUR[0] * day[0] + REBOUND_BLUR[1] * own[0]
    share = TURN_BLUR[0] * day[1] + TURN_BLUR[1] * own[1]
    specimen, rules = firing.laboratory.specimen, firing.laboratory.rules.spec
    body = specimen.bat.body
    axis = body.length - rules.pivot_from_knob
    lever = axis - shot.place
    closing = rules.ball_speed + shot.turn_rate * lever
    blow = specimen.balls.spec.mass * closing * (1 + efficiency)
    rate = blow * lever / beam_of(body).inertia(axis) * (1 + share)
    return round(float(efficiency + off), 2), round(float(rate), 1)


def plan_of_shot(firing: Firing, shot: ShotConditions) -> PlanView | None:
    """Return a shot at a bat at rest as it was; None at other rigs, or where no scene plays it."""
    laboratory, asked = firing.as_it_stands(shot)
    station = laboratory.stations[Stage.IMPACT]
    if not isinstance(station, RestingBatStation):
        return None
    order, specimen = laboratory.setup.faults.done(Stage.IMPACT, asked, laboratory.specimen)
    fired = station.fly(order, specimen, laboratory.draws)
    body = specimen.bat.body
    bat = RestingBat(
        body,
        body.length - station.holder.from_knob,
        fired.place,
        fired.across,
        fired.blows.efficiency,
        specimen.balls.mass[order.ball],
    )
    view = station.gates.spec.view(specimen.balls.spec.radius)
    around = Surroundings(station.frame, station.stop, station.gates.distances, view)
    more = fired.flown.kicks or not np.all(fired.flown.met) or np.any(fired.flown.late)
    scene = scene_of(fired.passage, bat, around, LONGER if more else WATCHED)
    played = play(scene)
    return None if played.refused[0] else plan_view(scene, played, 0)


def true_motion(firing: Firing, day: Day, shot: int) -> Motion | None:
    """Return how a shot of a day, from 1, really went; None where no scene plays it."""
    before = Day(morning=day.morning, balls=day.balls)
    for event in day.events:
        if event.action == "fire" and len(before.fired) == shot - 1:
            seen = plan_of_shot(firing, firing.conditions(before))
            return None if seen is None else _motion(seen)
        before = evolve(before, event)
    return None


def _motion(seen: PlanView) -> Motion:
    first = seen.contacts[0].time if seen.contacts else 0.0
    return Motion(
        time=seen.time - first,
        x=seen.ball_x,
        z=seen.ball_z,
        angle=seen.angle,
        words=contact_words([contact.struck for contact in seen.contacts]),
        true=True,
    )
