"""Twins of users' clips, followed and compared with their truth."""

from pathlib import Path

import numpy as np

from tests.video.scenery.filming import film
from tests.video.scenery.scene import BallTruth, Made, Scene
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.clip import open_clip
from virtual_lab.video.clips.timing import usual_step
from virtual_lab.video.follow.following import FollowedClip, follow
from virtual_lab.video.follow.knowledge import ClipKnowledge

__all__ = ["require_contacts", "require_flights", "run"]


def run(scene: Scene, folder: Path, readout: float | None = None) -> tuple[Made, FollowedClip]:
    made = film(scene, folder)
    rate: float | None = scene.fps
    if scene.true_stamps or not scene.rate_said:
        rate = None
    elif scene.stored == "doubled":
        rate = 2 * rate
    elif scene.stored == "repeated":
        rate = rate * len(made.exposures) / scene.count
    clip = open_clip(made.path, ClipCalibration(frames_per_second=rate))
    diameter = scene.actors[0].ball.diameter if scene.actors else 0.05
    rate = rate or 1 / usual_step(clip.times)
    ball = {"ball": diameter, "ball_u": 0.01 * diameter}
    return made, follow(clip, ClipKnowledge(rate=rate, readout=readout, **ball))


def require_flights(truth: BallTruth, result: FollowedClip, least: float = 0.8) -> None:
    """Require the flights of at least eight readable frames, and no positions off the ball."""
    frames = truth.frames
    for flight in truth.flights:
        if flight.places < 8:
            continue
        inside = np.arange(flight.first_frame, flight.last_frame + 1)
        readable = inside[frames.readable[inside]]
        placed = [
            np.isin(way.frames, readable).sum()
            for way in result.ways
            if way.frames[0] <= flight.last_frame and flight.first_frame <= way.frames[-1]
        ]
        assert max(placed, default=0) >= least * len(readable)
    for way in result.ways:
        here = np.isfinite(frames.x[way.frames])
        off = way.xy[here] - np.stack([frames.x, frames.y], axis=1)[way.frames[here]]
        assert np.abs(off - np.median(off, axis=0)).max() < 0.35 * way.radius


def require_contacts(truth: BallTruth, result: FollowedClip) -> None:
    """Require that each contact is true, its frame within 0.25, its restitution within 2.5 u."""
    for contact in result.contacts:
        true = min(truth.contacts, key=lambda each: abs(each.frame - contact.frame))
        assert abs(true.frame - contact.frame) < 0.25
        assert contact.kind == true.kind
        if contact.restitution is not None:
            off = abs(contact.restitution.value - true.restitution)
            assert off < 2.5 * contact.restitution.u + 1e-3
            assert "TILTED" in result.flags or contact.restitution.u <= 0.03
