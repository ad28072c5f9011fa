"""Clips as phones write them, for many seeds, compared with their truth.

python -m tests.video.follow.study [--seeds 20] [--from 0] [--as-named] [NAME ...]

Every scene is filmed with other seeds, stored in H.264 of random quality (with `--as-named`, by the
codec that the scene names), and followed as by `virtual-lab track`. Faults of the tracker are
missed flights that a person sees, false contacts, results wrong by more than 5 u without a flag
that gives the reason, and missing positions.
"""

import argparse
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import cv2
import numpy as np
import pandas as pd

from tests.video.follow.twins import run
from tests.video.scenery.scene import BallTruth, Made, Scene
from tests.video.scenery.scenes import SCENES, UNSEEN
from virtual_lab.video.follow.following import FollowedClip

NO_FLIGHT = {"carried", "pendulum", "rolling", "empty"}
SEEN = 8  # readable frames of a flight that must be found
READ = 6  # readable frames of a flight whose positions count
MUCH = 0.5  # share of a flight's readable frames that counts as found
FAR = 5.0  # largest error of a result [u]
BESIDE = 0.8  # tolerance of a contact [frames]; a lost frame may contain one
HARMLESS = {"READOUT_UNKNOWN", "REPEATED_FRAMES", "LOST_FRAMES"}  # flags that excuse no error


@dataclass(frozen=True, kw_only=True)
class Score:
    """Faults of one clip, by its truth."""

    kind: str  # wrong motion that was reported, "" if it is right
    missed: tuple[str, ...]  # missed flights
    false: tuple[str, ...]  # false contacts
    placed: int
    readable: int
    far: float  # largest error [u]
    what: str  # result with the largest error
    flags: tuple[str, ...]

    @property
    def few(self) -> bool:
        """Whether more than 10 % of the positions are missing."""
        return self.placed < 0.9 * self.readable

    @property
    def wrong(self) -> bool:
        """Whether a result is wrong by more than FAR without a flag."""
        return self.far > FAR and not set(self.flags) - HARMLESS


def phone_of(scene: Scene, seed: int) -> Scene:
    """Return a scene with another seed, filmed by a phone of random quality."""
    rng = np.random.default_rng([seed, 90])
    return replace(scene, seed=scene.seed + 100 * seed, codec="H264", crf=int(rng.integers(23, 31)))


def score_of(made: Made, result: FollowedClip) -> Score:
    """Return the score of a followed clip; of several balls, the one with most positions counts."""
    flown = bool(result.flights)
    motion = "" if flown == (made.scene.name not in NO_FLIGHT) else "flights" if flown else "none"
    if not made.truths:
        return Score(
            kind=motion,
            missed=(),
            false=tuple(f"{each.frame:.1f}" for each in result.contacts),
            placed=0,
            readable=0,
            far=0.0,
            what="",
            flags=result.flags,
        )
    truth = max(made.truths, key=lambda each: _placed(each, result)[0])
    placed, readable, missed = _placed(truth, result)
    false = []
    errors = [(0.0, "")]
    for contact in result.contacts:
        near = [each for each in truth.contacts if abs(each.frame - contact.frame) < BESIDE]
        if not near:
            false.append(f"{contact.frame:.1f}")
            continue
        true = near[0]
        at = f"at {contact.frame:.1f}"
        if contact.restitution:
            said = contact.restitution
            errors.append((abs(said.value - true.restitution) / said.u, f"restitution {at}"))
        for said, velocity in (
            (result.flights[contact.before].speed_out, true.velocity_in),
            (result.flights[contact.before + 1].speed_in, true.velocity_out),
        ):
            errors.append((abs(said.value - np.hypot(*velocity)) / said.u, f"speed {at}"))
    for flight in result.flights:
        said, at = flight.acceleration, f"of {flight.first_frame}-{flight.last_frame}"
        errors.append((abs(said.value - truth.gravity) / said.u, f"g {at}"))
    if result.gravity:
        errors.append((abs(result.gravity.value - truth.gravity) / result.gravity.u, "g"))
    far, what = max(errors)
    return Score(
        kind=motion,
        missed=missed,
        false=tuple(false),
        placed=placed,
        readable=readable,
        far=far,
        what=what,
        flags=result.flags,
    )


def _placed(truth: BallTruth, result: FollowedClip) -> tuple[int, int, tuple[str, ...]]:
    """Return the number of located readable frames, that of all, and the missed flights."""
    frames, missed, placed, readable = truth.frames, [], 0, 0
    ways = [way.frames[_on(truth, way)] for way in result.ways]
    for flight in truth.flights:
        inside = np.arange(flight.first_frame, flight.last_frame + 1)
        inside = inside[frames.readable[inside]]
        if flight.places < READ:
            continue
        here = int(np.isin(inside, np.concatenate([*ways, []])).sum())
        placed, readable = placed + here, readable + len(inside)
        if flight.places >= SEEN and here < MUCH * len(inside):
            missed.append(f"{flight.first_frame}-{flight.last_frame}")
    return placed, readable, tuple(missed)


def _on(truth: BallTruth, way) -> np.ndarray:
    """Return a mask of a flight's positions on the ball, up to 2 px of still-frame offset."""
    frames = truth.frames
    off = way.xy - np.stack([frames.x, frames.y], axis=1)[way.frames]
    finite = np.isfinite(off).all(axis=1)
    if not finite.any():
        return finite
    off = np.hypot(*(off - np.clip(np.nanmedian(off, axis=0), -2, 2)).T)
    return np.nan_to_num(off, nan=np.inf) < 0.5 * way.radius


def row_of(name: str, scores: Sequence[Score]) -> dict[str, object]:
    """Return the table's row of a scene."""
    placed, readable = (sum(getattr(s, key) for s in scores) for key in ("placed", "readable"))
    return {
        "scene": name,
        "clips": len(scores),
        "kind wrong": sum(bool(each.kind) for each in scores),
        "flights missed": sum(len(each.missed) for each in scores),
        "false contacts": sum(len(each.false) for each in scores),
        "beyond 5 u": sum(each.far > FAR for each in scores),
        "unflagged": sum(each.wrong for each in scores),
        "below 90 %": sum(each.few for each in scores),
        "placed %": round(100 * placed / readable, 1) if readable else "",
    }


def main() -> None:
    """Print the faults of each clip, then one row per scene."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("names", nargs="*")
    parser.add_argument("--seeds", type=int, default=20)
    parser.add_argument("--from", dest="first", type=int, default=0)
    parser.add_argument("--as-named", action="store_true")
    options = parser.parse_args()
    cv2.setNumThreads(1)
    rows = []
    for name in options.names or [*SCENES, *UNSEEN]:
        scene, scores = (SCENES | UNSEEN)[name], []
        for seed in range(options.first, options.first + options.seeds):
            changed = replace(scene, seed=scene.seed + 100 * seed)
            with tempfile.TemporaryDirectory() as folder:
                made, result = run(
                    changed if options.as_named else phone_of(scene, seed), Path(folder)
                )
            score = score_of(made, result)
            scores.append(score)
            if score.kind or score.missed or score.false or score.far > FAR or score.few:
                print(
                    f"  {name} {seed} crf {made.scene.crf}: {score.kind or 'right'}; "
                    f"missed {score.missed}; false {score.false}; {score.placed} of "
                    f"{score.readable}; {score.what} {score.far:.1f} u; {', '.join(score.flags)}",
                    flush=True,
                )
        rows.append(row_of(name, scores))
    print(pd.DataFrame(rows).to_string(index=False))


if __name__ == "__main__":
    main()
