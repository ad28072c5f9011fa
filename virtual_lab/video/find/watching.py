"""One pass over a clip: blobs, drift and change of every frame."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import cv2
import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray

from virtual_lab.units import Array, Mask
from virtual_lab.video.clips.clip import Clip
from virtual_lab.video.clips.reading import grey_of
from virtual_lab.video.find.blobs import BLOB, Blobs, blobs, free
from virtual_lab.video.find.still import Still, eight_bits, still_of

# largest change of the drift per frame that a hand can cause [share of the fastest drift]
LEAP_SHARE = 0.4
# smallest ratio of second differences of neighboring rows to those of every other row in an
# interlaced clip, and smallest number of free blobs to measure it; interlaced clips have 1.5 to 3,
# other clips 0.4 to 1
COMB_RATIO, COMB_BLOBS = 1.25, 3


@dataclass(frozen=True, slots=True, kw_only=True)
class Watched:
    """Moving blobs of a clip, and the drift of its picture."""

    still: Still
    blobs: Blobs  # (blob,) of `find.blobs.BLOB`, frame by frame
    change: Array  # (frame,) largest change from the previous frame [DN]; NaN: not examined
    # size of each leap of the background [pixels], by the number of the frame after the leap
    leaps: Mapping[int, float] = field(default_factory=dict)
    # JPEG of each frame in the searched size, about 30 kB each; empty if the clip has more than
    # 4000 frames
    thumbs: Mapping[int, NDArray[np.uint8]] = field(default_factory=dict)
    # (frame, 4), drift of each picture as in `find.drift` [pixels]; empty if there are no pictures
    drifts: Array = field(default_factory=lambda: np.array([]))
    interlaced: bool = False  # each frame holds two fields, taken at different moments


def watch(
    clip: Clip,
    *,
    frames: tuple[int, int] | None = None,
    region: tuple[float, float, float, float] | None = None,
    tripod: bool = False,
    progress: Callable[[str], None] = lambda _: None,
) -> Watched:
    """Return the moving blobs of a clip, its still background, and the drift of its picture.

    Raises `InputError` if a frame cannot be read.

    Parameters
    ----------
    frames
        Numbers of the first and the last frame to examine, counted from 0. None: all frames.
    region
        Region to examine [pixels]: x and y of its upper left corner, width and height. It refers to
        the picture of the first frame, to which all frames are shifted so that the background
        stands still. None: the whole picture.
    tripod
        Whether the camera is known to stand still.
    progress
        Function that is called with a message that names the frame.
    """
    depth = max(8, int(clip.full_scale).bit_length())
    apart = float(np.diff(clip.sampled).max()) if len(clip.sampled) > 1 else 1.0
    still = still_of(list(clip.samples), depth, apart, tripod=tripod)
    first, last = frames or (0, clip.count - 1)
    change, drifts = np.full(clip.count, np.nan), np.zeros((clip.count, 4))
    by_frame: list[Blobs] = [np.zeros(0, BLOB)]
    drift, ahead, since = np.zeros(4), np.zeros(4), 1
    latest = still.shrunk(eight_bits(clip.samples[0], depth)), drift
    leaps: dict[int, float] = {}
    thumbs: dict[int, NDArray[np.uint8]] = {}
    for number, frame in enumerate(clip.pictures()):
        if number > last:
            break
        if number % 50 == 0:
            progress(f"frame {number} of {clip.count}")
        picture = eight_bits(frame, depth)
        small = still.shrunk(picture)
        between = np.array([np.interp(number, clip.sampled, each) for each in still.sampled.T])
        drifted = still.drift(small, between, latest) - drift
        if (np.abs(drifted[:2]) < still.fastest * since).all():
            leapt = float(np.hypot(*(drifted - since * ahead)[:2]))
            if number > 1 and leapt > LEAP_SHARE * still.fastest:
                leaps[number] = leapt
            drift, ahead, since = drift + drifted, drifted / since, 1
        else:
            since += 1
        before, latest, drifts[number] = latest[0], (small, drift), drift
        if number < first:
            continue  # only the drift is needed, as the start for the next frame
        if number > first:
            # The mean over 5 x 5 pixels is used because changes of fewer pixels are noise.
            change[number] = cv2.blur(cv2.absdiff(small, before), (5, 5)).max()
        if clip.count <= 4000:
            thumbs[number] = cv2.imencode(".jpg", small, [cv2.IMWRITE_JPEG_QUALITY, 92])[1]
        moving = blobs(number, picture, small, drift, still)
        by_frame.append(moving[in_region(moving, region)])
    whole = np.concatenate(by_frame)
    return Watched(
        still=still,
        blobs=whole,
        change=change,
        drifts=drifts,
        leaps=leaps,
        thumbs=thumbs,
        interlaced=_has_combs(clip, whole),
    )


def _has_combs(clip: Clip, moving: Blobs) -> bool:
    """Return whether alternate rows of moving blobs show two times (interlaced fields).

    In an interlaced frame a row differs more from its neighbors than from the rows beyond them. In
    other frames it differs less, or equally if there is only noise.
    """
    combed = []
    whole = moving[free(moving)]
    for number, sample in zip(clip.sampled, clip.samples, strict=True):
        for blob in whole[whole["frame"] == number]:
            x, y, reach = blob["picture_x"], blob["picture_y"], blob["length"] + 3
            rows, columns = (slice(max(0, int(p - reach)), int(p + reach) + 2) for p in (y, x))
            part = grey_of(sample[rows, columns]).astype(float)
            if len(part) > 8:
                bends = (2 * part[k:-k] - part[: -2 * k] - part[2 * k :] for k in (1, 2))
                near, far = (np.abs(each).mean() for each in bends)
                combed.append(near / max(far, 1.0))
    return len(combed) >= COMB_BLOBS and float(np.median(combed)) > COMB_RATIO


def in_region(moving: Blobs, region: tuple[float, float, float, float] | None) -> Mask:
    """Return a mask of the blobs with centers in a region of the picture, (blob,).

    Positions refer to the first picture of the clip, to which the other pictures are shifted so
    that the background stands still. `region` is x and y of the upper left corner, width and height
    [pixels]. If it is None, all blobs are selected.
    """
    if region is None:
        return np.ones(len(moving), bool)
    x, y, wide, high = region
    inside = (moving["x"] > x) & (moving["x"] < x + wide)
    return np.asarray(inside & (moving["y"] > y) & (moving["y"] < y + high))


def repeats(watched: Watched) -> Mask:
    """Return a mask of the frames that repeat the previous frame, (frame,).

    A frame is a repeat if the picture hardly changes (`lulls`) and fewer than half of its round
    objects move. Without the second condition, a ball at the top of a low hop would look like a
    repeat, because it changes the picture very little. Objects without a match in the previous
    frame are ignored.
    """
    moving, same = watched.blobs, lulls(watched.change)
    clean = moving[free(moving)]
    for k in np.flatnonzero(same):
        old, moved = clean[clean["frame"] == k - 1], []
        for one in clean[clean["frame"] == k]:
            alike = old[np.abs(old["radius"] / one["radius"] - 1) < 0.1]
            away = np.hypot(alike["x"] - one["x"], alike["y"] - one["y"]).min(initial=np.inf)
            if away < one["radius"]:
                # A codec that stores a picture twice moves a blob by half a pixel.
                moved.append(away > max(0.7, 0.03 * one["radius"]))
        same[k] = not moved or np.mean(moved) < 0.5
    return same


def lulls(change: Array) -> Mask:
    """Return a mask of the frames that change much less than their neighbors, (frame,).

    `change`, (frame,), is the largest change from the previous frame [DN]. The second frame is
    compared with later frames alone. A frame is False if it is the first or the last, or if its
    change is NaN.
    """
    # number of frames on each side, smallest change there [DN], largest share of this change in a
    # repeat
    beside, least, share = 2, 8.0, 0.3
    around = sliding_window_view(np.pad(change, beside, constant_values=np.nan), 2 * beside + 1)
    before = np.fmax.reduce(around[:, :beside], axis=1)  # NaN: nothing is known
    most = np.fmin(before, np.nan_to_num(around[:, beside + 1 :]).max(axis=1))
    return np.asarray((most > least) & (change < share * most))
