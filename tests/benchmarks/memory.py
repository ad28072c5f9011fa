"""Growth of memory in a large batch of collisions. Run in a separate process, prints bytes."""

from __future__ import annotations

import sys
from pathlib import Path

__all__ = ["main"]

SEED = 7


def main(count: int) -> None:
    """Collide a few scenes so that everything is loaded; print the growth due to `count` scenes."""
    from tests.benchmarks.scenes import NARROW, default_model

    model = default_model("r161")
    scenes = NARROW.draw(count, SEED)
    model.collide(scenes.part(slice(0, 64)))
    before = _status("VmRSS")
    collisions = model.collide(scenes)
    print(_status("VmHWM") - before)
    del collisions


def _status(key: str) -> int:
    """Return an entry of the process status [B].

    The peak of `resource` would include that of the parent process.
    """
    lines = Path("/proc/self/status").read_text("utf-8").splitlines()
    return next(int(line.split()[1]) * 1024 for line in lines if line.startswith(key + ":"))


if __name__ == "__main__":
    main(int(sys.argv[1]))
