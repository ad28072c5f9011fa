"""The ball in the windows a camera kept of each shot: found, refined, told in or out."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from virtual_lab.errors import InputError
from virtual_lab.estimate import Estimate
from virtual_lab.records import ClipRecord, TrackRecord
from virtual_lab.reduction.video.located import Flag, Located
from virtual_lab.reduction.video.noise import ROUNDING, Noise

__all__ = ["Sightings", "sight"]

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Known = Mapping[str, Estimate]

AT_ONCE = 512  # windows that are looked at together
BRIGHT = 0.9  # of a ball's pixels: those above this quantile tell how much it stands out
HALF = 0.45  # of that: what stands out more is the ball
TOUCHING = 8e-3  # m, from the farthest the ball comes: nearer it may be on the bat
LEAST = 4  # frames of a way
MOST = 24  # and as many are refined: more tell little that is new, as the ball's pattern is slow
PLAIN = 0.9  # of the windows: with more that fit an evenly bright ball, all are taken for one
OVAL_U = 1e-3  # of outlines off the axis, as far as lens and pose are known
POOR = Flag.NOT_FOUND | Flag.POOR_FIT
USELESS = POOR | Flag.SATURATED | Flag.CLIPPED | Flag.OVERLAP


@dataclass(frozen=True, slots=True, kw_only=True)
class Sightings:
    """Where the ball was seen to fly freely, arrays (shot, frame); NaN: not, or not well.

    Pixels of the whole frame, distortion and all; times by the camera's clock [s].
    """

    times: Array
    x: Array
    y: Array
    u: Array  # of x and y each, from noise, new in every frame
    pattern_u: Array  # the same from the ball's own pattern, alike in neighbouring frames
    out: Mask  # whether the ball flies out


def sight(record: ClipRecord | TrackRecord, known: Known, radius: float) -> Sightings:
    """Return where a camera saw the ball of each shot.

    Parameters
    ----------
    record
        Windows with their background, or places that the camera tracked itself.
    known
        The camera's calibration.
    radius
        Of the ball [m].

    Raises
    ------
    InputError
        Windows without their pixels or their background.
    """
    size = known["focal"].value / (known["place_z"].value - known["plane"].value)  # [px/m]
    if isinstance(record, TrackRecord):
        still = np.zeros_like(record.u)
        return _ways(record.times, record.x, record.y, record.u, still, size)
    pixels, background = record.pixels, record.background
    for name, values in (("pixels", pixels), ("background", background)):
        if values is None:
            raise InputError("impact/camera", name, None, "this array is missing")
    assert pixels is not None
    assert background is not None
    shot, frame = np.nonzero(np.isfinite(record.times))
    corners = np.stack([record.left[shot, frame], record.top[shot, frame]], axis=1)
    _require_within(pixels, background, corners)
    began = np.full((*record.times.shape, 2), np.nan)
    for part in _parts(len(shot)):
        some = shot[part], frame[part]
        began[some] = _start(pixels[some], corners[part], background, size * radius)
    blurs = _blurs(record.times, began, known["exposure"].value)
    free, out = _free(record.times, began[..., 0], size)
    kept = _spread(free & ~out) | _spread(free & out)
    chosen = np.flatnonzero(kept[shot, frame])
    table = np.full((4, *record.times.shape), np.nan)
    for part in _parts(len(chosen)):
        mine = chosen[part]
        some = shot[mine], frame[mine]
        found = _refined(
            pixels[some], corners[mine], background, began[some], blurs[some], size * radius, known
        )
        useful = (found.flags & USELESS) == 0
        u = np.hypot(found.x_u, found.y_u) / np.sqrt(2)
        pattern_u = np.zeros(len(u)) if found.pattern_u is None else found.pattern_u
        table[:, *some] = np.where(useful, [found.x, found.y, u, pattern_u], np.nan)
    x, y, u, pattern_u = table
    return _ways(record.times, x, y, u, pattern_u, size)


def noise_of(known: Known) -> Noise:
    """Return the noise of a camera as its photon transfer measurement has it."""
    gain = known["gain"].value
    dark = known["read_noise"].value ** 2 + known["dark_signal"].value ** 2
    return Noise(
        gain=gain,
        read=gain**2 * dark + ROUNDING,
        black=known["black_level"].value,
        prnu=known["photo_response"].value,
        full_scale=known["full_scale"].value,
    )


def _parts(count: int) -> list[slice]:
    return [slice(start, start + AT_ONCE) for start in range(0, count, AT_ONCE)]


def _require_within(
    pixels: NDArray[np.generic], background: NDArray[np.generic], corners: Array
) -> None:
    last = np.array(background.shape)[::-1] - pixels.shape[:1:-1]
    wrong = (corners < 0) | (corners > last)
    if wrong.any():
        allowed = f"windows must lie within the frame: 0 to {last[0]}, 0 to {last[1]}"
        raise InputError("impact/camera", "left_px, top_px", corners[wrong.any(axis=1)][0], allowed)


def _behind(background: NDArray[np.generic], corners: Array, side: tuple[int, int]) -> Array:
    views = np.lib.stride_tricks.sliding_window_view(background, side)
    left, top = corners.astype(int).T
    return np.asarray(views[top, left], dtype=np.float64)


def _start(
    windows: NDArray[np.generic],
    corners: Array,
    background: NDArray[np.generic],
    radius: float,
) -> Array:
    """Return where the ball about is in each window, pixels of the frame (region, 2)."""
    rows, columns = windows.shape[1:]
    off = windows.astype(np.float64) - _behind(background, corners, (rows, columns))
    middle = np.hypot(*np.ogrid[-rows / 2 : rows / 2, -columns / 2 : columns / 2]) < radius / 2
    bright = np.where(np.median(off[:, middle], axis=1) < 0, -1.0, 1.0)
    off *= bright[:, None, None]
    high = np.quantile(off.reshape(len(off), -1), BRIGHT, axis=1)
    ball = (off > HALF * high[:, None, None]).astype(np.float64)
    count = np.maximum(ball.sum(axis=(1, 2)), 1.0)
    x = (ball.sum(axis=1) @ np.arange(columns)) / count
    y = (ball.sum(axis=2) @ np.arange(rows)) / count
    return np.asarray(corners + np.stack([x, y], axis=1))


def _blurs(times: Array, places: Array, exposure: float) -> Array:
    """Return how far the ball moves in each exposure, by its way's median speed [px], as `places`.

    `places` are (shot, frame, 2), NaN where there is no frame.
    """
    speed = np.diff(places, axis=1) / np.diff(times, axis=1)[..., None]
    turn = np.nan_to_num(places[..., 0], nan=-np.inf).argmax(axis=1)[:, None]
    after = np.arange(times.shape[1] - 1) >= turn
    ways = np.stack([np.where(way[..., None], speed, np.nan) for way in (~after, after)])
    usual = np.zeros((2, len(times), 2))
    some = np.isfinite(ways).all(axis=3).any(axis=2)
    usual[some] = np.nanmedian(ways[some], axis=1)
    out = np.arange(times.shape[1]) > turn
    usual *= exposure
    return np.asarray(np.where(out[..., None], usual[1][:, None], usual[0][:, None]))


def _free(times: Array, x: Array, size: float) -> tuple[Mask, Mask]:
    """Return the frames in which the ball cannot touch the bat, and those after the contact."""
    seen = np.isfinite(times + x)
    forth = np.where(seen, x, -np.inf)
    out = np.arange(times.shape[1]) > forth.argmax(axis=1)[:, None]
    return seen & (x < forth.max(axis=1)[:, None] - TOUCHING * size), out


def _spread(free: Mask) -> Mask:
    """Return `MOST` frames of each shot, evenly among those that are free, or all of fewer."""
    count = free.sum(axis=1)[:, None]
    rank = np.cumsum(free, axis=1)
    share = np.minimum(MOST / np.maximum(count, 1), 1.0)
    steps = np.floor(rank * share + 1e-9) > np.floor((rank - 1) * share + 1e-9)
    return np.asarray(free & steps)


def _refined(
    windows: NDArray[np.generic],
    corners: Array,
    background: NDArray[np.generic],
    places: Array,
    blur: Array,
    radius: float,
    known: Known,
) -> Located:
    """Return the ball as a plain one where the picture is one's, else by its outline alone."""
    from virtual_lab.reduction.video.edge import fit_edge
    from virtual_lab.reduction.video.refining import Optics, refine

    blank = np.full(len(windows), np.nan)
    start = Located(
        x=places[:, 0],
        y=places[:, 1],
        radius=np.full(len(windows), radius),
        x_u=blank,
        y_u=blank,
        blur_x=blur[:, 0],
        blur_y=blur[:, 1],
        chi_square=blank,
        flags=np.zeros(len(windows), np.uint16),
    )
    behind = _behind(background, corners, (windows.shape[1], windows.shape[2]))
    noise, lens = noise_of(known), known["blur"].value
    plain = refine(
        windows, corners, start, noise=noise, optics=Optics(lens=lens), background=behind
    ).located
    if ((plain.flags & POOR) == 0).mean() > PLAIN:
        return plain
    lost = ~np.isfinite(plain.x)
    begun = replace(
        start,
        x=np.where(lost, start.x, plain.x),
        y=np.where(lost, start.y, plain.y),
        radius=np.where(lost, start.radius, plain.radius),
    )
    # the radius is found anew: calibrations know it to some 0.02 px, a picture by itself to 0.004
    return fit_edge(
        windows,
        corners,
        begun,
        noise=noise,
        lens=lens,
        background=behind,
        oval=_oval(begun, known),
        oval_u=OVAL_U,
    ).located


def _oval(begun: Located, known: Known) -> Array:
    """Return what an outline off the axis has of cos 2a and sin 2a, (region, 2).

    A sphere seen under the angle b from the axis is longer by 1 / cos b along the way from it.
    """
    x, y = (
        (at - known[f"centre_{axis}"].value) / known["focal"].value
        for axis, at in (("x", begun.x), ("y", begun.y))
    )
    return np.stack([x**2 - y**2, 2 * x * y], axis=1) / 4


def _ways(times: Array, x: Array, y: Array, u: Array, pattern_u: Array, size: float) -> Sightings:
    """Return the frames of both ways, without those in which the ball may touch the bat."""
    free, out = _free(times, x + u, size)
    for way in (~out, out):
        free &= ~(way & ((free & way).sum(axis=1) < LEAST)[:, None])
    keep = {"times": times, "x": x, "y": y, "u": u, "pattern_u": pattern_u}
    return Sightings(
        **{name: np.where(free, values, np.nan) for name, values in keep.items()}, out=out
    )
