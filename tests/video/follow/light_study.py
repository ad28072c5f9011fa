"""Speeds of a ball in hard side light, in soft and in flat light, by either ruler.

python -m tests.video.follow.light_study [--seeds 12] [--from 0]

Each clip is another throw before a camera that is level to 5 degrees. A scene is right where both
speeds at its first contact lie within 2 u of the truth.
"""

import argparse

import cv2
import numpy as np
import pandas as pd

from tests.video.follow.lit_ball import DIAMETER, LIGHTS, Filmed, Throw, film
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.clip import Clip, open_clip
from virtual_lab.video.follow.following import FollowedClip, following
from virtual_lab.video.follow.following import follow as follow_clip
from virtual_lab.video.follow.known import ClipKnowledge

RULERS = {"best": None, "ball": "ball"}


def known_of(throw: Throw, ruler: str | None = None) -> ClipKnowledge:
    """Return what a person says: the ball to .2 mm, the rate, a stand, no rolling shutter."""
    return ClipKnowledge(
        rate=throw.fps, ball=DIAMETER, ball_u=2e-4, stands=True, readout=0.0, ruler=ruler
    )


def clip_of(throw: Throw, made: Filmed) -> Clip:
    return open_clip(made.frames, ClipCalibration(frames_per_second=throw.fps))


def speeds_of(found: FollowedClip) -> tuple[Estimate, Estimate]:
    """Return the speeds before and after the first contact."""
    contact = found.contacts[0]
    return found.flights[contact.before].speed_out, found.flights[contact.after].speed_in


def main() -> None:
    """Print a line a scene, then one for each light and ruler."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=12)
    parser.add_argument("--from", dest="first", type=int, default=0)
    asked = parser.parse_args()
    cv2.setNumThreads(1)
    rows = []
    for light in LIGHTS:
        for seed in range(asked.first, asked.first + asked.seeds):
            throw = Throw(light=light, seed=seed)
            made = film(throw)
            clip, watched = clip_of(throw, made), None
            for name, ruler in RULERS.items():
                known = known_of(throw, ruler)
                found = following(clip, watched, known) if watched else follow_clip(clip, known)
                watched = found.watched
                if not found.contacts or not found.scale:
                    rows.append({"light": light, "ruler": name, "lost": 1})
                    continue
                pairs = list(zip(speeds_of(found), made.speeds, strict=True))
                rows.append(
                    {
                        "light": light,
                        "ruler": name,
                        "seed": seed,
                        "by": found.scale.source,
                        "error %": 100 * max((s.value / v - 1 for s, v in pairs), key=abs),
                        "off u": max(((s.value - v) / s.u for s, v in pairs), key=abs),
                        "flags": " ".join(found.flags),
                    }
                )
                numbers = [f"{rows[-1][key]:+.2f}" for key in ("error %", "off u")]
                print(light, name, seed, found.scale.source, *numbers, *found.flags, flush=True)
    table = pd.DataFrame(rows)
    for (light, ruler), some in table.groupby(["light", "ruler"], sort=False):
        off = some["off u"].abs()
        print(
            f"{light}, {ruler}: {len(some)} scenes, within 2 u {int((off < 2).sum())}, beyond 3 u "
            f"without a flag {int(((off > 3) & (some['flags'] == '')).sum())}, median error "
            f"{np.nanmedian(some['error %'].abs()):.2f} %, by gravity "
            f"{int((some['by'] == 'gravity').sum())}"
        )


if __name__ == "__main__":
    main()
