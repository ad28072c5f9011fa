"""The search for blobs, once per clip, for tests of the steps that follow it."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.find.watching import Watched, watch
from virtual_lab.video.follow import following

__all__ = ["searching_once"]


@contextmanager
def searching_once() -> Iterator[None]:
    """Let the tracker search a clip for blobs only if it has not searched an equal clip before."""
    found: dict[tuple[str | bytes, ...], Watched] = {}

    def once(clip: Clip, *, progress: Callable[[str], None], **options: Any) -> Watched:
        key = clip.source.path.name, str(options), clip.samples.tobytes(), clip.times.tobytes()
        if key not in found:
            found[key] = watch(clip, progress=progress, **options)
        return found[key]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(following, "watch", once)
        yield
