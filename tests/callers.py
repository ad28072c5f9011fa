"""Calls as users write them, checked by mypy: it accepts the right ones and no other.

Nothing here runs. An error in a right call, and a wrong call without one (its ``ignore`` is then
unused), are both errors of `mypy`, which reads this file with the package.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

import virtual_lab as vl


def sound(folder: Path) -> None:
    """Call with names, paths and sheets, one or several, wherever they are allowed."""
    bat, rules = vl.bat("r161"), vl.procedure(Path("mine.toml")).with_(valid_hits=9)
    gates = vl.instrument("pivot-gates").with_(tick="2 us")
    certificate = vl.certify(bat, procedure=rules, seed=7, instruments=[gates])
    vl.profile("r161", ball=vl.ball("game-2003"), instruments=gates)
    vl.certify(folder / "mine.toml", rig=vl.rig("astm-pivot"), control_bat="check-cylinder")
    vl.certify("r161", reality="ideal", motion="pymunk")
    vl.certify("r161", faults=["aim-along", "gate-misses"], uncertainty="monte-carlo")
    vl.certify("r161", history=[folder, "earlier"], laboratory=folder / "laboratory.toml")
    certificate.save(folder / "test", pdf=True, paper="letter", overwrite=True)
    vl.certify("r161", laboratory={"customer": {"name": "Oak Bats"}})
    vl.load("out/r161").plot(folder / "hits.png")
    vl.reduce(folder / "records", replaces="old", reason="a wrong ball")
    vl.score(folder).save("score")
    vl.verify(folder, key="public.pem")
    vl.report([folder, "other"], pdf=True)


def studies(folder: Path, frames: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]) -> None:
    """Call the functions of studies and camera with arguments of every allowed type."""
    bat, rules, gates = vl.bat("r161"), vl.procedure("bbcor"), vl.instrument("pivot-gates")
    table = vl.sweep(["r161", bat], procedures=[rules, "bbcor"], laboratories=3, workers=2)
    table["u"].mean()
    vl.sweep(bat, certificates=folder, traces=True, instruments=(gates,))
    vl.profile("r161", swings=0.3).save(folder, overwrite=True)
    vl.profile("r161", bat, "ea70")
    vl.profile(["r161", bat], swings=[0, 0.5], ball="game-2003")
    vl.critique(("r161", bat), procedures="bbcor")
    vl.coverage(bat, procedure=rules, summed=True, instruments=[gates]).plot("coverage.png")
    vl.operating(bat, procedures=[rules])
    vl.interlab("interlab.toml", predict=True)
    vl.bias(rules).rows[0]["bat"]
    vl.faults("aim-along", procedures=["bbcor"])
    vl.twin(folder, days=1000, full_days=500).plot("twin.png")
    vl.plan("bbcor", target_u=0.0015, bat=bat, laboratories=200).plot("plan.png")
    vl.daily(ball=vl.ball("check-ball"), drift=0.001)
    vl.slope(bats=["r161", bat])
    vl.sensitivity(Path("mine.toml"))
    vl.fit_bat(folder / "measured.toml", members=3)
    vl.campaign({"bats": [bat], "procedures": "bbcor", "laboratories": 4, "seed": 1}, folder)
    vl.campaign(None, "campaign", workers=2)
    vl.chart("motion").save(folder)
    vl.shelf("rigs").table["name"]
    vl.show(folder / "certificate.json")
    vl.template(rules, folder)
    vl.track(folder / "clip.mp4", ball=vl.ball("baseball-2003"), tripod=True).save(folder)
    vl.track(frames, ball="73mm", fps=240, frames="1:20").flights["speed_out_m_per_s"]
    vl.calibrate([folder, "more.png"], board="chessboard:14x9:40mm").save("camera.toml")
    vl.board(folder, board="chessboard:14x9:40mm", camera=vl.instrument("camera-overhead"))
    vl.rehearse("plain-day", operator="expert", seed=3)
    risk = vl.risk(vl.Input(1.0, 0.1), 0.05, upper=1.2)
    print(risk, vl.propagate(lambda a: 2 * a, {"a": vl.Input(1.0, 0.1)}, method="second-order"))


def wrong() -> None:
    """Call with unknown names and with types and words that are not allowed; mypy rejects each."""
    vl.certify()  # type: ignore[call-arg]
    vl.certify(["r161", "ea70"])  # type: ignore[arg-type]
    vl.certify("r161", "bbcor")  # type: ignore[call-arg]
    vl.certify("r161", procedures="bbcor")  # type: ignore[call-arg]
    vl.certify("r161", rung="modal")  # type: ignore[call-arg]
    vl.certify("r161", seed="7")  # type: ignore[arg-type]
    vl.certify("r161", reality="idael")  # type: ignore[arg-type]
    vl.certify("r161", instruments=["pivot-gates"])  # type: ignore[list-item]
    vl.profile("r161", ball=0.073)  # type: ignore[arg-type]
    vl.sweep("r161", procedure="bbcor")  # type: ignore[call-arg]
    vl.profile("r161", 0.3)  # type: ignore[arg-type]
    vl.coverage("r161", laboratories=2.5)  # type: ignore[arg-type]
    vl.coverage("r161", instrument="pivot-gates")  # type: ignore[call-arg]
    vl.track("clip.mp4", tripot=True)  # type: ignore[call-arg]
    vl.track("clip.mp4", ball=0.073)  # type: ignore[arg-type]
    vl.calibrate("x.png", board=3)  # type: ignore[arg-type]
    vl.shelf("bat")  # type: ignore[arg-type]
    vl.chart("colision")  # type: ignore[arg-type]
    vl.daily(drift="1")  # type: ignore[arg-type]
    vl.verify(None)  # type: ignore[arg-type]
    vl.certfy("r161")  # type: ignore[attr-defined]
