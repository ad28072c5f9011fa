"""Pictures of a tracked clip: plot, contact sheet, and a film for a browser."""

from __future__ import annotations

from collections.abc import Iterable
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.output.style import as_drawn, page_figure
from virtual_lab.video.clips.source import Frame
from virtual_lab.video.find.still import warp_back
from virtual_lab.video.follow.following import FollowedClip
from virtual_lab.video.show.course import course_of, names_of, spots

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from virtual_lab.output.page_figure import PageFigure

Image = NDArray[np.uint8]
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")  # colors of flights
NONE = "#ff00ff"  # color of positions outside flights, visible in front of any wall


TILE_PX = 1e5  # size of a picture in sheet, film and plot [pixels]
# number of pictures on the sheet in addition to those near contacts, and approximate number of
# balls in the plot
TILES = 12
FILM_FRAMES, FRAME_MS = 80, 60  # largest number of frames in the film, and duration of each


class Pictures:
    """Small pictures of a ball's course through a clip: sheet, film and plot."""

    def __init__(self, track: FollowedClip, *, film: bool = False) -> None:
        """Read the frames to show; searched frames are available as JPEG."""
        self.clip, self.contacts, self.places = track.clip, track.contacts, course_of(track)
        self.names = names_of(self.places)
        # factor of `y_m` for an upward axis
        self.up = -track.sharp.plane.sense if track.sharp else -1.0
        self.film = _spread(len(self.places), FILM_FRAMES * film)
        visible = np.flatnonzero(np.isfinite(self.places["radius_px"]))
        self.balls = visible[_spread(len(visible), TILES)]
        times, steps = self.places["time_s"], np.array([-1, 0, 1])
        near = [int(np.abs(times - e.time.value).argmin()) + steps for e in self.contacts]
        sheet = np.concatenate([_spread(len(times), TILES), *near])
        self.sheet = np.unique(np.clip(sheet, 0, len(times) - 1))
        self.scale = (TILE_PX / np.prod(self.clip.shape)) ** 0.5
        rows, columns = (max(1, round(self.scale * each)) for each in self.clip.shape)
        selection = np.concatenate([self.sheet, self.balls, self.film])
        wanted = np.unique(self.places["frame"][selection])
        # The stored frames have 8 bits.
        thumbs = track.watched.thumbs if self.clip.samples.dtype == np.uint8 else {}
        stored = {k: cv2.imdecode(thumbs[k], cv2.IMREAD_UNCHANGED) for k in wanted if k in thumbs}
        left = np.array([each for each in wanted if each not in thumbs], np.intp)
        size, light = (columns, rows), self._light()
        shown = ((int(k), np.asarray(e)) for k, e in chain(stored.items(), self.clip.chosen(left)))
        self.frames = {k: _display_image(frame, size, *light) for k, frame in shown}

    def _light(self) -> tuple[float, float]:
        """Return the gray values to show as black and as white."""
        samples = self.clip.samples
        if samples.ndim == 4 and samples.dtype == np.uint8:
            return 0.0, 255.0  # a color clip keeps its brightness
        low, high = np.quantile(samples[:: max(1, len(samples) // 4)], (0.001, 0.9995))
        return float(min(low, 0.2 * high)), float(max(high, low + 1))

    def write_sheet(self, path: Path) -> None:
        """Write frames side by side as PNG, including those near contacts."""
        edge = ((2, 2), (2, 2), (0, 0))
        tiles = [np.pad(self._annotate(k), edge, constant_values=255) for k in self.sheet]
        rows, columns = tiles[0].shape[:2]
        across = int(np.clip(round(np.sqrt(1.4 * len(tiles) * rows / columns)), 1, len(tiles)))
        tiles += [np.full_like(tiles[0], 255)] * (-len(tiles) % across)
        lines = [np.hstack(tiles[k : k + across]) for k in range(0, len(tiles), across)]
        cv2.imwrite(str(path), np.vstack(lines))

    def write_film(self, path: Path) -> None:
        """Write the frames that show the ball as an animated WebP."""
        animation = cv2.Animation()
        animation.frames = [self._annotate(k) for k in self.film]
        animation.durations = [FRAME_MS] * len(self.film)
        cv2.imwriteanimation(str(path), animation, [cv2.IMWRITE_WEBP_QUALITY, 75])

    def _annotate(self, k: int) -> Image:
        """Return a frame with its number and time, the ball's outline and earlier positions."""
        one, fine = self.places[k], 4  # number of bits for fractions of a pixel
        image = self.frames[int(one["frame"])].copy()
        # Earlier positions of the still frame are shifted by the drift of this picture.
        at = (spots(self.places) + [one["drift_x_px"], one["drift_y_px"]] + 0.5) * self.scale - 0.5
        dots = [(j, 2.0, cv2.FILLED) for j in range(k + 1)]
        for j, radius, line in (*dots, (k, float(one["radius_px"]) * self.scale, 1)):
            if np.isfinite([*at[j], radius]).all():
                x, y, r = (round(2**fine * float(each)) for each in (*at[j], radius))
                bgr = bytes.fromhex(self._colour(self.places["flight"][j])[1:])[::-1]
                cv2.circle(image, (x, y), r, tuple(bgr), line, cv2.LINE_AA, fine)
        strip = np.full((20, image.shape[1], 3), 255, np.uint8)
        words, face = f"frame {one['frame']}, {one['time_s']:.4g} s", cv2.FONT_HERSHEY_SIMPLEX
        longest = cv2.getTextSize("frame 8888, 88.888 s", face, 1.0, 1)[0][0]
        letters = min(0.45, (image.shape[1] - 8) / longest)
        cv2.putText(strip, words, (4, 14), face, letters, (0, 0, 0), 1, cv2.LINE_AA)
        return np.vstack([strip, image])

    def _colour(self, name: str) -> str:
        return COLOURS[self.names.index(name) % len(COLOURS)] if name else NONE

    def strobe(self) -> Image:
        """Return one picture with the ball at several positions."""
        # The background, including a bat, is that of the first contact.
        times = self.places["time_s"][self.sheet]
        time = self.contacts[0].time.value if self.contacts else times[0]
        whole = self._still(self.sheet[np.abs(times - time).argmin()]).copy()
        rows, columns = np.ogrid[: whole.shape[0], : whole.shape[1]]
        for k in self.balls:
            x, y = (spots(self.places)[k] + 0.5) * self.scale - 0.5
            reach = (self.places["reach_px"][k] + 2) * self.scale
            inside = np.hypot(columns - x, rows - y) < reach
            whole[inside] = self._still(k)[inside]
        return whole[..., ::-1]

    def _still(self, k: int) -> Image:
        """Return a picture moved back to the still frame."""
        one = self.places[k]
        picture = self.frames[int(one["frame"])]
        drift = np.array([one["drift_x_px"], one["drift_y_px"], 0.0, 0.0]) * self.scale
        return warp_back(picture, drift, (0, 0), picture)

    def draw(self, title: str) -> PageFigure:
        """Return a figure of the course: the picture, positions and speeds, residuals."""
        rows, columns = self.clip.shape
        heights = [min(6.0, 7.2 * rows / columns)]
        heights += [1.3, 1.3, 0.9, 0.9] if self.names else []
        with page_figure(sum(heights) + 1.2, 7.6) as figure:
            axes = figure.subplots(len(heights), 1, height_ratios=heights, squeeze=False)[:, 0]
            self._draw_picture(axes[0])
            if self.names:
                self._draw_motion(axes[1:])
            figure.legend(loc="outside lower center", ncols=6, markerscale=1.5)
            figure.suptitle(as_drawn(title), fontsize=9, wrap=True)
        return figure

    def _draw_picture(self, axes: Axes) -> None:
        rows, columns = self.clip.shape
        extent = (-0.5, columns - 0.5, rows - 0.5, -0.5)
        axes.imshow(self.strobe(), extent=extent, interpolation="antialiased")
        flight = self.places["flight"]
        for name in [*self.names, *({""} & set(flight.tolist()))]:
            label = f"flight {name}" if name else "left out" if self.names else "seen"
            x, y = spots(self.places)[flight == name].T
            axes.plot(x, y, ".", color=self._colour(name), markersize=3, label=label)
        for k, each in enumerate(self.contacts):
            label = "_" if k else "contact"
            axes.plot(*each.place, "k+", markersize=8, markeredgewidth=1.2, label=label)
        axes.set(xlim=(-0.5, columns - 0.5), ylim=(rows - 0.5, -0.5))
        axes.set(xlabel="x, pixels", ylabel="y, pixels")

    def _draw_motion(self, below: Iterable[Axes]) -> None:
        """Plot positions (right and up), speeds, and residuals of the fit against the frame."""
        place, speed, along, across = below
        metres = np.stack([self.places["x_m"], self.up * self.places["y_m"]])
        metres -= metres[:, np.isfinite(metres).all(axis=0)][:, :1]
        for name in self.names:
            used, colour = self.places["flight"] == name, self._colour(name)
            some, (right, up) = self.places[used], metres[:, used]
            frame, noise = some["frame"], (some["x_u_px"] + some["y_u_px"]) / 2
            place.plot(frame, right, "--", frame, up, "-", color=colour)
            speed.plot(frame, np.hypot(some["right_m_per_s"], some["up_m_per_s"]), color=colour)
            for axes, off in ((along, some["along_px"]), (across, some["across_px"])):
                axes.errorbar(frame, off, noise, fmt=".", color=colour, markersize=4, linewidth=0.6)
        speed.set_ylim(bottom=0.0)
        across.set_xlabel("frame (bars: u; 1 m/s = 2.24 mph)")
        for axes, label in (
            (place, "place, m\n(- -: right, —: up)"),
            (speed, "speed\nalong the fit, m/s"),
            (along, "residual\nalong, pixels"),
            (across, "residual\nacross, pixels"),
        ):
            axes.sharex(place)
            axes.set_ylabel(label)
            axes.tick_params(labelbottom=axes is across)
            axes.grid(True, linewidth=0.3)
            for each in self.contacts:
                axes.axvline(each.frame, color="k", linewidth=0.8, zorder=0)


def _spread(places: int, count: int) -> NDArray[np.intp]:
    """Return up to `count` evenly spaced indices of `places` positions, in order."""
    return np.unique(np.linspace(0, places - 1, min(count, places)).round()).astype(np.intp)


def _display_image(frame: Frame, size: tuple[int, int], black: float, white: float) -> Image:
    """Return a frame with 8 bits and three colors, reduced to the given width and height."""
    way = cv2.INTER_AREA if size[0] < frame.shape[1] else cv2.INTER_LINEAR
    colours = frame if frame.ndim == 2 else np.ascontiguousarray(frame[..., :3])
    small = cv2.resize(colours, size, interpolation=way)
    picture = np.interp(small, (black, white), (0, 255)).astype(np.uint8)
    return np.dstack([picture] * 3) if picture.ndim == 2 else picture
