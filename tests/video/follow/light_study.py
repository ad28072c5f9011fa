"""Speeds of a ball in hard side light, in soft and in flat light, by the best ruler.

python -m tests.video.follow.light_study [--seeds 40] [--from 0]

Each clip is another throw before a camera that is level to 5 degrees. A scene is right where both
speeds at its first contact lie within 2 u of the truth.
"""

import argparse
from collections.abc import Iterator
from typing import Any

import cv2
import pandas as pd

from tests.video.follow.lit_ball import DIAMETER, LIGHTS, Filmed, Throw, film
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.clip import Clip, open_clip
from virtual_lab.video.follow.following import FollowedClip, follow
from virtual_lab.video.follow.known import ClipKnowledge

SURE = 0.005  # relative u of gravity's ruler at which the median error is judged


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


def scenes(first: int, seeds: int) -> Iterator[dict[str, Any]]:
    """Yield a row a scene."""
    for seed in range(first, first + seeds):
        for light in LIGHTS:
            throw = Throw(light=light, seed=seed)
            made = film(throw)
            found = follow(clip_of(throw, made), known_of(throw))
            row = {"light": light, "seed": seed, "flags": " ".join(found.flags)}
            if found.contacts and found.scale:
                pairs = list(zip(speeds_of(found), made.speeds, strict=True))
                ratio = found.contacts[0].restitution
                row |= {
                    "by": found.scale.source,
                    "u of ruler %": 100 * found.scale.relative_u,
                    "error %": 100 * max((s.value / v - 1 for s, v in pairs), key=abs),
                    "off u": max(((s.value - v) / s.u for s, v in pairs), key=abs),
                    "e off": ratio.value - made.restitution if ratio else None,
                    "e off u": (ratio.value - made.restitution) / ratio.u if ratio else None,
                }
            yield row


def summary(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Return a row a light."""
    table, lines = pd.DataFrame(rows), []
    for light, some in table.groupby("light", sort=False):
        seen, off, e_off = some.dropna(subset="off u"), some["off u"].abs(), some["e off u"].abs()
        sure = seen[(seen["by"] == "gravity") & (seen["u of ruler %"] <= 100 * SURE)]
        silent = some["flags"] == ""
        lines.append(
            {
                "light": light,
                "scenes": len(some),
                "no contact": len(some) - len(seen),
                "within 2 u": int((off < 2).sum()),
                "beyond 3 u, no flag": int(((off > 3) & silent).sum()),
                "median error %": round(seen["error %"].abs().median(), 2),
                f"scenes of u(g) <= {100 * SURE} %": len(sure),
                "their median error %": round(sure["error %"].abs().median(), 2),
                "e within 2 u": int((e_off < 2).sum()),
                "e beyond 3 u, no flag": int(((e_off > 3) & silent).sum()),
                "median error of e": round(seen["e off"].abs().median(), 4),
            }
        )
    return pd.DataFrame(lines)


def main() -> None:
    """Print a line a scene, then a column a light."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--from", dest="first", type=int, default=0)
    asked = parser.parse_args()
    cv2.setNumThreads(1)
    rows = []
    for row in scenes(asked.first, asked.seeds):
        rows.append(row)
        cells = (f"{each:.3g}" if isinstance(each, float) else str(each) for each in row.values())
        print(" ".join(cells), flush=True)
    print(summary(rows).set_index("light").T.to_string())


if __name__ == "__main__":
    main()
