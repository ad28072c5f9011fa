"""Corrected tracks without times take the times of the clip's frames."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from virtual_lab.errors import InputError
from virtual_lab.video.clips.calibration_file import ClipCalibration
from virtual_lab.video.clips.clip import open_clip
from virtual_lab.video.find.blobs import BLOB
from virtual_lab.video.find.watching import watch
from virtual_lab.video.follow.correction import apply_correction, read_track, require_moving_object
from virtual_lab.video.follow.knowledge import ClipKnowledge
from virtual_lab.video.follow.searching import FlightsFound, clip_scene


@pytest.mark.parametrize("stated", [None, [], range(0, 20, 3), range(20)])
def test_a_missing_time_is_that_of_the_frame(stated: range | None, tmp_path: Path) -> None:
    """The camera skipped three frames after frame 9; some, all or no times are in the track."""
    frames, times = np.arange(20), (np.arange(20) + 3 * (np.arange(20) > 9)) / 50
    np.save(tmp_path / "clip.npy", np.zeros((20, 8, 8), np.uint8))
    (tmp_path / "times.csv").write_text("\n".join(map(str, times)), encoding="utf-8")
    calibration = ClipCalibration(
        metres_per_pixel=1e-3, timestamps=str(tmp_path / "times.csv"), frames_per_second=50.0
    )
    rows = pd.DataFrame({"frame": frames, "x_px": 2.0 * frames, "y_px": 4.0, "radius_px": 2.0})
    rows["flight"] = 1
    if stated is not None:
        rows["time_s"] = pd.Series(times)[list(stated)]
    rows.to_csv(tmp_path / "track.csv", index=False)
    clip = open_clip(tmp_path / "clip.npy", calibration)
    knowledge, still = ClipKnowledge(rate=50.0), np.zeros(20, bool)
    scene = clip_scene(clip, watch(clip), knowledge, still, squeezed=False)
    flights = read_track(tmp_path / "track.csv", clip)
    (flight,) = apply_correction(FlightsFound(scene=scene), flights).ways
    np.testing.assert_allclose(flight.t, 50 * times, atol=1e-9)


@pytest.mark.parametrize(("radius", "refused"), [(2.0, False), (0, True), (-1, True), (None, True)])
def test_a_radius_is_above_zero(radius: float | None, refused: bool, tmp_path: Path) -> None:
    """One row has a radius and the others have none, which is allowed if it is above 0."""
    np.save(tmp_path / "clip.npy", np.zeros((6, 8, 8), np.uint8))
    clip = open_clip(tmp_path / "clip.npy", ClipCalibration(frames_per_second=50.0))
    rows = pd.DataFrame({"frame": range(6), "x_px": 3.0, "y_px": 4.0, "flight": 1})
    rows["radius_px"] = [radius, *5 * [None]]
    rows.to_csv(tmp_path / "track.csv", index=False)
    if refused:
        with pytest.raises(InputError, match=r"track\.csv: radius_px = .*; allowed: above 0"):
            read_track(tmp_path / "track.csv", clip)
    else:
        assert read_track(tmp_path / "track.csv", clip)[0]["radius"].tolist() == 6 * [2.0]


@pytest.mark.parametrize(("right", "refused"), [(20, False), (1, False), (0, True)])
def test_positions_need_an_object_that_moves_in_the_same_frame(right: int, refused: bool) -> None:
    """20 positions are up to 0.9 radii off a moving object; the others are 1.1 radii off it.

    The camera has drifted, and each picture shows another object, too. Each object was at the wrong
    positions three frames before.
    """
    rows = np.zeros(20, BLOB)
    rows["frame"], rows["x"], rows["picture_x"], rows["radius"] = *3 * [np.arange(20) * 50], 10
    rows["picture_x"] += 400
    balls = rows.copy()
    balls["x"] += 300  # the drift found in this clip differs
    balls["picture_x"] += np.where(np.arange(20) < right, 9, 11)
    late, others = rows.copy(), balls.copy()
    late["frame"] += 3
    others["picture_y"] += 500
    blobs = np.concatenate([others, late, balls])
    if refused:
        with pytest.raises(InputError, match=r"^corrected; none of its 20 positions"):
            require_moving_object(blobs, [rows[:9], rows[9:]])
        with pytest.raises(InputError, match=r"none of its 0 positions in flights \(5 or more\)"):
            require_moving_object(blobs, [])
    else:
        require_moving_object(blobs, [rows[:9], rows[9:]])
