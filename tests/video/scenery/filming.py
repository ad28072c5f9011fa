"""A camera films a scene: exposure by exposure, and row by row if its shutter rolls.

Light adds up in linear shares; everything else is in gray values after the gamma, where a
change of the light is a factor, too.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter1d

from tests.video.scenery import motion
from tests.video.scenery.backdrop import paint
from tests.video.scenery.ball import sphere
from tests.video.scenery.hand import SKIN, hand_shares
from tests.video.scenery.scene import (
    Actor,
    BallTruth,
    Frames,
    Made,
    Scene,
    TrueContact,
    TrueFlight,
)
from tests.video.scenery.storing import stored_exposures, write

__all__ = ["film", "moved", "pictures"]

Array = NDArray[np.float64]
Image = NDArray[np.float32]

SWAY = 0.3  # correlation time of the hand that holds the camera [s]
FASTEST = 0.95  # largest drift [px per frame]
MAINS = 100.3  # frequency of lamps [Hz]
WINDOW = (0.05, 0.45, 0.62, 0.92)  # ends of the window, as shares of rows and columns
BESIDE = 2.0  # distance from the outline within which a hand counts as touching the ball [px]


def film(scene: Scene, folder: Path) -> Made:
    """Film a scene into a folder, and return the file with its truth."""
    filmed = _Filmed(scene)
    exposures = stored_exposures(scene.stored, scene.count, scene.seed)
    path = write(scene, filmed.pictures(exposures), folder, exposures)
    times = filmed.time(exposures)
    return Made(
        path=path,
        scene=scene,
        exposures=exposures,
        times=times,
        drift=filmed.drift_at(times),
        truths=tuple(
            filmed.truth(actor, path, exposures)
            for actor, path in zip(scene.actors, filmed.paths, strict=True)
        ),
    )


def pictures(scene: Scene) -> Iterator[NDArray[np.uint8]]:
    """Yield the exposures of a scene before any codec, none repeated or left out."""
    return _Filmed(scene).pictures(np.arange(scene.count))


def moved(scene: Scene, places: Array, exposures: NDArray[np.intp]) -> Array:
    """Return positions (exposure, place, 2) in exposures of still-frame points (place, 2)."""
    filmed = _Filmed(scene)
    return filmed.moved(places, filmed.time(exposures)[:, None])


@dataclass
class _Lens:
    """Pinhole that maps positions in the plane of the balls [m] to pixels of the still frame."""

    scene: Scene

    def __post_init__(self) -> None:
        phone = self.scene.phone
        pitch, yaw = np.radians([phone.pitch, phone.yaw])
        down = np.array(
            [[1, 0, 0], [0, np.cos(pitch), -np.sin(pitch)], [0, np.sin(pitch), np.cos(pitch)]]
        )
        right = np.array([[np.cos(yaw), 0, -np.sin(yaw)], [0, 1, 0], [np.sin(yaw), 0, np.cos(yaw)]])
        self.turned = down @ right
        self.middle = (np.array(self.scene.size) - 1) / 2

    def seen(self, x: Array, y: Array, z: float | Array = 0.0) -> Array:
        """Return positions in the camera's axes, (..., 3); z is depth behind the balls' plane."""
        x, y, z = np.broadcast_arrays(x, y, z)
        return np.stack([x, y, z], axis=-1) @ self.turned.T + [0, 0, self.scene.phone.distance]

    def project(self, position: Array) -> Array:
        """Return the pixels of the still frame, (..., 2)."""
        return self.middle + self.scene.phone.focal * position[..., :2] / position[..., 2:]

    def rays(self, still: Array) -> Array:
        """Return the rays through pixels of the still frame, (..., 3)."""
        flat = (still - self.middle) / self.scene.phone.focal
        return np.concatenate([flat, np.ones((*flat.shape[:-1], 1))], axis=-1)


class _Filmed:
    """Scene with the motions of camera, balls and hands over time."""

    def __init__(self, scene: Scene) -> None:
        self.scene, self.lens = scene, _Lens(scene)
        self.rng = np.random.default_rng(scene.seed)
        self.shape = (scene.size[1], scene.size[0])
        until = (scene.count + 1) / scene.fps + scene.phone.readout
        self.paths = [actor.motion.path(actor.ball, until) for actor in scene.actors]
        self.clock = np.arange(0, until + 1e-3, 1e-3)
        self.drift = self._drift()
        self.turn = self._turn()
        turned = np.abs(self.turn - 1).max() * max(scene.size) / 2
        far = 1.0
        if scene.phone.turns:  # a turn moves the corners farther than the middle
            far += 2 * (max(scene.size) / 2 / scene.phone.focal) ** 2
        self.margin = int(np.ceil(far * np.abs(self.drift).max() + turned)) + 3
        self.behind = paint(scene.backdrop, scene.size, self._edge(), self.rng, self.margin)
        wide, high = scene.size
        self.grain = scene.phone.noise * self.rng.standard_normal(
            (2, high + 64, wide + 64, 3), np.float32
        )

    def time(self, exposures: NDArray[np.intp]) -> Array:
        """Return the middle of the exposure of the first row [s]."""
        return (exposures + 0.5) / self.scene.fps

    def drift_at(self, time: Array) -> Array:
        """Return the displacement of the picture, (..., 2) [px]."""
        return np.stack([np.interp(time, self.clock, self.drift[:, k]) for k in (0, 1)], axis=-1)

    def moved(self, still: Array, time: Array) -> Array:
        """Return the positions in the picture of points of the still frame, (..., 2) [px]."""
        middle = self.lens.middle
        turned = (still - middle) @ [1, 1j] * np.interp(time, self.clock, self.turn)
        off = np.stack([turned.real, turned.imag], axis=-1)
        if self.scene.phone.turns:
            return middle + self._turned(off, self.drift_at(time), back=False)
        return middle + off + self.drift_at(time)

    def unmoved(self, picture: Array, time: Array) -> Array:
        """Return the points of the still frame at these positions in the picture, (..., 2) [px]."""
        middle = self.lens.middle
        moved = picture - middle
        if self.scene.phone.turns:
            moved = self._turned(moved, self.drift_at(time), back=True)
        else:
            moved = moved - self.drift_at(time)
        turned = moved @ [1, 1j] / np.interp(time, self.clock, self.turn)
        return middle + np.stack([turned.real, turned.imag], axis=-1)

    def _turned(self, off: Array, drift: Array, *, back: bool) -> Array:
        """Return offsets from the middle, (..., 2) [px], after a turn that drifts the middle."""
        focal = self.scene.phone.focal
        across, down = np.arctan(np.moveaxis(drift, -1, 0) / focal) * (-1 if back else 1)
        x, y, z = np.moveaxis(self.lens.rays(off + self.lens.middle), -1, 0)
        for axis in ("down", "across") if back else ("across", "down"):
            if axis == "across":
                x, z = (
                    np.cos(across) * x + np.sin(across) * z,
                    np.cos(across) * z - np.sin(across) * x,
                )
            else:
                y, z = np.cos(down) * y + np.sin(down) * z, np.cos(down) * z - np.sin(down) * y
        return focal * np.stack([x / z, y / z], axis=-1)

    def pictures(self, exposures: NDArray[np.intp]) -> Iterator[NDArray[np.uint8]]:
        """Yield the pictures of these exposures; a repeated exposure gives the same picture."""
        last, picture = -1, None
        for exposure in exposures:
            if exposure != last:
                last, picture = exposure, self._picture(int(exposure))
            yield picture

    def truth(self, actor: Actor, path: motion.Path, exposures: NDArray[np.intp]) -> BallTruth:
        frames = self._frames(actor, path, exposures)
        start = frames.time
        once = np.flatnonzero(~frames.repeat)
        little = 1e-4  # small displacement [m]
        here, right, down = (
            self._still(np.array(place)) for place in ((0, 0), (little, 0), (0, little))
        )
        scale = little / np.linalg.norm(right - here)
        fall = (down - here) / little
        readable, flights = frames.readable, []
        for flight in path.flights:
            inside = readable & (start > flight.start) & (start < flight.end)
            if inside.any():
                numbers = np.flatnonzero(inside)
                flights.append(
                    TrueFlight(
                        first_frame=int(numbers[0]),
                        last_frame=int(numbers[-1]),
                        places=len(numbers),
                        start=flight.start,
                        end=flight.end,
                        velocity_start=flight.velocity_start,
                        velocity_end=flight.velocity_end,
                    )
                )
        contacts = tuple(
            TrueContact(
                time=contact.time,
                frame=float(np.interp(contact.time, start[once], once)),
                kind=contact.kind,
                seen=bool(self._whole(actor, path, np.array(contact.time))),
                restitution=contact.restitution,
                velocity_in=contact.velocity_in,
                velocity_out=contact.velocity_out,
            )
            for contact in path.contacts
            if contact.time < start[-1]
        )
        gx, gy = motion.GRAVITY * fall
        return BallTruth(
            frames=frames,
            flights=tuple(flights),
            contacts=contacts,
            metres_per_pixel=float(scale),
            gravity_px=(float(gx), float(gy)),
            gravity=motion.GRAVITY,
            drag_per_metre=actor.ball.drag_per_metre,
            diameter=actor.ball.diameter,
        )

    def _frames(self, actor: Actor, path: motion.Path, exposures: NDArray[np.intp]) -> Frames:
        scene, rows = self.scene, self.shape[0]
        t = self.time(exposures)
        time = t
        for _ in range(8):  # iterations: the row of the ball sets the time of its reading
            x, y = path.at(time)
            position = self.lens.seen(x, y)
            still = self.lens.project(position)
            picture = self.moved(still, time)
            row = np.clip(picture[:, 1], 0, rows - 1)
            time = t + scene.phone.readout * row / (rows - 1)
        radius, half = self._radius(actor, position), scene.exposure / 2
        breaks = [start for start, _ in path.phases[1:]] + [c.time for c in path.contacts]
        late = np.array(breaks)[:, None] - time
        touched = np.zeros(len(t), bool)
        if path.hand is not None:
            for k in range(len(t)):
                touched[k] = self._touched(actor, path, float(time[k]), picture[k], radius[k])
        for other, its in zip(scene.actors, self.paths, strict=True):
            if other is not actor:
                beside = self.lens.seen(*its.at(time))
                away = np.hypot(*(self.lens.project(beside) - still).T)
                touched |= away < radius + self._radius(other, beside) + BESIDE
        return Frames(
            exposure=exposures,
            time=time,
            x=still[:, 0],
            y=still[:, 1],
            picture_x=picture[:, 0],
            picture_y=picture[:, 1],
            radius=radius,
            phase=tuple(path.phase(each) for each in time),
            whole=self._whole(actor, path, time - half) & self._whole(actor, path, time + half),
            touched=touched,
            contact=(np.abs(late) <= half).any(axis=0),
            repeat=np.append(False, np.diff(exposures) == 0),
        )

    def _whole(self, actor: Actor, path: motion.Path, time: Array) -> NDArray[np.bool_]:
        """Return a mask of the times at which the whole ball, plus a pixel, is in the picture."""
        position = self.lens.seen(*path.at(time))
        reach = self._radius(actor, position)[..., None] + 1
        at, last = self.moved(self.lens.project(position), time), np.array(self.scene.size) - 1
        return ((at >= reach) & (at <= last - reach)).all(axis=-1)

    def _radius(self, actor: Actor, position: Array) -> Array:
        return self.scene.phone.focal * actor.ball.radius / position[..., 2]

    def _still(self, place: Array) -> Array:
        return self.lens.project(self.lens.seen(*place))

    def _touched(
        self, actor: Actor, path: motion.Path, time: float, at: Array, radius: float
    ) -> bool:
        drawn = self._hand(actor, path, time)
        if drawn is None:
            return False
        behind, before, (rows, columns) = drawn
        row, column = np.ogrid[rows, columns]
        near = np.hypot(column - at[0], row - at[1]) < radius + BESIDE
        return bool((np.maximum(behind, before)[near] > 0.1).any())

    def _edge(self) -> tuple[float, float] | None:
        """Return the rows at which wall and floor meet at the picture's left and right ends."""
        if self.scene.floor is None:
            return None
        ends = self.lens.project(
            self.lens.seen(np.array([-0.5, 0.5]), self.scene.floor, self.scene.wall_behind)
        )
        slope = (ends[1, 1] - ends[0, 1]) / (ends[1, 0] - ends[0, 0])
        left = ends[0, 1] - slope * ends[0, 0]
        return float(left), float(left + slope * self.scene.size[0])

    def _drift(self) -> Array:
        """Return a smooth random walk with the phone's extent of drift, not faster than FASTEST."""
        wanted = self.scene.phone.drift
        panned = self.scene.phone.pan * self.clock[:, None] * [-1.0, 0.0]
        if not wanted:
            return panned
        steps = self.rng.standard_normal((len(self.clock), 2))
        walk = gaussian_filter1d(np.cumsum(steps, axis=0), SWAY * 1000, axis=0, mode="nearest")
        walk *= wanted / np.ptp(walk, axis=0).max()
        speed = np.abs(np.gradient(walk, self.clock, axis=0)).max() / self.scene.fps
        walk *= min(1.0, FASTEST / speed)
        return walk - walk[0] + panned

    def _turn(self) -> NDArray[np.complex128]:
        """Return a smooth random walk of growth and turn, a complex factor of offsets."""
        phone = self.scene.phone
        wanted = np.array([phone.growth, np.radians(phone.turn)])
        if not wanted.any():
            return np.ones(len(self.clock), complex)
        steps = np.random.default_rng([self.scene.seed, 1]).standard_normal((len(self.clock), 2))
        walk = gaussian_filter1d(np.cumsum(steps, axis=0), SWAY * 1000, axis=0, mode="nearest")
        walk *= wanted / np.ptp(walk, axis=0)
        return 1 + (walk - walk[0]) @ [1, 1j]

    def _picture(self, exposure: int) -> NDArray[np.uint8]:
        scene, phone = self.scene, self.scene.phone
        rng = np.random.default_rng([scene.seed, exposure])
        time = float(self.time(np.array(exposure)))
        picture = self._moved_background(time)
        light = 1 + phone.flicker * np.sin(2 * np.pi * 1.7 * time) * rng.uniform(0.3, 1)
        mains = float(np.sin(2 * np.pi * MAINS * time) * np.sinc(MAINS * scene.exposure))
        light *= 1 + phone.mains * mains
        top, bottom, left, right = (
            round(share * side)
            for share, side in zip(WINDOW, np.repeat(self.shape, 2), strict=True)
        )
        picture[top:bottom, left:right] *= (1 + phone.window * mains) ** (1 / phone.gamma)
        for actor, path in zip(scene.actors, self.paths, strict=True):
            self._shadows(picture, actor, path, time)
        for actor, path in zip(scene.actors, self.paths, strict=True):
            self._draw(picture, actor, path, time)
        picture *= light ** (1 / phone.gamma)
        rows, columns = self.shape
        bank, top, left = rng.integers(0, [2, 64, 64])
        grain = self.grain[bank, top : top + rows, left : left + columns]
        return cv2.add(picture, grain, dtype=cv2.CV_8U)

    def _moved_background(self, time: float) -> Image:
        rows, columns = self.shape
        right, low = columns - 1, rows - 1
        corners = np.array([[0, 0], [right, 0], [0, low], [right, low]], float)
        when = time + self.scene.phone.readout * np.array([0, 0, 1, 1])
        still_corners = self.unmoved(corners, when)
        if np.array_equal(still_corners, corners):
            inside = slice(self.margin, -self.margin)
            return self.behind[inside, inside].copy()
        ends = (corners.astype(np.float32), (still_corners + self.margin).astype(np.float32))
        flags = cv2.INTER_CUBIC | cv2.WARP_INVERSE_MAP
        if self.scene.phone.turns:
            turned = cv2.getPerspectiveTransform(*ends)
            return cv2.warpPerspective(self.behind, turned, (columns, rows), flags=flags)
        return cv2.warpAffine(
            self.behind,
            cv2.getAffineTransform(*(each[:3] for each in ends)),
            (columns, rows),
            flags=flags,
        )

    def _draw(self, picture: Image, actor: Actor, path: motion.Path, time: float) -> None:
        at = self._picture_place(path, time)
        late = self.scene.phone.readout * float(np.clip(at[1] / (self.shape[0] - 1), 0, 1))
        if path.string_from is not None:
            above = self.lens.project(self.lens.seen(*path.string_from))
            ends = [self.moved(above, np.array(time)), at]
            one, two = (tuple(np.round(e * 16).astype(int)) for e in ends)
            cv2.line(picture, one, two, (70.0, 70.0, 70.0), 1, cv2.LINE_AA, 4)
        if self.scene.mirror and self.scene.floor is not None:
            self._ball(picture, actor, path, time, mirrored=True)
        drawn = None if path.hand is None else self._hand(actor, path, time + late)
        if drawn is None:
            self._ball(picture, actor, path, time)
            return
        behind, before, where = drawn
        self._blend(picture[where], _skin(behind), behind)
        self._ball(picture, actor, path, time)
        self._blend(picture[where], _skin(before), before)

    def _hand(self, actor: Actor, path: motion.Path, time: float):
        half = self.scene.exposure / 2

        def to_pixels(places: Array, when: Array) -> Array:
            still = self.lens.project(self.lens.seen(places[..., 0], places[..., 1]))
            return self.moved(still, when[:, None, None])

        times = time + half * np.array([-0.67, 0, 0.67])
        scale = self.scene.phone.focal / self.scene.phone.distance
        return hand_shares(path, times, actor.ball.radius, to_pixels, scale, self.shape)

    def _picture_place(self, path: motion.Path, time: float) -> Array:
        return self.moved(self._still(np.array(path.at(np.array(time)))), np.array(time))

    def _ball(
        self, picture: Image, actor: Actor, path: motion.Path, time: float, mirrored: bool = False
    ) -> None:
        scene, phone = self.scene, self.scene.phone
        x, y = path.at(time + np.linspace(-scene.exposure / 2, scene.exposure / 2 + phone.readout))
        if mirrored:
            y = 2 * scene.floor - y
        position = self.lens.seen(x, y)
        radius = 1.15 * phone.focal * actor.ball.radius / position[:, 2].min() + 4 * phone.blur + 2
        still = self.lens.project(position)
        ends = np.concatenate([self.moved(still, time + late) for late in (0, phone.readout)])
        low = np.floor(ends.min(axis=0) - radius).astype(int)
        high = np.ceil(ends.max(axis=0) + radius).astype(int)
        left, top = np.maximum(low, 0)
        right, bottom = np.minimum(high, [self.shape[1], self.shape[0]])
        if right - left < 2 or bottom - top < 2:
            return
        row, column = np.mgrid[top:bottom, left:right].astype(float)
        when = time + phone.readout * row[:, 0] / (self.shape[0] - 1)
        unmoved = self.unmoved(np.stack([column, row], axis=-1), when[:, None])
        rays = self.lens.rays(unmoved)
        length = float(np.abs(np.diff(still, axis=0)).sum())
        length *= scene.exposure / (scene.exposure + phone.readout)
        parts = int(np.clip(np.ceil(length / 0.8), 3, 40))
        parted = scene.exposure * ((np.arange(parts) + 0.5) / parts - 0.5)
        x, y = path.at(parted[:, None] + when)
        if mirrored:
            y = 2 * scene.floor - y
        turn = float(np.interp(time, path.t, path.turn)) * (-1 if mirrored else 1)
        at = self.lens.seen(x, y)
        lit = (scene.lamp, scene.ambient)
        light, share = sphere(rays, at, phone.focal, actor.ball, turn, *lit)
        blur = phone.blur
        if mirrored:
            edge = self._edge()
            level = edge[0] + (edge[1] - edge[0]) * column / self.shape[1]
            part = scene.mirror * np.clip(unmoved[..., 1] - level, 0, 1).astype(np.float32)
            light, share, blur = light * part[..., None], share * part, 1.5 * phone.blur
        light = cv2.GaussianBlur(light, (0, 0), blur)
        share = cv2.GaussianBlur(share, (0, 0), blur)
        self._blend(picture[top:bottom, left:right], light, share)

    def _blend(self, part: Image, light: Image, share: Image) -> None:
        """Blend light into a part of the picture; `share` is its part of each pixel."""
        gamma = self.scene.phone.gamma
        behind = np.power(np.clip(part, 0, 255) / 255, gamma)
        part[:] = 255 * np.power(behind * (1 - share[..., None]) + light, 1 / gamma)

    def _shadows(self, picture: Image, actor: Actor, path: motion.Path, time: float) -> None:
        scene, phone = self.scene, self.scene.phone
        x, y = (float(v) for v in path.at(np.array(time)))
        r = actor.ball.radius
        if scene.floor is not None and scene.floor_shadow:
            height = max(0.0, scene.floor - y - r)
            at = self.lens.project(self.lens.seen(x + 0.15 * height, scene.floor))
            wide = phone.focal / phone.distance * (r + 0.5 * height)
            tilt = scene.floor / phone.distance + np.radians(phone.pitch)
            dark = scene.floor_shadow * (r / (r + 0.8 * height)) ** 2
            self._darken(picture, self.moved(at, time), (wide, max(0.15, tilt) * wide), dark)
        if scene.wall_shadow:
            place = self.lens.seen(x + 0.2 * scene.wall_behind, y + 0.4 * scene.wall_behind)
            wide = phone.focal / phone.distance * (r + 0.2 * scene.wall_behind)
            at = self.moved(self.lens.project(place), time)
            self._darken(picture, at, (wide, wide), scene.wall_shadow)

    def _darken(self, picture: Image, at: Array, wide: tuple[float, float], dark: float) -> None:
        reach = 2 * np.array(wide) + 2
        left, top = np.maximum(np.floor(at - reach).astype(int), 0)
        right, bottom = np.minimum(np.ceil(at + reach).astype(int), [self.shape[1], self.shape[0]])
        if right - left < 1 or bottom - top < 1 or dark < 0.002:
            return
        row, column = np.ogrid[top:bottom, left:right]
        away = ((column - at[0]) / wide[0]) ** 2 + ((row - at[1]) / wide[1]) ** 2
        factor = (1 - dark * np.exp(-(away**1.5))) ** (1 / self.scene.phone.gamma)
        picture[top:bottom, left:right] *= factor[..., None].astype(np.float32)


def _skin(share: Image) -> Image:
    round_ = 0.65 + 0.35 * cv2.GaussianBlur(share, (0, 0), 3)
    return (share * round_)[..., None] * np.array(SKIN, np.float32)
