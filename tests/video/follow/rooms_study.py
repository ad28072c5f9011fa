"""Contacts, speeds and restitutions of throws in rooms, each with its own lamp, by their truth.

python -m tests.video.follow.rooms_study [--seeds 8] [--from 0] [--keep FOLDER] [KIND ...]

Kinds: a phone on a stand, one whose shutter rolls, one in a hand, and one that follows the ball by
a turn about its lens; also balls that do not fly. Most balls are white or pale, lit from above,
before a gray wall, so that the lower half of the ball is about as bright as the wall. Each clip has
its own tilt, lamp, throw and quality of H.264. A contact counts if the ball is readable in at least
six frames before it and six after it. With `--keep`, the clips of earlier runs are used again.
"""

import argparse
import pickle
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd

from tests.video.scenery.backdrop import Backdrop
from tests.video.scenery.filming import film
from tests.video.scenery.motion import GRAVITY, Ball, Carried, Rolling, Surface, Swinging, Thrown
from tests.video.scenery.scene import Actor, Made, Phone, Scene
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.clip import open_clip
from virtual_lab.video.follow.following import FollowedClip, follow
from virtual_lab.video.follow.knowledge import ClipKnowledge

FLYING = ("stand", "rolled", "hand", "turned")
KINDS = (*FLYING, "held")
SIZE = (480, 270)  # size of a picture [pixels]
NEAR = 1.0  # tolerance of a contact [frames]
LEAST = 6  # smallest number of readable frames on each side of a contact that counts
# flags that warn of no missed contact: they concern only the size of speeds, or their u
SILENT = {"READOUT_UNKNOWN", "ROLLING_SHUTTER", "TILTED", "PANNED", "DRIFT_UNSEEN", "GRAVITY"}


def room(kind: str, seed: int) -> Scene:
    """Return a throw with two bounces before a gray wall; or, for `held`, a ball without flight."""
    draw = np.random.default_rng([seed, 83, KINDS.index(kind)])
    diameter, radius = draw.uniform(0.04, 0.075), draw.uniform(7, 12)  # of the ball [m], [pixels]
    focal = draw.uniform(0.75, 0.95) * SIZE[0]
    unit = diameter / 2 / radius
    wide, high = np.multiply(SIZE, unit)
    fps = float(draw.choice([60, 60, 120]))
    drop, restitution = draw.uniform(0.5, 0.7) * high, draw.uniform(0.6, 0.85, 2)
    fall = float(np.sqrt(2 * drop / GRAVITY))
    again = fall * 2 * restitution[0]
    time = fall + again + again * restitution[1] * 0.7  # end of the clip [s]
    white = draw.random() < 0.95
    ball = Ball(
        diameter=diameter,
        mass=draw.uniform(250, 900) * np.pi * diameter**3 / 6,
        colour=tuple(draw.uniform(0.6, 0.8) * np.array([0.97, 1, 1]))
        if white
        else ((0.05, 0.72, 0.07), (0.06, 0.07, 0.55), (0.1, 0.35, 0.8))[draw.integers(3)],
        texture=draw.uniform(0.02, 0.12),
        gloss=draw.uniform(0.05, 0.2),
        facing=seed,
    )
    motion: Any = Thrown(
        place=(-0.5 * wide - diameter, 0.40 * high - drop),
        velocity=(draw.uniform(0.85, 1.0) * wide / time, 0.0),
        surfaces=(
            Surface(at=0.40 * high, restitution=tuple(restitution), keeps=draw.uniform(0.85, 1)),
        ),
    )
    if kind == "held":
        motion = (
            Swinging(pivot=(0.0, -0.55 * high), length=0.75 * high, amplitude=0.5),
            Carried(reach=(0.2 * wide, 0.15 * high), arm_from=(wide, 0.3 * high)),
            Rolling(place=(-0.45 * wide, 0.2 * high), speed=0.6 * wide),
        )[seed % 3]
        time = 1.2
    phone: dict[str, Any] = {}
    if kind == "hand":
        phone = {"drift": draw.uniform(8, 24), "turn": draw.uniform(-0.8, 0.8), "turns": True}
    elif kind == "turned":
        phone = {"drift": 6.0, "pan": draw.uniform(0.15, 0.35) * SIZE[0] / time, "turns": True}
    elif kind == "rolled":
        phone = {"readout": draw.uniform(0.3, 0.95) / fps, "drift": draw.choice([0.0, 12.0])}
    level = float(draw.uniform(90, 165))
    above = (draw.uniform(-0.7, 0.7), -1.0, draw.uniform(-0.6, 0.1))
    return Scene(
        name=f"{kind}-{seed}",
        seed=5000 + seed,
        size=SIZE,
        fps=fps,
        count=round(time * fps),
        exposure=draw.uniform(0.1, 0.4) / fps,
        actors=(Actor(ball=ball, motion=motion),),
        phone=Phone(
            distance=focal * unit,
            focal=focal,
            pitch=draw.uniform(-5, 5),
            yaw=draw.uniform(-5, 5),
            blur=draw.uniform(0.5, 1.0),
            noise=draw.uniform(1.0, 2.5),
            **phone,
        ),
        backdrop=Backdrop(
            wall=(level, level + 2, level + 3),
            floor=(level - 25, level - 15, level - 10),
            slope=(draw.uniform(-20, 20), draw.uniform(5, 25), draw.uniform(1, 4)),
            grain=draw.uniform(0.5, 3),
            joints=int(draw.integers(0, 3)),
            plates=int(draw.integers(1, 4)),
        ),
        floor=None if kind == "held" else 0.40 * high,
        lamp=above,
        ambient=draw.uniform(0.15, 0.5),
        wall_shadow=draw.uniform(0.0, 0.1),
        codec="H264",
        crf=int(draw.integers(20, 28)),
    )


def filmed(kind: str, seed: int, folder: Path) -> Made:
    """Return a clip with its truth, which an earlier run may have left in the folder."""
    scene, kept = room(kind, seed), folder / f"{kind}-{seed}.pickle"
    made: Made | None = pickle.loads(kept.read_bytes()) if kept.exists() else None
    if made is None or made.scene != scene:
        made = film(scene, folder)
        kept.write_bytes(pickle.dumps(made))
    return made


def followed(made: Made) -> FollowedClip:
    """Follow a clip as `virtual-lab track --ball D --fps F` does."""
    scene, diameter = made.scene, made.truth.diameter
    clip = open_clip(made.path, ClipCalibration(frames_per_second=scene.fps))
    return follow(clip, ClipKnowledge(rate=scene.fps, ball=diameter, ball_u=0.01 * diameter))


def rows_of(made: Made, result: FollowedClip) -> Iterator[dict[str, Any]]:
    """Yield one row per visible contact, and one per false contact or flight of a held ball."""
    truth, kind, seed = made.truth, *made.scene.name.split("-")
    clip = {"kind": kind, "seed": int(seed), "flags": " ".join(result.flags)}
    readable, used = truth.frames.readable, set()
    if kind == "held":
        yield clip | {"case": "false" if result.flights else "none", "frame": np.nan}
        return
    breaks = [0.0, *(each.frame for each in truth.contacts), float(len(readable))]
    for k, true in enumerate(truth.contacts):
        before = readable[int(np.ceil(breaks[k])) : int(true.frame) + 1].sum()
        after = readable[int(true.frame) + 1 : int(breaks[k + 2])].sum()
        met = [each for each in result.contacts if abs(each.frame - true.frame) < NEAR]
        used |= {id(each) for each in met}
        if not (true.seen and min(before, after) >= LEAST):
            continue
        row = clip | {"case": "found" if met else "missed", "frame": true.frame}
        if met:
            one = met[0]
            pairs = [
                ("v_in", result.flights[one.before].speed_out, np.hypot(*true.velocity_in)),
                ("v_out", result.flights[one.before + 1].speed_in, np.hypot(*true.velocity_out)),
                ("e", one.restitution, true.restitution),
            ]
            for name, said, value in pairs:
                if said:
                    row |= {name: 100 * (said.value / value - 1), f"{name} z": said.value - value}
                    row[f"{name} z"] /= said.u
        yield row
    for each in result.contacts:
        if id(each) not in used:
            yield clip | {"case": "false", "frame": each.frame}


def summary(table: pd.DataFrame) -> pd.DataFrame:
    """Return one column per kind, and one for all."""
    columns = {}
    parts = [*table.groupby("kind", sort=False), ("all", table)]
    for kind, part in parts:
        missed = part[part["case"] == "missed"]
        silent = [not set(each.split()) - SILENT for each in missed["flags"]]
        held = part["kind"] == "held"
        line = {
            "contacts": int(part["case"].isin(["found", "missed"]).sum()),
            "missed": len(missed),
            "missed without a flag": sum(silent),
            "false contacts": int(((part["case"] == "false") & ~held).sum()),
            "held balls": int(held.sum()),
            "held balls with a flight": int(((part["case"] == "false") & held).sum()),
        }
        if {"v_in", "e"} <= set(part):
            for name in ("v_in", "v_out", "e"):
                off, z = part[name].dropna().abs(), part[f"{name} z"].dropna()
                line |= {
                    f"{name}: stated": len(off),
                    f"{name}: median error %": round(off.median(), 2),
                    f"{name}: 90 % of errors below %": round(off.quantile(0.9), 2),
                    f"{name}: rms %": round(float(np.sqrt((off**2).mean())), 2),
                    f"{name}: rms z": round(float(np.sqrt((z**2).mean())), 2),
                    f"{name}: beyond 2 u": int((z.abs() > 2).sum()),
                }
        columns[kind] = line
    return pd.DataFrame(columns, dtype=object)


def main() -> None:
    """Print one line per contact, then one column per kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", default=KINDS)
    parser.add_argument("--seeds", type=int, default=8)
    parser.add_argument("--from", dest="first", type=int, default=0)
    parser.add_argument("--keep", type=Path)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    rows: list[dict[str, Any]] = []
    with tempfile.TemporaryDirectory() as folder:
        for seed in range(options.first, options.first + options.seeds):
            for kind in options.kinds:
                made = filmed(kind, seed, options.keep or Path(folder))
                rows += (more := list(rows_of(made, followed(made))))
                for row in more:
                    cells = (f"{e:.3g}" if isinstance(e, float) else str(e) for e in row.values())
                    print(" ".join(cells), flush=True)
    print(summary(pd.DataFrame(rows)).to_string())


if __name__ == "__main__":
    main()
