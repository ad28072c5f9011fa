"""A tracked clip with its track drawn in: a contact sheet, and a film that a browser plays."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from virtual_lab.video.clips.reading import Frame
from virtual_lab.video.track.tracking import Tracked

__all__ = ["write_film", "write_sheet"]

Image = NDArray[np.uint8]

TILES = (4, 3)  # columns and rows of the sheet
TILE = 400  # pixels, the width of one
FILM = 640  # the greatest width of the film
FRAMES = 80  # of the film, at most
SHIFT = 4  # binary places below a pixel
PLAYED = 60  # ms a frame
INTO, OUT, LEFT = (178, 114, 0), (0, 94, 213), (150, 150, 150)  # blue, green, red


def write_sheet(tracked: Tracked, path: Path) -> None:
    """Write some frames side by side as PNG, those about the contact among them."""
    import cv2

    count = TILES[0] * TILES[1]
    near = int(np.argmin(np.abs(tracked.times - tracked.legs.flight_in.time)))
    about = np.clip(np.arange(near - 2, near + 3), 0, len(tracked.frames) - 1)
    chosen = np.union1d(_spread(tracked, count - 5), about)
    tiles = list(_drawn(tracked, chosen, TILE))
    blank = np.full_like(tiles[0], 255)
    tiles += [blank] * (-len(tiles) % TILES[0])
    edge = (2, 2, 2, 2, cv2.BORDER_CONSTANT)
    framed = [cv2.copyMakeBorder(tile, *edge, value=(255, 255, 255)) for tile in tiles]
    rows = [np.hstack(framed[k : k + TILES[0]]) for k in range(0, len(framed), TILES[0])]
    cv2.imwrite(str(path), np.vstack(rows))


def write_film(tracked: Tracked, path: Path) -> None:
    """Write the frames that show the ball as an animated WebP."""
    import cv2

    animation = cv2.Animation()
    animation.frames = list(
        _drawn(tracked, _spread(tracked, FRAMES), min(FILM, tracked.clip.shape[1]))
    )
    animation.durations = [PLAYED] * len(animation.frames)
    cv2.imwriteanimation(str(path), animation, [cv2.IMWRITE_WEBP_QUALITY, 80])


def _spread(tracked: Tracked, count: int) -> NDArray[np.intp]:
    """Return up to so many of the frames with the ball, spread evenly, in order."""
    last = len(tracked.frames) - 1
    return np.unique(np.linspace(0, last, min(count, last + 1)).round().astype(np.intp))


def _drawn(tracked: Tracked, chosen: NDArray[np.intp], width: int) -> Iterator[Image]:
    """Yield frames with ball, track and time drawn in."""
    index = dict(zip(tracked.frames[chosen].tolist(), chosen.tolist(), strict=True))
    darkest, brightest = _range(tracked)
    for number, frame in tracked.clip.chosen(tracked.frames[chosen]):
        yield _one(tracked, index[number], number, _shown(frame, darkest, brightest), width)


def _one(tracked: Tracked, k: int, number: int, grey: Image, width: int) -> Image:
    import cv2

    scale = width / grey.shape[1]
    size = (width, round(grey.shape[0] * scale))
    small = cv2.resize(grey, size, interpolation=cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR)
    image = cv2.cvtColor(small, cv2.COLOR_GRAY2BGR)
    located, legs = tracked.located, tracked.legs
    for j in range(k + 1):
        if np.isfinite(located.x[j]):
            colour = INTO if legs.used_in[j] else OUT if legs.used_out[j] else LEFT
            centre = _fine(scale, located.x[j], located.y[j])
            cv2.circle(image, centre, 24, colour, -1, cv2.LINE_AA, SHIFT)
    if np.isfinite(located.radius[k]):
        colour = INTO if legs.used_in[k] else OUT if legs.used_out[k] else LEFT
        radius = round(located.radius[k] * scale * 2**SHIFT)
        centre = _fine(scale, located.x[k], located.y[k])
        cv2.circle(image, centre, radius, colour, 1, cv2.LINE_AA, SHIFT)
    words = f"{number}   {1e3 * (tracked.times[k] - legs.flight_in.time):+.2f} ms"
    for shade, thick in (((0, 0, 0), 3), ((255, 255, 255), 1)):
        face = cv2.FONT_HERSHEY_SIMPLEX
        cv2.putText(image, words, (8, size[1] - 10), face, 0.5, shade, thick, cv2.LINE_AA)
    return np.asarray(image, dtype=np.uint8)


def _fine(scale: float, x: float, y: float) -> tuple[int, int]:
    """Return a place of the full frame in a scaled one, as fixed-point numbers."""
    return round(((x + 0.5) * scale - 0.5) * 2**SHIFT), round(((y + 0.5) * scale - 0.5) * 2**SHIFT)


def _range(tracked: Tracked) -> tuple[float, float]:
    some = tracked.clip.samples[:: max(1, len(tracked.clip.samples) // 4)]
    low, high = np.quantile(some, (0.001, 0.9995))
    return float(min(low, 0.2 * high)), float(max(high, low + 1))


def _shown(frame: Frame, darkest: float, brightest: float) -> Image:
    stretched = (frame.astype(np.float32) - darkest) * (255 / (brightest - darkest))
    return np.asarray(np.clip(stretched, 0, 255), dtype=np.uint8)
