"""Film scenes into a folder, with their truth: python -m tests.video.scenery FOLDER [NAME …].

Without names, all scenes are filmed; `large` has 216 frames of 1080p for measuring time.
"""

import json
import sys
from dataclasses import asdict
from pathlib import Path

import numpy as np

from tests.video.scenery.filming import film
from tests.video.scenery.scenes import LARGE, SCENES


def main(folder: Path, names: list[str]) -> None:
    """Film the named scenes, or all scenes."""
    scenes = SCENES | {LARGE.name: LARGE}
    for name in names or SCENES:
        made = film(scenes[name], folder)
        truth = [asdict(each) for each in made.truths]
        beside = folder / f"{name}.truth.json"
        beside.write_text(json.dumps(truth, default=np.ndarray.tolist, indent=1))
        print(made.path)


if __name__ == "__main__":
    main(Path(sys.argv[1]), sys.argv[2:])
