"""The top view of a shot that a trainee may see: the events are true, the numbers are blurred.

An animation with a resolution of 5 mm would reveal e_A to 0.0003. The sketch therefore adds a
random error to e_A and to the rotation rate of the bat. One part of this error is the same for all
shots of the day, so averaging over shots does not reduce it. The other part differs from shot to
shot. After the hand-in `scene_of_shot` returns the true shot.

Camera frames are treated in the same way. Before the hand-in they show nominal machines, a nominal
bat and a nominal ball with the e_A of the sketch, so a fit to them reveals no more than the sketch.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np

from virtual_lab.bench.day.day import Day, DayEvent
from virtual_lab.bench.machines.firing import Firing, ShotConditions
from virtual_lab.bench.pages.slow_motion import FILM, Motion, clear_rebound, contact_words
from virtual_lab.lab import Laboratory, TestSetup
from virtual_lab.simulation.collision.ladder import Ladder, StruckBat, probing_scenes
from virtual_lab.simulation.collision.scene import Scenes
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.simulation.motion.events import play_events
from virtual_lab.simulation.motion.played import PlayedShots
from virtual_lab.simulation.motion.scene import ShotScene
from virtual_lab.simulation.physics.beam import Free, Support, beam_of
from virtual_lab.simulation.physics.truth import draw_balls, make_bat
from virtual_lab.simulation.stations.cannon_station import RestingBatStation
from virtual_lab.simulation.stations.flights import scene_of
from virtual_lab.simulation.stations.rig import FilmingStation, ShotPlan, Specimen, Stage, find_rig
from virtual_lab.streams import Quiet
from virtual_lab.units import Array

FRAMES = 6  # number of frames in a film of a shot


def sketch_of(firing: Firing, shot: ShotConditions) -> dict[str, Any]:
    """Return the sketch of a shot as a JSON object.

    The sketch is the top view that a trainee may see. Its key `struck` lists the contacts in order,
    such as "bat" or "stop", and is empty if the ball hit nothing. If the ball hit the bat, there
    are four more keys. `way` is "back" if the ball flies back and "on" if it flies on. `side` is
    "straight", "up" or "down". `way` and `side` show the true direction of the ball after the hit.
    `rebound` (the collision efficiency e_A) and `turn` (change of the bat's angular rate [rad/s])
    are blurred.
    """
    if shot not in firing.sketches:
        firing.sketches[shot] = _draw_sketch(firing, shot)
    return firing.sketches[shot]


def _draw_sketch(firing: Firing, shot: ShotConditions) -> dict[str, Any]:
    truth = firing.shot(shot)[1].truth
    efficiency, across = (float(truth[name][0]) for name in ("collision_efficiency", "across"))
    met = bool(np.isfinite(efficiency))
    scene = scene_of_shot(firing, shot)
    struck = list(dict.fromkeys(scene[1].pieces.struck[1:].tolist() if scene else ()))
    struck = struck or ["bat"] * met
    if not met:
        return {"struck": struck}
    straight = abs(across) < 0.008  # largest offset from the axis without visible deflection [m]
    side = "straight" if straight else "up" if across > 0 else "down"
    direction = "back" if truth["rebound_speed"][0] > 0 else "on"
    rebound, turn = blur_rebound(firing, shot, efficiency)
    return {"struck": struck, "way": direction, "side": side, "rebound": rebound, "turn": turn}


def blur_rebound(firing: Firing, shot: ShotConditions, efficiency: float) -> tuple[float, float]:
    """Return inaccurate values of e_A and of the change of the bat's angular rate [rad/s].

    The change is the one caused by the hit. For a bat at rest, it is the angular rate after the
    hit.

    A trainee sees these values in the sketch of a shot. Both have a random error. e_A is then
    rounded to 0.01, and the rate to 0.1 rad/s. Each call for the same shot gives the same values.
    `efficiency` is the true e_A.
    """
    draws = firing.laboratory.draws
    day_draws = draws.normal("rehearsal.sketch-day", 2)
    shot_draws = draws.normal("rehearsal.sketch", 2, np.array([shot.shot]))[0]
    # standard deviation of a day, then standard deviation of a shot
    efficiency_error = 0.03 * day_draws[0] + 0.03 * shot_draws[0]  # error of e_A
    rate_error = 0.1 * day_draws[1] + 0.1 * shot_draws[1]  # relative error of the bat's rate
    specimen, rules = firing.laboratory.specimen, firing.laboratory.rules.spec
    body = specimen.bat.body
    axis = body.length - rules.pivot_from_knob
    lever = axis - shot.place
    closing = rules.ball_speed + shot.turn_rate * lever
    blow = specimen.balls.spec.mass * closing * (1 + efficiency)
    rate = blow * lever / beam_of(body).inertia(axis) * (1 + rate_error)
    return round(float(efficiency + efficiency_error), 2), round(float(rate), 1)


def scene_of_shot(firing: Firing, shot: ShotConditions) -> tuple[ShotScene, PlayedShots] | None:
    """Return the true initial conditions of a shot and its true motion.

    The result is None for a rig that swings the bat, and for a shot that the model of the motion
    cannot compute.
    """
    laboratory, requested = firing.actual_conditions(shot)
    station = laboratory.stations[Stage.IMPACT]
    if not isinstance(station, RestingBatStation):
        return None
    plan, specimen = laboratory.setup.faults.apply(Stage.IMPACT, requested, laboratory.specimen)
    fired = station.fire(plan, specimen, laboratory.draws)
    flights = fired.flights
    long_motion = (
        flights.kicks or not np.all(flights.reached_bat) or np.any(flights.separation_time)
    )
    surroundings = station.surroundings(specimen.balls.spec.radius)
    scene = scene_of(
        fired.passage, fired.bat, surroundings, 0.5 if long_motion else FILM.after
    ).alone(0)
    played = play_events(scene)
    return None if played.refused[0] else (scene, played)


def true_motion(firing: Firing, day: Day, shot: int) -> Motion | None:
    """Return the true motion of a shot in a rehearsal.

    Times are in s, lengths in m and angles in rad. The result is None for a rig that swings the
    bat, and for a shot that the model of the motion cannot compute. Raises `IndexError` if the shot
    has not been fired.

    Parameters
    ----------
    firing
        The machines that fire the shots.
    day
        State of the rehearsed day.
    shot
        Number of the shot, counted from 1.
    """
    shot_scene = scene_of_shot(firing, firing.conditions(before_shot(day, shot)))
    if shot_scene is None:
        return None
    scene, played = shot_scene
    contacts = played.pieces.time[1:]
    time = np.union1d(np.linspace(0.0, float(scene.duration), 200), contacts)
    positions = played.at(scene, time).part(0)
    return Motion(
        time=time - contacts[0] if contacts.size else time,
        x=positions.x,
        z=positions.z,
        angle=positions.angle,
        words=contact_words(played.pieces.struck[1:].tolist()),
        true=True,
    )


@dataclass(frozen=True)
class FixedRebound(Ladder):
    """Ladder of collision models that returns the e_A of the sketch, `rebound`, for every shot."""

    rebound: float = 0.0

    def efficiencies(self, struck: Iterable[StruckBat], support: Support, scenes: Scenes) -> Array:
        return np.full(scenes.impact_position.shape, self.rebound)


def has_camera(laboratory: Laboratory) -> bool:
    """Return whether the impact rig has a camera."""
    return isinstance(laboratory.stations[Stage.IMPACT], FilmingStation)


def sketch_film(setup: TestSetup, event: DayEvent) -> bytes:
    """Return six simulated camera frames of a shot as one PNG image.

    The frames are drawn from the sketch, the blurred top view of the shot that a trainee may see.
    They also depend on the impact position that was set, and on data sheets, but on no true value.
    `event` is the notebook entry of the shot. The result is empty if the ball missed the bat or the
    rig has no camera.
    """
    station = find_rig(setup.rig, Stage.IMPACT).commission(Quiet(), ideal=True)
    if "rebound" not in event.sketch or not isinstance(station, FilmingStation):
        return b""
    rules, ball = setup.rules.spec, setup.ball.spec
    collision = FixedRebound(
        nominal=setup.bat.spec.body,
        support=Free(),
        probe=probing_scenes(ball, rules.ball_speed),
        standard_uncertainty=None,
        rebound=clear_rebound(event.sketch),
    )
    specimen = Specimen(
        bat=make_bat(setup.bat.spec, Quiet()),
        balls=draw_balls(ball, 1, Quiet()),
        collision=collision,
    )
    plan = ShotPlan(
        slot=np.array([0]),
        ball=np.array([0]),
        speed=np.array([rules.ball_speed]),
        place=np.array(event.records["log"]["place"]),
        detail=RecordDetail.SUMMED,
    )
    return _strip(station.frames(plan, specimen, Quiet(), FRAMES))


def true_film(firing: Firing, day: Day, shot: int) -> bytes:
    """Return the six true camera frames of a shot as one PNG. `shot` is counted from 1.

    The result is empty if the rig has no camera. Raises `IndexError` if `shot` is larger than the
    number of fired shots.
    """
    laboratory, requested = firing.actual_conditions(firing.conditions(before_shot(day, shot)))
    station = laboratory.stations[Stage.IMPACT]
    if not isinstance(station, FilmingStation):
        return b""
    plan, specimen = laboratory.setup.faults.apply(Stage.IMPACT, requested, laboratory.specimen)
    return _strip(station.frames(plan, specimen, laboratory.draws, FRAMES))


def before_shot(day: Day, shot: int) -> Day:
    """Return the day as it was immediately before a shot. `shot` is counted from 1.

    Raises `IndexError` if `shot` is larger than the number of fired shots.
    """
    fired = [event.number for event in day.events if event.action == "fire"]
    return day.until(fired[shot - 1] - 1)


def _strip(frames: Array) -> bytes:
    """Return frames, shape (frame, row, column), as one small PNG with square-root tones."""
    import cv2

    width, abreast = 320, 3
    height = round(width * frames.shape[1] / frames.shape[2])
    small = [cv2.resize(each, (width, height), interpolation=cv2.INTER_AREA) for each in frames]
    tones = 255 * np.sqrt(np.clip(np.array(small) / np.max(small), 0, 1))
    edged = np.pad(tones, ((0, 0), (1, 1), (1, 1)))
    rows = edged.reshape(-1, abreast, *edged.shape[1:]).transpose(0, 2, 1, 3)
    picture = rows.reshape(-1, abreast * edged.shape[2]).astype(np.uint8)
    return bytes(cv2.imencode(".png", picture)[1])
