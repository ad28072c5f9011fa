"""All twins, with several seeds, held against their truth: what is wrong, and whether it is said.

python -m tests.video.follow.study [SEEDS] [NAME ...]
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np

from tests.video.follow.twins import require_contacts, require_flights, run
from tests.video.scenery.scenes import SCENES

KINDS = {
    "carried": "carried",
    "pendulum": "pendulum",
    "free-fall": "free-fall",
    "pictures": "free-fall",
    "rolling": "rolling",
    "empty": "none",
}


def main(seeds: int, names: list[str]) -> None:
    """Print a line a clip."""
    cv2.setNumThreads(1)
    for name in names or SCENES:
        for seed in range(seeds):
            scene = replace(SCENES[name], seed=SCENES[name].seed + 100 * seed)
            with tempfile.TemporaryDirectory() as folder:
                made, found = run(scene, Path(folder))
            wrong = []
            if found.motion.kind != KINDS.get(name, "flights"):
                wrong.append(f"{found.motion.kind}!")
            if made.truths:
                for check in (require_flights, require_contacts):
                    try:
                        check(made.truth, found)
                    except AssertionError as fault:
                        wrong.append(f"{check.__name__}: {str(fault).splitlines()[0:1]}")
            far = _far(made, found)
            print(
                f"{name} {scene.seed}: {found.motion.kind}, {len(found.flights)} flights, "
                f"{len(found.contacts)} of {sum(e.seen for t in made.truths for e in t.contacts)}, "
                f"greatest error {far:.1f} u {', '.join(found.flags)} {'; '.join(wrong)}",
                flush=True,
            )


def _far(made, found) -> float:
    """Return the greatest error of a restitution or of a speed at a contact, in u."""
    off = [0.0]
    for contact in found.contacts:
        if not made.truth.contacts:
            return float("inf")
        true = min(made.truth.contacts, key=lambda e: abs(e.frame - contact.frame))
        if contact.restitution:
            off.append(abs(contact.restitution.value - true.restitution) / contact.restitution.u)
        before, after = found.flights[contact.before], found.flights[contact.after]
        for speed, velocity in (
            (before.speed_out, true.velocity_in),
            (after.speed_in, true.velocity_out),
        ):
            off.append(abs(speed.value - float(np.hypot(*velocity))) / speed.u)
    return max(off)


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 1, sys.argv[2:])
