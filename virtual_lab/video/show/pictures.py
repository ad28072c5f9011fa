"""A tracked clip drawn: the plot, a contact sheet, and a film that a browser plays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from itertools import chain
from pathlib import Path
from textwrap import fill
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.output.style import STYLE, as_drawn
from virtual_lab.video.clips.reading import Frame
from virtual_lab.video.find.still import moved_back
from virtual_lab.video.show.course import BallCourse

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Image = NDArray[np.uint8]
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")  # of flights


@dataclass(frozen=True, slots=True, kw_only=True)
class Layout:
    """How large pictures are, and how many."""

    tiles: int = 24  # of the sheet, at most
    sheet_px: float = 3.6e6  # all of it
    tile_width_px: int = 400  # at most
    film_px: float = 2.4e5  # a picture of it
    film_frames: int = 80  # at most
    frame_ms: int = 60
    strip_px: int = 20  # above a picture, for its frame and time
    fine_bits: int = 4  # binary places below a pixel
    balls: int = 14  # drawn into one picture, about
    title_letters: int = 105  # in a line


LAYOUT = Layout()


@dataclass(frozen=True, slots=True, kw_only=True)
class Pictures:
    """Frames of a clip as they are shown, made smaller by a factor."""

    frames: dict[int, Image]  # by number, (row, column, 3)
    scale: float
    sheet: list[int]  # places of the course that the sheet shows
    film: list[int]


def pictures_of(course: BallCourse, thumbs: Mapping[int, Image]) -> Pictures:
    """Return the frames that sheet and film show, out of small JPEGs; others are read."""
    sheet, film = _for_sheet(course), _spread(len(course.frames), LAYOUT.film_frames)
    rows, columns = course.clip.shape
    tile_px = LAYOUT.sheet_px / len(sheet)
    scale = min(LAYOUT.tile_width_px / columns, np.sqrt(tile_px / (rows * columns)))
    wanted = np.unique(course.frames[sorted({*sheet, *film})])
    low, high = _range(course)
    size = (max(1, round(columns * scale)), max(1, round(rows * scale)))
    way = cv2.INTER_AREA if scale < 1 else cv2.INTER_LINEAR
    eight_bits = course.clip.samples.dtype == np.uint8  # as thumbs have
    kept = [int(each) for each in wanted if each in thumbs and eight_bits]
    small = {k: np.asarray(cv2.imdecode(thumbs[k], cv2.IMREAD_UNCHANGED)) for k in kept}
    left = np.array([each for each in wanted if each not in small], np.intp)
    frames = {
        number: np.asarray(cv2.resize(_shown(frame, low, high), size, interpolation=way), np.uint8)
        for number, frame in chain(small.items(), course.clip.chosen(left))
    }
    return Pictures(frames=frames, scale=float(scale), sheet=sheet, film=film)


def write_sheet(course: BallCourse, pictures: Pictures, path: Path) -> None:
    """Write frames side by side as PNG, those about flights' ends and contacts among them."""
    tiles = [_one(course, pictures, k, pictures.scale) for k in pictures.sheet]
    rows, columns = tiles[0].shape[:2]
    across = int(np.clip(round(np.sqrt(1.4 * len(tiles) * rows / columns)), 1, len(tiles)))
    blank = np.full_like(tiles[0], 255)
    tiles += [blank] * (-len(tiles) % across)
    edge = (2, 2, 2, 2, cv2.BORDER_CONSTANT)
    framed = [cv2.copyMakeBorder(tile, *edge, value=(255, 255, 255)) for tile in tiles]
    lines = [np.hstack(framed[k : k + across]) for k in range(0, len(framed), across)]
    cv2.imwrite(str(path), np.vstack(lines))


def write_film(course: BallCourse, pictures: Pictures, path: Path) -> None:
    """Write the frames that show the ball as an animated WebP."""
    rows, columns = course.clip.shape
    scale = min(pictures.scale, float(np.sqrt(LAYOUT.film_px / (rows * columns))))
    animation = cv2.Animation()
    animation.frames = [_one(course, pictures, k, scale) for k in pictures.film]
    animation.durations = [LAYOUT.frame_ms] * len(animation.frames)
    cv2.imwriteanimation(str(path), animation, [cv2.IMWRITE_WEBP_QUALITY, 75])


def _for_sheet(course: BallCourse) -> list[int]:
    """Return places about contacts, at the ends and in the middle of flights, others between."""
    last = len(course.frames) - 1
    chosen: list[int] = []
    for time, _, _ in course.contacts:
        near = int(np.argmin(np.abs(course.times - time)))
        chosen += [each for each in range(near - 1, near + 2) if 0 <= each <= last]
    for name in course.flights:
        own = np.flatnonzero(course.of(name))
        chosen += [int(own[0]), int(own[len(own) // 2]), int(own[-1])]
    chosen = list(dict.fromkeys(chosen))
    for count in (12, 16, LAYOUT.tiles):
        if len(chosen) < count // 2 + 6:
            break
    chosen = list(dict.fromkeys(chosen + _spread(last + 1, count)))[:count]
    return sorted(chosen)


def _spread(places: int, count: int) -> list[int]:
    """Return up to so many of the places, spread evenly, in order."""
    chosen = np.linspace(0, places - 1, min(count, places)).round()
    return [int(each) for each in np.unique(chosen)]


def _one(course: BallCourse, pictures: Pictures, k: int, scale: float) -> Image:
    image = pictures.frames[int(course.frames[k])]
    if scale != pictures.scale:
        high, wide = (max(1, round(side * scale)) for side in course.clip.shape)
        image = np.asarray(cv2.resize(image, (wide, high), interpolation=cv2.INTER_AREA), np.uint8)
    image = image.copy()
    names, fine = course.flights, 2**LAYOUT.fine_bits
    circles = [(j, 24, -1) for j in range(k + 1) if np.isfinite(course.xy[j]).all()]
    if np.isfinite(course.radius[k]):
        circles.append((k, round(course.radius[k] * scale * fine), 1))
    for j, radius, line in circles:
        # earlier places lie where the still frame has them in this picture
        u, v = ((course.xy[j] + course.drift[k] + 0.5) * scale - 0.5) * fine
        at, colour = (round(u), round(v)), _colour(course, names, j)
        cv2.circle(image, at, radius, colour, line, cv2.LINE_AA, LAYOUT.fine_bits)
    return np.vstack([_label(f"{int(course.frames[k])}: {course.times[k]:.4g} s", image), image])


def _label(words: str, image: Image) -> Image:
    """Return a strip as wide as an image with words that fit into it."""
    strip = np.full((LAYOUT.strip_px, image.shape[1], 3), 255, np.uint8)
    face, letters = cv2.FONT_HERSHEY_SIMPLEX, 0.5
    wide = cv2.getTextSize(words, face, letters, 1)[0][0]
    letters *= min(1.0, (strip.shape[1] - 8) / wide)
    cv2.putText(strip, words, (4, LAYOUT.strip_px - 6), face, letters, (0, 0, 0), 1, cv2.LINE_AA)
    return strip


def _colour(course: BallCourse, names: list[str], k: int) -> tuple[int, ...]:
    """Return the colour of a place as OpenCV has it, blue first."""
    if not (name := course.flight[k]):
        return 150, 150, 150
    return tuple(bytes.fromhex(COLOURS[names.index(name) % len(COLOURS)][1:]))[::-1]


def _range(course: BallCourse) -> tuple[float, float]:
    samples = course.clip.samples
    if samples.ndim == 4 and samples.dtype == np.uint8:
        return 0.0, 255.0  # a colour clip is as its maker wants it seen
    some = samples[:: max(1, len(samples) // 4)]
    low, high = np.quantile(some, (0.001, 0.9995))
    return float(min(low, 0.2 * high)), float(max(high, low + 1))


def _shown(frame: Frame, darkest: float, brightest: float) -> Image:
    """Return a frame in 8 bits and three colours."""
    if (darkest, brightest) == (0.0, 255.0) and frame.dtype == np.uint8:
        seen = frame
    else:
        stretched = (frame.astype(np.float32) - darkest) * (255 / (brightest - darkest))
        seen = np.clip(stretched, 0, 255).astype(np.uint8)
    if seen.ndim == 2 or seen.shape[2] == 1:
        return np.repeat(seen.reshape(*seen.shape[:2], 1), 3, axis=2)
    return np.ascontiguousarray(seen[..., :3])


def draw_track(course: BallCourse, pictures: Pictures, title: str, path: Path) -> None:
    """Draw a tracked clip as PNG."""
    from matplotlib import style
    from matplotlib.figure import Figure

    with style.context(STYLE, after_reset=True):
        rows, columns = course.clip.shape
        high = min(6.0, 7.2 * rows / columns)
        figure = Figure(figsize=(7.6, high + 5.6), dpi=150, layout="constrained")
        heights = (high, 1.3, 1.3, 0.9, 0.9)
        picture, place, speed, along, across = figure.subplots(5, 1, height_ratios=heights)
        _picture(picture, course, pictures)
        _motion(place, speed, course)
        _residuals(along, across, course)
        wrapped = "\n".join(fill(line, LAYOUT.title_letters) for line in title.splitlines())
        figure.suptitle(as_drawn(wrapped), fontsize=9)
        figure.savefig(path, pil_kwargs={"compress_level": 3})


def strobe(course: BallCourse, pictures: Pictures) -> NDArray[np.uint8]:
    """Return one picture that shows the ball at several of its places, as small as they are."""
    shown = [k for k in range(len(course.frames)) if int(course.frames[k]) in pictures.frames]
    seen = [k for k in shown if np.isfinite(course.radius[k])]
    chosen = seen[:: max(1, len(seen) // LAYOUT.balls)]
    scale = pictures.scale
    # what stands about, a bat too, is shown as it is at a contact
    time = course.contacts[0][0] if course.contacts else float(course.times[0])
    stands = min(shown, key=lambda k: abs(course.times[k] - time))
    whole = _still(pictures, course, stands).copy()
    rows, columns = np.ogrid[: whole.shape[0], : whole.shape[1]]
    for k in chosen:
        x, y = (course.xy[k] + 0.5) * scale - 0.5
        inside = np.hypot(columns - x, rows - y) < (course.reach[k] + 2) * scale
        whole[inside] = _still(pictures, course, k)[inside]
    return whole[..., ::-1]


def _still(pictures: Pictures, course: BallCourse, k: int) -> NDArray[np.uint8]:
    """Return a picture where the still frame has it."""
    picture = pictures.frames[int(course.frames[k])]
    drift = np.append(course.drift[k] * pictures.scale, (0.0, 0.0))
    return moved_back(picture, drift, (0, 0), picture)


def _picture(axes: Axes, course: BallCourse, pictures: Pictures) -> None:
    rows, columns = course.clip.shape
    extent = (-0.5, columns - 0.5, rows - 0.5, -0.5)
    axes.imshow(strobe(course, pictures), extent=extent, interpolation="antialiased")
    names = course.flights
    for k, name in enumerate([*names, ""]):
        used = course.of(name)
        if used.any():
            colour = COLOURS[k % len(COLOURS)] if name else "0.45"
            label = name or ("left out" if names else "seen")
            axes.plot(*course.xy[used].T, ".", color=colour, markersize=3, label=label)
    for k, (_, x, y) in enumerate(course.contacts):
        mark = "contact" if k == 0 else None
        axes.plot(x, y, "+", color="k", markersize=8, markeredgewidth=1.2, label=mark)
    axes.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
    axes.set(xlabel="x, pixels", ylabel="y, pixels")
    axes.legend(
        loc="upper left",
        bbox_to_anchor=(0.0, 1.0) if columns > rows else (1.02, 1.0),
        facecolor="white",
        framealpha=0.75,
        frameon=True,
        edgecolor="none",
        ncols=5 if columns > rows else 1,
        markerscale=1.5,
    )


def _motion(place: Axes, speed: Axes, course: BallCourse) -> None:
    """Draw places and speeds over the clip's time, of an axis to the right and one up."""
    start = course.metres[np.isfinite(course.metres).all(axis=1)][:1]
    for k, name in enumerate(course.flights):
        used, colour = course.of(name), COLOURS[k % len(COLOURS)]
        t, off = course.times[used], (course.metres[used] - start) * [1, course.up]
        place.plot(t, off[:, 0], "--", t, off[:, 1], "-", color=colour, linewidth=1.0)
        speed.plot(t, np.hypot(*course.velocity[used].T), color=colour, linewidth=1.0)
    place.set_ylabel("place, m\n(- -: right, —: up)")
    speed.set_ylabel("speed\nalong the fit, m/s")
    speed.set_ylim(bottom=0.0)
    speed.set_xlabel("time, s")
    place.tick_params(labelbottom=False)
    for axes in (place, speed):
        axes.grid(True, linewidth=0.3)
        for time, _, _ in course.contacts:
            axes.axvline(time, color="k", linewidth=0.8, zorder=0)


def _residuals(along: Axes, across: Axes, course: BallCourse) -> None:
    origin = course.contacts[0][0] if course.contacts else float(course.times[0])
    for k, name in enumerate(course.flights):
        used = course.of(name)
        t = 1e3 * (course.times[used] - origin)
        noise = course.u[used].mean(axis=1)
        for axes, off in zip((along, across), course.residuals[used].T, strict=True):
            colour = COLOURS[k % len(COLOURS)]
            axes.errorbar(t, off, noise, fmt=".", color=colour, markersize=4, linewidth=0.6)
    for axes, name in ((along, "along"), (across, "across")):
        axes.axhline(0, color="0.6", linewidth=0.6, zorder=0)
        for time, _, _ in course.contacts:
            axes.axvline(1e3 * (time - origin), color="k", linewidth=0.8, zorder=0)
        axes.set_ylabel(f"off the flight\n{name}, pixels")
        axes.grid(True, linewidth=0.3)
    along.tick_params(labelbottom=False)
    across.set_xlabel(f"time from the {'first contact' if course.contacts else 'start'}, ms")
