"""What a Python user holds: a tested bat, its tables, its certificate, and how to keep them."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from operator import index
from pathlib import Path
from typing import TYPE_CHECKING, Any

from virtual_lab.certificate.document import certificate
from virtual_lab.certificate.html import certificate_page, notebook_card
from virtual_lab.certificate.tables import budget_table, shot_table
from virtual_lab.errors import InputError
from virtual_lab.files import new_folder
from virtual_lab.lab import Tested, certify_bat
from virtual_lab.lab.seal import TRUTH, write_seal
from virtual_lab.measurement.certification import Certification, certify_session
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.rounding import with_uncertainty
from virtual_lab.records.foreign.laboratory import FORM
from virtual_lab.records.session import SESSION, load_session, save_session
from virtual_lab.simulation.rig import MotionRung, Reality
from virtual_lab.simulation.truth import Sealed
from virtual_lab.studies.foreign import certify_laboratory
from virtual_lab.studies.score import score

if TYPE_CHECKING:
    import pandas as pd

    from virtual_lab.video.show.tracked_clip import TrackedClip

__all__ = ["Certificate", "Track", "certify", "reduce", "track"]


@dataclass(frozen=True, kw_only=True, repr=False)
class Certificate:
    """A bat's certificate and everything behind it."""

    certification: Certification
    sealed: Sealed | None = None
    control: Certificate | None = None  # of the control bat
    film: Callable[[Path], None] | None = None  # of the first shot

    @cached_property
    def document(self) -> dict[str, Any]:
        """The certificate as it stands in ``certificate.json``."""
        digest = hashlib.sha256(self._truth).hexdigest() if self.sealed else None
        return certificate(self.certification, truth_digest=digest)

    @cached_property
    def shots(self) -> pd.DataFrame:
        """A row a shot: what each instrument gave and what was reduced from it."""
        return shot_table(self.certification)

    @cached_property
    def budget(self) -> pd.DataFrame:
        """The uncertainty budget of the metric, largest component first."""
        metric = self.certification.metric
        if metric is None:
            raise ValueError("too few valid hits for an uncertainty budget")
        return budget_table(metric)

    @property
    def verdict(self) -> str:
        return self.certification.verdict.value

    def score(self) -> dict[str, Any]:
        """Open the sealed truth: recovered against true, in units and standard uncertainties."""
        if self.sealed is None:
            raise ValueError("these records came without a sealed truth")
        return score(self.document, self.sealed.document()["measurand"])

    def save(self, folder: str | Path, *, film: bool = False) -> Path:
        """Write certificate, readings, raw records and truth into a new folder, and seal it.

        `film` adds the first shot in whole frames: lossless with its time stamps, as a preview,
        and the calibration that ``virtual-lab track`` reads.

        Raises `InputError` where the folder is not empty or cannot be written, or nothing films;
        nothing is left half-written.
        """
        target = Path(folder)
        if film and self.film is None:
            allowed = "the rig has no camera; one that has is filmed-cannon"
            raise InputError("", "film", "the first shot", allowed)
        with new_folder(target) as draft:
            text = json.dumps(self.document, indent=2, allow_nan=False)
            (draft / "certificate.json").write_text(text + "\n", encoding="utf-8")
            page = certificate_page(self.document, self.certification)
            (draft / "certificate.html").write_text(page, encoding="utf-8")
            self.shots.to_csv(draft / "readings.csv", index=False)
            (draft / "records").mkdir()
            save_session(self.certification.session, draft / "records")
            if self.sealed:
                (draft / TRUTH).parent.mkdir()
                (draft / TRUTH).write_bytes(self._truth)
            if self.control:
                self.control.save(draft / "control")
            if film and self.film:
                (draft / "film").mkdir()
                self.film(draft / "film")
            if self.sealed:
                write_seal(draft)
        return target

    @cached_property
    def _truth(self) -> bytes:
        assert self.sealed is not None
        return (json.dumps(self.sealed.document(), indent=1, allow_nan=False) + "\n").encode()

    def __repr__(self) -> str:
        found = self.certification
        words = f"{found.session.bat} by {found.procedure.name}: {self.verdict}"
        if found.metric:
            printed = METRICS[found.procedure.metric]
            numbers = found.metric.value / printed.unit_si, found.metric.u / printed.unit_si
            words += f", {printed.symbol} {with_uncertainty(*numbers)} {printed.unit}"
        return f"<Certificate of {words.rstrip()}>"

    def _repr_html_(self) -> str:
        return notebook_card(self.document)


def certify(
    bat: str | Path,
    *,
    procedure: str | Path = "astm-f1881",
    rig: str | None = None,
    seed: int | None = None,
    reality: Reality | str = Reality.REAL,
    rung: str | None = None,
    motion: str = MotionRung.CLOSED_FORM.value,
    faults: str | Sequence[str] = (),
    control_bat: str | Path | None = None,
    correction: str | None = None,
    say: Callable[[str], None] = lambda _: None,
) -> Certificate:
    """Take a bat through a procedure and return its certificate.

    Parameters
    ----------
    bat, procedure
        Names in the catalog (``virtual-lab list``), or paths of .toml files.
    rig
        A rig that gives what the procedure needs; None takes the one it names.
    seed
        Of everything random in the laboratory: the test is reproducible then, not sealed. None
        draws one of 128 bits, which stands in the sealed truth alone.
    reality
        ``real``; ``noise-free``: no randomness, but ring, counts, drag and friction; ``ideal``:
        every individual and every instrument equals its nominal.
    rung
        Of the collision: ``rigid``, ``modal`` or ``reference``; None takes the cheapest that is
        good enough, and the certificate says which and why.
    motion
        Of ball and bat: ``closed-form``, or ``pymunk``, a scene a shot.
    faults
        Names of what goes wrong on the day (``virtual-lab list faults``); only the sealed truth
        tells them.
    control_bat
        Name or path of a bat whose e is known, for rules that correct their balls by one: it is
        tested first, with the same balls.
    correction
        ``METHOD:E0``, such as ``trampoline:0.5``: convert the result to a standard ball where the
        rules do not; the certificate marks it as assumed.
    say
        Told what goes on, a sentence at a time.

    Raises
    ------
    InputError
        An unknown name, a file that cannot be used, a seed that is no whole number from 0.
    """
    tested = certify_bat(
        str(bat),
        procedure=str(procedure),
        rig=rig,
        seed=None if seed is None else _one(seed),
        reality=Reality.named(reality),
        rung=rung,
        motion=motion,
        faults=(faults,) if isinstance(faults, str) else faults,
        control_bat=None if control_bat is None else str(control_bat),
        correction=correction,
        say=say,
    )
    return _certificate(tested)


def _one(seed: object) -> int:
    """Return a seed as a plain number, whoever's kind of whole number it is."""
    try:
        return index(seed)  # type: ignore[arg-type]
    except TypeError as fault:
        allowed = "one whole number from 0; for several, certify once with each"
        raise InputError("", "seed", seed, f"allowed: {allowed}") from fault


def _certificate(tested: Tested) -> Certificate:
    return Certificate(
        certification=tested.certification,
        sealed=tested.sealed,
        film=tested.film,
        control=_certificate(tested.control) if tested.control else None,
    )


def reduce(records: str | Path) -> Certificate:
    """Return the certificate of a folder of raw records, without any truth.

    The folder holds a ``session.json`` of ours, or the ``laboratory.toml`` of another laboratory.

    Raises
    ------
    InputError
        A record, calibration or procedure that is missing or cannot be used.
    """
    folder = Path(records)
    if (folder / FORM).exists():
        return Certificate(certification=certify_laboratory(folder))
    inner = [path.parent for path in sorted(folder.glob(f"*/{SESSION}"))]
    if inner and not (folder / SESSION).exists():
        raise InputError("", "records", str(folder), f"they are in {inner[0]}")
    return Certificate(certification=certify_session(load_session(folder)))


@dataclass(frozen=True, kw_only=True, repr=False)
class Track:
    """A ball followed through a clip: tables of flights, contacts and places."""

    clip: TrackedClip

    @property
    def document(self) -> dict[str, Any]:
        """The result as it stands in ``result.json``."""
        return self.clip.document

    @property
    def motion(self) -> str:
        """Return flights, free-fall, pendulum, rolling, carried or none."""
        return str(self.document["motion"])

    @cached_property
    def flights(self) -> pd.DataFrame:
        """A row a flight: frames, places, speeds, its own acceleration, each with its u."""
        return _table(self.document["flights"])

    @cached_property
    def contacts(self) -> pd.DataFrame:
        """A row a contact: time, frame, kind, restitution with its u."""
        return _table(self.document["contacts"])

    @cached_property
    def places(self) -> pd.DataFrame:
        """A row a place, as in ``track.csv``."""
        import pandas as pd

        from virtual_lab.video.show.course import COLUMNS, rows_of

        return pd.DataFrame(list(rows_of(self.clip.course)), columns=list(COLUMNS))

    def save(self, folder: str | Path) -> Path:
        """Write track, result, plot, contact sheet and film into a new folder."""
        self.clip.save(Path(folder))
        return Path(folder)

    def __repr__(self) -> str:
        return f"<Track of {self.clip.title}>"


def track(
    clip: str | Path,
    *,
    ball: str | None = None,
    calibration: str | Path | None = None,
    corrected: str | Path | None = None,
    **known: Any,
) -> Track:
    """Follow the ball through a clip, as ``virtual-lab track`` does.

    Parameters
    ----------
    clip
        A video, a folder of images, a TIFF stack or a .npy array.
    ball
        Its diameter, ``"73mm±0.5mm"``.
    calibration, corrected
        A calibration file; a track.csv of an earlier run, corrected by hand.
    known
        fps, gravity as numbers; exposure, frames, region, ball_at, scale, readout as on the
        command line; global_shutter.

    Raises
    ------
    InputError
        A clip that cannot be read, or words of another form.
    """
    from virtual_lab.video.show.tracked_clip import Asked, track_clip

    files = [None if each is None else Path(each) for each in (calibration, corrected)]
    asked = Asked(ball=ball, calibration=files[0], track=files[1], **known)
    return Track(clip=track_clip(Path(clip), asked))


def _table(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """Return rows as a table, a value and its u in columns side by side."""
    import pandas as pd

    flat = []
    for row in rows:
        cells: dict[str, Any] = {}
        for name, value in row.items():
            if isinstance(value, dict):
                cells |= {name: value["value"], f"{name}_u": value["u"]}
            else:
                cells[name] = value
        flat.append(cells)
    return pd.DataFrame(flat)
