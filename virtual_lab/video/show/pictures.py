"""Pictures of a tracked clip: plot, contact sheet, and a film for a browser."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import cv2
import numpy as np
from numpy.typing import NDArray

from virtual_lab.output.style import as_drawn, page_figure
from virtual_lab.units import Array
from virtual_lab.video.clips.source import Frame
from virtual_lab.video.find.still import warp_back
from virtual_lab.video.follow.following import FollowedClip
from virtual_lab.video.show.course import course_of, names_of, spots

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from virtual_lab.output.page_figure import PageFigure

Image = NDArray[np.uint8]
COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00")  # colors of flights
FACE = cv2.FONT_HERSHEY_SIMPLEX
NONE = "#ff00ff"  # color of positions outside flights, visible in front of any wall


TILE_PX = 1e5  # size of a picture in sheet and plot [pixels]
# number of pictures on the sheet in addition to those near contacts, and approximate number of
# balls in the plot
TILES = 12
FILM_FRAMES, FRAME_MS = 400, 60  # largest number of frames in the film, and duration of each


class Pictures:
    """Small pictures of a ball's course through a clip: sheet, film and plot."""

    def __init__(self, track: FollowedClip) -> None:
        """Read the frames of sheet and plot; searched frames are available as JPEG."""
        self.clip, self.contacts, self.places = track.clip, track.contacts, course_of(track)
        self.names = names_of(self.places)
        self.drift = np.stack([self.places[f"drift_{axis}_px"] for axis in "xy"], axis=1)
        # factor of `y_m` for an upward axis
        self.up = -track.sharp.plane.sense if track.sharp else -1.0
        visible = np.flatnonzero(np.isfinite(self.places["radius_px"]))
        self.balls = visible[_spread(len(visible), TILES)]
        times, steps = self.places["time_s"], np.array([-1, 0, 1])
        near = [int(np.abs(times - e.time.value).argmin()) + steps for e in self.contacts]
        sheet = np.concatenate([_spread(len(times), TILES), *near])
        self.sheet = np.unique(np.clip(sheet, 0, len(times) - 1))
        # The stored frames have 8 bits.
        self.thumbs = track.watched.thumbs if self.clip.samples.dtype == np.uint8 else {}
        self.scale = (TILE_PX / np.prod(self.clip.shape)) ** 0.5
        self.frames = dict(self._pictures(np.union1d(self.sheet, self.balls), self.scale))

    def _pictures(self, places: NDArray[np.intp], scale: float) -> Iterator[tuple[int, Image]]:
        """Yield the index and the scaled frame of each of the positions `places`."""
        rows, columns = (max(1, round(scale * each)) for each in self.clip.shape)
        numbers, light = self.places["frame"][places], self._light()
        rest = self.clip.numbered_frames(np.setdiff1d(numbers, [*self.thumbs]))
        for number in np.unique(numbers):
            jpeg = self.thumbs.get(number)
            frame = next(rest)[1] if jpeg is None else cv2.imdecode(jpeg, cv2.IMREAD_UNCHANGED)
            picture = _display_image(np.asarray(frame), (columns, rows), *light)
            yield from ((int(k), picture) for k in places[numbers == number])

    def _light(self) -> tuple[float, float]:
        """Return the gray values to show as black and as white."""
        samples = self.clip.samples
        if samples.ndim == 4 and samples.dtype == np.uint8:
            return 0.0, 255.0  # a color clip keeps its brightness
        low, high = np.quantile(samples[:: max(1, len(samples) // 4)], (0.001, 0.9995))
        return float(min(low, 0.2 * high)), float(max(high, low + 1))

    def write_sheet(self, path: Path) -> None:
        """Write frames side by side as PNG, including those near contacts.

        The frames of positions far from the flights follow, as enlarged parts around the ball.
        """
        whole, lines = [self._annotate(k, self.frames[k], self.scale) for k in self.sheet], []
        for tiles in filter(None, (whole, [*self._parts()])):
            rows, columns = tiles[0].shape[:2]
            across = max(1, round((1.4 * len(tiles) * rows / columns) ** 0.5))
            lines += [np.hstack(tiles[k : k + across]) for k in range(0, len(tiles), across)]
        wide = max(each.shape[1] for each in lines)
        lines = [
            cv2.warpAffine(e, np.eye(2, 3), (wide, len(e)), borderValue=(255,) * 3) for e in lines
        ]
        cv2.imwrite(str(path), np.vstack(lines))

    def _parts(self) -> Iterator[Image]:
        """Yield enlarged squares around the positions far from the flights, with coordinates."""
        chosen = np.flatnonzero(self.places["far"] > 0)[:TILES]
        side = 2 * int(3 * max(self.places["reach_px"][chosen], default=0.0)) + 1
        factor = -(-int(TILE_PX**0.5) // side)
        for k, picture in self._pictures(chosen, 1.0):
            corner = np.round(spots(self.places)[k] + self.drift[k]).astype(int) - side // 2
            part = cv2.getRectSubPix(picture, (side, side), corner + side // 2.0)
            part = _display_image(part, (side * factor, side * factor), 0, 255)
            part[:, :34], part[-16:] = 255, 255
            for axis, n in np.argwhere((corner[:, None] + np.arange(side)) % 20 == 0):
                at = int((n + 0.5) * factor)
                part.swapaxes(0, 1 - axis)[at] //= 2
                words, place = f"{corner[axis] + n}", ((at + 2, len(part) - 3), (2, at - 2))[axis]
                cv2.putText(part, words, place, FACE, 0.35, (0, 0, 0), 1, cv2.LINE_AA)
            yield self._annotate(k, part, factor, corner)

    def write_film(self, path: Path) -> None:
        """Write the frames that show the ball as an animated WebP."""
        animation, film = cv2.Animation(), _spread(len(self.places), FILM_FRAMES)
        scale = min(1.0, 2 * self.scale)
        animation.frames = [self._annotate(*e, scale) for e in self._pictures(film, scale)]
        animation.durations = [FRAME_MS] * len(film)
        cv2.imwriteanimation(str(path), animation, [cv2.IMWRITE_WEBP_QUALITY, 75])

    def _annotate(self, k: int, picture: Image, scale: float, corner: Array | int = 0) -> Image:
        """Return a frame with its number and time, the ball's outline and earlier positions.

        The upper left corner of the picture is at `corner` [pixels of the clip].
        """
        one, fine, image = self.places[k], 4, picture.copy()  # bits for fractions of a pixel
        # Earlier positions of the still frame are shifted by the drift of this picture.
        at = (spots(self.places) + self.drift[k] - corner + 0.5) * scale - 0.5
        dots = [(j, 2.0, cv2.FILLED) for j in range(k + 1)]
        for j, radius, line in (*dots, (k, float(one["radius_px"]) * scale, 1)):
            if np.isfinite([*at[j], radius]).all():
                x, y, r = (round(2**fine * float(each)) for each in (*at[j], radius))
                bgr = bytes.fromhex(self._colour(self.places["flight"][j])[1:])[::-1]
                cv2.circle(image, (x, y), r, tuple(bgr), line, cv2.LINE_AA, fine)
        strip = np.full((20, image.shape[1], 3), 255, np.uint8)
        words = f"frame {one['frame']}, {one['time_s']:.4g} s"
        # At a scale of 1, "frame 8888, 88.888 s" is 280 pixels long.
        letters = min(0.45, (image.shape[1] - 8) / 280)
        cv2.putText(strip, words, (4, 14), FACE, letters, (0, 0, 0), 1, cv2.LINE_AA)
        return np.pad(np.vstack([strip, image]), ((2, 2), (2, 2), (0, 0)), constant_values=255)

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
        drift = np.append(self.drift[k] * self.scale, [0.0, 0.0])
        return warp_back(self.frames[k], drift, (0, 0), self.frames[k])

    def draw(self, title: str) -> PageFigure:
        """Return a figure of the course: the picture, positions and speeds, residuals."""
        rows, columns = self.clip.shape
        heights = [min(6.0, 7.2 * rows / columns), *(1.3, 1.3, 0.9, 0.9)[: 4 * bool(self.names)]]
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
        axes.set(xlim=extent[:2], ylim=extent[2:], xlabel="x, pixels", ylabel="y, pixels")

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
        labels = ["place, m\n(- -: right, —: up)", "speed\nalong the fit, m/s"]
        labels += [f"residual\n{each}, pixels" for each in ("along", "across")]
        for axes, label in zip((place, speed, along, across), labels, strict=True):
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
    colours = np.ascontiguousarray(np.dstack([frame] * 3)[..., :3])
    small = cv2.resize(colours, size, interpolation=cv2.INTER_AREA)
    return np.interp(small, (black, white), (0, 255)).astype(np.uint8)
