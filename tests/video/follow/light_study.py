"""Speeds and restitutions at the first contact of new clips, compared with their truth.

python -m tests.video.follow.light_study [--seeds 40] [--from 0] [KIND ...]

Kinds: a ball in hard side light, in soft and in flat light before a camera level to 5 degrees
(`lit_ball`); a phone's H.264 from a stand (level, pitched by up to 5 degrees, or also turned to a
side by so much) and from a shaking hand; a calibrated camera with unknown lens blur. Each clip has
its own throw. A clip is right if both speeds lie within 2 u of the truth.
"""

import argparse
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pandas as pd

from tests.video.follow.lit_ball import DIAMETER, LIGHTS, Filmed, Throw, film
from tests.video.scenery import filming
from tests.video.scenery.backdrop import Backdrop
from tests.video.scenery.motion import GRAVITY, Ball, Surface, Thrown
from tests.video.scenery.scene import Actor, Made, Phone, Scene
from virtual_lab.uncertainty.estimate import Estimate
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.clip import Clip, open_clip
from virtual_lab.video.follow.following import FollowedClip, follow
from virtual_lab.video.follow.knowledge import ClipKnowledge
from virtual_lab.video.follow.knowledge import knowledge_of as known_of_camera

SURE = 0.005  # largest relative u of gravity's ruler for the median error
PHONES = ("level", "pitched", "shaken", "calibrated", "turned")
SIZE = (640, 360)  # size of a phone's picture [pixels]


def knowledge_of(throw: Throw, ruler: str | None = None) -> ClipKnowledge:
    """Return a person's knowledge: the ball to 0.2 mm, the rate, a stand, no rolling shutter."""
    return ClipKnowledge(
        rate=throw.fps, ball=DIAMETER, ball_u=2e-4, tripod=True, readout=0.0, ruler=ruler
    )


def clip_of(throw: Throw, made: Filmed) -> Clip:
    return open_clip(made.frames, ClipCalibration(frames_per_second=throw.fps))


def thrown(kind: str, seed: int) -> Scene:
    """Return a throw across the picture with at least one bounce, before a random wall."""
    draw = np.random.default_rng([seed, 77, PHONES.index(kind)])
    diameter = draw.uniform(0.04, 0.08)
    radius, focal = draw.uniform(8, 15), draw.uniform(0.75, 1.0) * SIZE[0]  # sizes [pixels]
    unit = diameter / 2 / radius
    wide, high = np.multiply(SIZE, unit)
    fps = float(draw.choice([60, 120]))
    drop = draw.uniform(0.5, 0.75) * high
    restitution = draw.uniform(0.55, 0.85)
    time = np.sqrt(2 * drop / GRAVITY) * (1 + 2 * restitution)  # time until the second bounce [s]
    pitch = {"level": 0.5, "pitched": 5.0, "shaken": 0.5, "turned": 5.0}.get(kind, 0.0)
    density = draw.uniform(250, 900)  # density [kg/m³]
    colours = ((0.05, 0.72, 0.07), (0.06, 0.07, 0.55), (0.72, 0.74, 0.74), (0.1, 0.35, 0.8))
    ball = Ball(
        diameter=diameter,
        mass=density * np.pi * diameter**3 / 6,
        colour=colours[draw.integers(len(colours))],
        texture=draw.uniform(0.03, 0.15),
        facing=seed,
    )
    motion = Thrown(
        place=(-0.5 * wide - diameter, 0.42 * high - drop),
        velocity=(draw.uniform(0.8, 1.0) * wide / time, 0.0),
        released=0.0,
        arm_from=None,
        surfaces=(Surface(at=0.42 * high, restitution=(restitution,)),),
    )
    hand = {"drift": draw.uniform(8, 24), "turn": draw.uniform(-0.5, 0.5)}
    level = float(draw.uniform(90, 180))
    return Scene(
        name=kind,
        seed=1000 + seed,
        size=SIZE,
        fps=fps,
        count=round(1.15 * time * fps),
        exposure=draw.uniform(0.1, 0.4) / fps,
        actors=(Actor(ball=ball, motion=motion),),
        phone=Phone(
            distance=focal * unit,
            focal=focal,
            pitch=draw.uniform(-pitch, pitch),
            blur=draw.uniform(0.5, 1.0),
            noise=draw.uniform(1.0, 2.0),
            yaw=draw.uniform(-5, 5) if kind == "turned" else 0.0,
            **(hand if kind == "shaken" else {}),
        ),
        backdrop=Backdrop(
            wall=(level, level + 4, level + 6),
            floor=(level - 25, level - 15, level - 10),
            slope=(0, draw.uniform(5, 25), draw.uniform(2, 8)),
            grain=draw.uniform(1, 5),
            joints=int(draw.integers(1, 4)),
            plates=int(draw.integers(1, 4)),
        ),
        floor=0.42 * high,
        codec="H264",
        crf=int(draw.integers(20, 28)),
    )


def follow_phone(made: Made) -> FollowedClip:
    """Follow a clip with its owner's knowledge (rate, ball, global shutter), or a calibration."""
    scene, truth = made.scene, made.truth
    if scene.name == "calibrated":
        calibration = ClipCalibration(
            metres_per_pixel=truth.metres_per_pixel,
            metres_per_pixel_u=2e-4 * truth.metres_per_pixel,
            frames_per_second=scene.fps,
            ball_diameter_m=truth.diameter,
            exposure_s=scene.exposure,
            gravity_mps2=(0.0, GRAVITY),
            drag_per_m=truth.drag_per_metre,
            drag_per_m_u=0.1 * truth.drag_per_metre,
        )
        clip = open_clip(made.path, calibration)
        return follow(clip, known_of_camera(clip, calibration))
    clip = open_clip(made.path, ClipCalibration(frames_per_second=scene.fps))
    knowledge = ClipKnowledge(
        rate=scene.fps, ball=truth.diameter, ball_u=0.01 * truth.diameter, readout=0.0
    )
    return follow(clip, knowledge)


def speeds_of(result: FollowedClip) -> tuple[Estimate, Estimate]:
    """Return the speeds before and after the first contact."""
    contact = result.contacts[0]
    return result.flights[contact.before].speed_out, result.flights[contact.before + 1].speed_in


def followed(kind: str, seed: int) -> tuple[FollowedClip, tuple[float, float], float]:
    """Return a followed clip, and the true speeds and restitution of its first contact.

    If the first contact is not found, the clip is returned without contacts.
    """
    if kind in LIGHTS:
        throw = Throw(light=kind, seed=seed)
        lit = film(throw)
        return follow(clip_of(throw, lit), knowledge_of(throw)), lit.speeds, lit.restitution
    with tempfile.TemporaryDirectory() as folder:
        made = filming.film(thrown(kind, seed), Path(folder))
        result = follow_phone(made)
    true = made.truth.contacts[0]
    speeds = (float(np.hypot(*true.velocity_in)), float(np.hypot(*true.velocity_out)))
    met = [each for each in result.contacts if abs(each.frame - true.frame) < 1]
    return replace(result, contacts=met), speeds, true.restitution


def clips(first: int, seeds: int, kinds: list[str]) -> Iterator[dict[str, Any]]:
    """Yield one row per clip."""
    for seed in range(first, first + seeds):
        for kind in kinds:
            result, speeds, restitution = followed(kind, seed)
            row: dict[str, Any] = {"kind": kind, "seed": seed, "flags": " ".join(result.flags)}
            if result.contacts and result.scale:
                ratio = result.contacts[0].restitution
                row |= {"by": result.scale.source, "u of ruler %": 100 * result.scale.relative_u}
                pairs = [*zip(("v_in", "v_out"), speeds_of(result), speeds, strict=True)]
                for name, said, true in [*pairs, *([("e", ratio, restitution)] if ratio else [])]:
                    row |= {f"{name} %": 100 * (said.value / true - 1)}
                    row |= {f"{name} u %": 100 * said.u / true}
                    row |= {f"{name} z": (said.value - true) / said.u}
            yield row


def summary(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Return one row per kind."""
    table, lines = pd.DataFrame(rows), []
    for kind, some in table.groupby("kind", sort=False):
        complete, silent = some.dropna(subset="v_in z"), some["flags"] == ""
        off = some[["v_in z", "v_out z"]].abs().max(axis=1)
        sure = complete[(complete["by"] == "gravity") & (complete["u of ruler %"] <= 100 * SURE)]
        line = {
            "kind": kind,
            "clips": len(some),
            "no contact": len(some) - len(complete),
            "speeds within 2 u": int((off < 2).sum()),
            "beyond 3 u, no flag": int(((off > 3) & silent).sum()),
            f"clips of u(g) <= {100 * SURE} %": len(sure),
            "median error of v_in %": round(complete["v_in %"].abs().median(), 3),
            "median error of e %": round(complete["e %"].abs().median(), 3),
            "e within 2 u": int((some["e z"].abs() < 2).sum()),
            "e beyond 3 u, no flag": int(((some["e z"].abs() > 3) & silent).sum()),
        }
        for name in ("e", "v_in", "v_out"):
            line[f"rms of {name} %"] = round(float(np.sqrt((complete[f"{name} %"] ** 2).mean())), 3)
            line[f"median u of {name} %"] = round(complete[f"{name} u %"].median(), 3)
            line[f"rms z of {name}"] = round(float(np.sqrt((complete[f"{name} z"] ** 2).mean())), 2)
        lines.append(line)
    return pd.DataFrame(lines)


def main() -> None:
    """Print one line per clip, then one column per kind."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("kinds", nargs="*", choices=[*LIGHTS, *PHONES], default=[*LIGHTS, *PHONES])
    parser.add_argument("--seeds", type=int, default=40)
    parser.add_argument("--from", dest="first", type=int, default=0)
    options = parser.parse_args()
    cv2.setNumThreads(1)
    rows = []
    for row in clips(options.first, options.seeds, options.kinds):
        rows.append(row)
        cells = (f"{each:.3g}" if isinstance(each, float) else str(each) for each in row.values())
        print(" ".join(cells), flush=True)
    print(summary(rows).set_index("kind").T.to_string())


if __name__ == "__main__":
    main()
