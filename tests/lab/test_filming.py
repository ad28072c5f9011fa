"""A test at the filmed cannon writes a calibration of camera, ball and bat for `track`."""

from pathlib import Path

import numpy as np
import pytest

import rigs.filmed_cannon
from tests.laboratories import certify
from virtual_lab.simulation.instruments import RecordDetail
from virtual_lab.video.clips.calibration_file import read_calibration


def test_the_calibration_beside_a_film_is_what_the_laboratory_knows(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """The file is valid, the camera is the session's, and pivot and width agree to millimeters."""
    monkeypatch.setattr(rigs.filmed_cannon, "write_films", lambda *_: None)
    done = certify(
        "r161",
        procedure="bbcor",
        rig="filmed-cannon",
        seed=3,
        film=True,
        detail=RecordDetail.SUMMED,
    )
    assert done.film is not None
    done.film(tmp_path)
    (tmp_path / "shot-0.csv").write_text("time_s\n")
    known = read_calibration(tmp_path / "calibration.toml")
    session = done.certification.session.calibration
    assert known.camera is not None
    assert known.camera.matrix[0][0] == session["impact.camera.focal"].value
    assert known.camera.image_size == (1280, 800)
    true = done.sealed.shots["across"][0]
    height = known.camera.plane_height_m - session["impact.camera.plane"].value
    assert height == pytest.approx(true, abs=1e-3)
    assert known.gravity_mps2 == (0.0, 0.0, -session["hall.gravity"].value)
    assert known.camera.plane_height_u_m == session["impact.camera.plane"].u
    parts = (session[f"impact.camera.{name}"] for name in ("focal", "place_z"))
    scale_u = np.hypot(*(part.u / part.value for part in parts))
    assert known.camera.relative_scale_u == pytest.approx(scale_u, rel=1e-12)
    assert known.ball_diameter_m == pytest.approx(0.0738, abs=5e-4)
