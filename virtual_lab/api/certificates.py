"""Certificates: test a bat, reduce or load records, and test many bats in many laboratories."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from virtual_lab.errors import IncompleteError, InputError, without_if_it_fails
from virtual_lab.files.folders import NewFolder, RecordsFolder, ResultFolder, ResultFolders
from virtual_lab.output.progress import Progress, quiet
from virtual_lab.parameters import (
    AnyLaboratory,
    AnyParticulars,
    File,
    Folder,
    MotionName,
    Paper,
    Positive,
    Propagation,
    RealityName,
    Seed,
    paths_of,
)
from virtual_lab.sheets import (
    AnyBat,
    AnyBats,
    AnyProcedure,
    AnyProcedures,
    AnyRig,
    Faults,
    Instruments,
    entry_name,
    entry_names,
    words_of,
)

if TYPE_CHECKING:
    import pandas as pd
    from matplotlib.figure import Figure

    from virtual_lab.certificate.document import CertificateDocument
    from virtual_lab.lab import BatTest
    from virtual_lab.measurement.certification import Certification
    from virtual_lab.output.metrics import MetricFormat
    from virtual_lab.records.session import PackedSession, Session
    from virtual_lab.simulation.physics.truth import SealedTruth
    from virtual_lab.studies.score import CertificateScore, QuantityScore


@dataclass(frozen=True, kw_only=True, repr=False)
class Certificate:
    """A certificate of a bat, with its shots, uncertainty budget, records and truth."""

    certification: Certification
    sealed: SealedTruth | None = None
    control: Certificate | None = None  # certificate of the control bat
    # function that films the first shot into a folder, if requested
    film: Callable[[Path], None] | None = None
    seed: int | None = None  # seed given by the user; None if random
    pdf: bool = False  # whether `save` also writes a PDF
    paper: Paper = "a4"  # paper size of page and PDF
    sign: Path | None = None  # private key with which `save` signs all files
    settings: str = ""  # arguments of the call that made it, as ``settings.toml``
    stated: CertificateDocument | None = None  # document read from a folder

    @cached_property
    def printed(self) -> CertificateDocument:
        """The certificate as the typed document behind text, page and figures."""
        import hashlib

        from virtual_lab.certificate.filling import certificate
        from virtual_lab.certificate.program import typst

        document = self.stated
        if document is None:
            truth = hashlib.sha256(self._truth).hexdigest() if self.sealed else None
            digest = self._records.digest
            document = certificate(self.certification, truth_digest=truth, session_digest=digest)
        if not self.pdf:
            return document
        return replace(document, versions={**document.versions, "typst": str(typst())})

    @cached_property
    def document(self) -> dict[str, Any]:
        """The certificate as in ``certificate.json``."""
        return self.printed.as_json()

    @property
    def text(self) -> str:
        """The certificate for a terminal."""
        from virtual_lab.certificate.text import certificate_text

        return certificate_text(self.printed)

    @cached_property
    def shots(self) -> pd.DataFrame:
        """Instrument readings and reduced results, one row per shot."""
        import pandas as pd

        from virtual_lab.certificate.tables import shot_units

        table = pd.DataFrame(self._shot_columns)
        table.attrs["units"] = shot_units(self._shot_columns)
        return table

    @cached_property
    def budget(self) -> pd.DataFrame:
        """The uncertainty budget of the metric, largest component first.

        Raises `InputError` if the test gave no result.
        """
        from virtual_lab.certificate.tables import budget_table

        metric = self.certification.metric
        if metric is None:
            reason = "; ".join(self.certification.reasons)
            raise InputError("", "budget", None, f"the test gave no result: {reason}")
        return budget_table(metric)

    @property
    def verdict(self) -> str:
        """PASS, FAIL, INVALID, or MEASURED if the procedure has no limit for the bat."""
        return self.certification.verdict.value

    @property
    def reasons(self) -> tuple[str, ...]:
        """Reasons of FAIL or INVALID, or of the exemption of a bat from the test; otherwise ()."""
        return self.certification.reasons

    @property
    def flags(self) -> tuple[str, ...]:
        """Names of the flags: contradictions in the records."""
        return tuple(flag.name for flag in self.certification.flags)

    @property
    def value(self) -> float | None:
        """The metric in its `unit`; None with too few valid hits."""
        return self._print.in_unit(self.printed.metric.value)

    @property
    def u(self) -> float | None:
        """Standard uncertainty of the metric in its `unit`; None without a value."""
        return self._print.in_unit(self.printed.metric.u)

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % interval of the metric in its `unit`; None without a value."""
        limits = self.printed.metric.interval_95
        if limits is None:
            return None
        low, high = (self._print.in_unit(end) for end in limits)
        return low, high

    @property
    def unit(self) -> str:
        """The printed unit of the metric; empty for a dimensionless number."""
        return self._print.unit

    @property
    def _print(self) -> MetricFormat:
        from virtual_lab.output.metrics import METRICS

        return METRICS[self.printed.metric.name]

    def plot(self, path: str | Path | None = None) -> Figure:
        """Return a figure of the metric of each hit with result, interval and limit; save it."""
        from virtual_lab.studies.certificate_plot import plot_hits

        return plot_hits(self.certification, self.printed.statement).write(path)

    def score(self) -> dict[str, QuantityScore]:
        """Compare with the sealed truth: measured and true values, errors in units and in u.

        Raises `InputError` without a truth or without a result.
        """
        from virtual_lab.studies.score import score

        if self.sealed is None:
            allowed = "records are read without the truth beside them; use vl.score(FOLDER)"
            raise InputError("", "score", None, allowed)
        if self.certification.metric is None:
            reason = "; ".join(self.certification.reasons)
            raise InputError("", "score", None, f"the test gave no result: {reason}")
        return score(self.document, self.sealed.document()["measurand"])

    def save(
        self,
        folder: Folder,
        *,
        pdf: bool | None = None,
        paper: Paper | None = None,
        sign: File | None = None,
        overwrite: bool = False,
    ) -> Path:
        """Write certificate, readings, raw records and truth into a new folder, and seal it.

        The folder also contains ``datapackage.json`` (Frictionless) with meaning and unit of every
        column, ``ro-crate-metadata.json`` (RO-Crate) with every file, and ``SHA256SUMS``.

        A film is saved without loss, with time stamps. A preview of the film and its calibration
        file for ``virtual-lab track`` are beside it. If an `InputError` is raised, no partial files
        are left.

        Parameters
        ----------
        folder
            The new folder.
        pdf
            Also write the certificate as PDF (needs the extra ``pdf``).

            It is PDF/A-3a and PDF/UA-1, with ``certificate.json`` attached. None: as the
            certificate was made.
        paper
            Paper size of the certificate. By default a4.
        sign
            Sign ``SHA256SUMS``, the list of all files, with the private key in this file (Ed25519,
            PEM; needs the extra ``sign``).
        overwrite
            Replace a result folder of this name, as a whole.

        Raises
        ------
        InputError
            The folder is not empty, is to be overwritten but is not a result folder, or cannot be
            written; the paper size is unknown, the key file is not a key, or a required extra is
            not installed.
        IncompleteError
            Page, PDF, film or signature could not be made; everything else is saved.
        """
        from virtual_lab.certificate.html import certificate_page
        from virtual_lab.certificate.pdf import (
            certificate_pdf,
            pdf_name,
            require_paper,
            require_pdf,
        )
        from virtual_lab.certificate.result_folder import close_result, write_result
        from virtual_lab.certificate.signing import require_key, write_sums
        from virtual_lab.files import new_folder

        if pdf is not None and pdf != self.pdf:  # the certificate then states the version of Typst
            return replace(self, pdf=pdf).save(folder, paper=paper, sign=sign, overwrite=overwrite)
        target, paper = Path(folder), paper or self.paper
        require_paper(paper)
        if self.pdf:
            require_pdf(paper)
        if sign:
            require_key(Path(sign), private=True)
        missing: list[str] = []
        with new_folder(target, self.settings, overwrite=overwrite) as draft:
            truth = self._truth if self.sealed else b""
            write_result(draft, self.printed, self.certification, self._records, truth)
            with without_if_it_fails("certificate.html", missing):
                page = certificate_page(self.printed, paper)
                (draft / "certificate.html").write_text(page, encoding="utf-8")
            if self.pdf:
                name = pdf_name(self.printed)
                with without_if_it_fails(name, missing):
                    (draft / name).write_bytes(certificate_pdf(self.printed, paper))
            if self.control:
                with without_if_it_fails("parts of control", missing):
                    self.control.save(draft / "control", pdf=self.pdf, paper=paper)
            if self.film:
                with without_if_it_fails("film", missing), new_folder(draft / "film") as film:
                    self.film(film)
            close_result(draft, self.printed, self.certification)
            if signing := sign or self.sign:
                with without_if_it_fails("signature", missing):
                    write_sums(draft, Path(signing))
        if missing:
            raise IncompleteError(str(target), missing)
        return target

    @cached_property
    def _shot_columns(self) -> dict[str, Any]:
        from virtual_lab.certificate.tables import shots_as_columns

        return shots_as_columns(self.certification)

    @cached_property
    def _records(self) -> PackedSession:
        from virtual_lab.records.session import pack

        return pack(self.certification.session)

    @cached_property
    def _truth(self) -> bytes:
        assert self.sealed is not None
        return self.sealed.content

    def __repr__(self) -> str:
        from virtual_lab.output.metrics import METRICS
        from virtual_lab.output.rounding import with_uncertainty

        certification = self.certification
        words = f"{certification.session.bat} by {certification.procedure.name}: {self.verdict}"
        if metric := certification.metric:
            printed = METRICS[certification.procedure.metric]
            value, u = printed.in_unit(metric.value), printed.in_unit(metric.u)
            words += f", {printed.symbol} {with_uncertainty(value, u)} {printed.unit}"
        return f"<Certificate of {words.rstrip()}>"

    def _repr_html_(self) -> str:
        from virtual_lab.certificate.html import notebook_card

        return notebook_card(self.printed)


def certify(
    bat: AnyBat,
    *,
    procedure: AnyProcedure = "astm-f1881",
    instruments: Instruments = (),
    rig: AnyRig | None = None,
    seed: Seed | None = None,
    number: int = 0,
    reality: RealityName = "real",
    motion: MotionName = "closed-form",
    faults: Faults = (),
    control_bat: AnyBat | None = None,
    film: bool = False,
    laboratory: AnyParticulars | None = None,
    replaces: ResultFolder | None = None,
    reason: str = "",
    test: int | None = None,
    lot: int | None = None,
    history: ResultFolders = (),
    uncertainty: Propagation = "first-order",
    progress: Progress = quiet,
) -> Certificate:
    """Test a bat by a procedure.

    Bat, balls, rig and readings are simulated. The certificate is returned.

    Parameters
    ----------
    bat
        The bat: a name in the catalog or a .toml file.

        A sheet is also allowed, for example ``vl.bat("r161")``. Its values may be changed.
    procedure
        The test procedure: a name in the catalog or a .toml file.

        A sheet is also allowed, for example ``vl.procedure("bbcor").with_(valid_hits=8)``.
    instruments
        Instruments and rigs with changed values, used instead of the catalog entries.

        Example: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.
    rig
        Rig to use instead of the procedure's rig. It must write the records that the procedure
        needs.
    seed
        Seed of all random numbers. A given seed makes the test reproducible, but anyone who knows
        it can compute the true values, so the certificate says "not sealed". By default a random
        seed of 128 bits. It is stored only in the sealed truth, the file with the true values of
        the test.
    number
        Number of the laboratory, from 0. Laboratories with the same seed and different numbers
        differ in bat, balls and calibration errors.
    reality
        ``real``: all random effects. ``noise-free``: no randomness, but vibration of the bat,
        encoder counts, drag and friction remain. ``ideal``: bat, balls and instruments equal their
        nominal values.
    motion
        Motion of ball and bat: closed form for all shots, or one pymunk scene per shot.
    faults
        Fault of the test day. Only the sealed truth states it.

        One name of ``vl.shelf("faults")``, or a list.
    control_bat
        Control bat, a bat of known e. It is tested first, with the same balls. Only for a procedure
        that uses a control bat to correct for the balls.
    film
        Save a video of the first shot. The rig must have a camera, such as ``filmed-cannon``.
    laboratory
        File of particulars for the certificate: laboratory, customer, bat, instruments. `template`
        writes an empty one. Or the folder of a laboratory: its sheets of instruments, rigs and
        balls replace those of the catalog.

        A mapping with the same keys is also allowed: ``{"customer": {"name": "Oak Bats"}}``. The
        logo is then a file in the current folder.
    replaces
        Result folder of the report that the new report replaces.
    reason
        Reason for the replacement. The certificate states the replaced report and the reason.
    test
        Number of this test in its laboratory. Requires `seed`. Tests with different numbers have
        the same calibrations, but different bats and balls.
    lot
        Number of the lot of balls in its laboratory. Requires `seed`. Tests with the same lot
        number use balls of the same lot. By default lot 0. If `test` is stated, the default is a
        separate lot for each test.
    history
        Result folder of an earlier test of this bat design by the same procedure in this
        laboratory, or a folder of such folders. At least three tests are needed. The scatter of the
        hits is then estimated from these tests and the current test.
    uncertainty
        Method to propagate the uncertainty. Monte Carlo stops when two digits of u are accurate.
    progress
        Function that is called with a message that names the current task. If it is not given, the
        functions of `virtual_lab` and the commands show the progress on stderr.

    Returns
    -------
    Certificate
        The certificate in memory; its method ``save`` writes the files.

    Raises
    ------
    InputError
        A name is unknown; a file cannot be used; `seed` is not a whole number of at least 0;
        `number`, `test` or `lot` is stated without a seed; `seed`, `number`, `test` or `lot` is
        stated although `reality` is not ``real``; `lot` is negative; `film` is requested at a rig
        without a camera; only one of `replaces` and `reason` is stated; or `history` has fewer than
        three tests or tests of another kind.
    """
    from virtual_lab.certificate.chain import replaced_report
    from virtual_lab.certificate.history import earlier_scatter
    from virtual_lab.lab import TestSetup, certify_bat
    from virtual_lab.records.particulars import read_particulars
    from virtual_lab.simulation.stations.rig import MotionModel, Reality, member_of
    from virtual_lab.uncertainty.estimate import Estimates

    kind = member_of(Reality, "reality", reality)
    if kind is not Reality.REAL:
        numbers = {"seed": seed, "number": number or None, "test": test, "lot": lot}
        for key, value in numbers.items():
            if value is not None:
                allowed = f"leave it out: nothing is random where the reality is {reality}"
                raise InputError("", key, value, allowed)
    setup = TestSetup.of(
        entry_name(bat),
        procedure=entry_name(procedure),
        rig=None if rig is None else entry_name(rig),
        seed=seed if kind is Reality.REAL else 0,
        number=number,
        reality=kind,
        faults=words_of(faults),
        control_bat=None if control_bat is None else entry_name(control_bat),
        particulars=read_particulars(
            Path(laboratory) if isinstance(laboratory, str) else laboratory
        ),
    )
    tested = setup.bat.spec.name, setup.rules.spec.name
    replaced = replaced_report(replaces, reason, *tested)
    session = {
        "bat": setup.bat.spec.name,
        "procedure": setup.rules.text,
        "rig": setup.rig,
        "laboratory": setup.particulars.laboratory.name,
    }
    scatter = earlier_scatter(paths_of(history), session)
    setup = replace(
        setup,
        particulars=replace(setup.particulars, replaces=replaced or setup.particulars.replaces),
        motion=member_of(MotionModel, "motion", motion),
        film=film,
        test=test,
        lot=lot,
        history={name: Estimates.stack([each]) for name, each in scatter.items()},
        uncertainty=uncertainty,
    )
    return _certificate(certify_bat(setup, progress), seed)


def _certificate(tested: BatTest, seed: int | None) -> Certificate:
    return Certificate(
        certification=tested.certification,
        sealed=tested.sealed,
        film=tested.film,
        control=_certificate(tested.control, seed) if tested.control else None,
        seed=seed,
    )


def load_folder(folder: ResultFolder) -> Certificate:
    """Return the certificate of a result folder, with shots, budget and figure.

    The records are reduced again. The sealed truth is not opened. To compare the certificate with
    it, use `score`.

    Parameters
    ----------
    folder
        Result folder that ``certify`` or ``Certificate.save`` wrote.

    Raises
    ------
    InputError
        The folder has no certificate or no records, or the certificate disagrees with the records.
    """
    from virtual_lab.certificate.chain import read_and_reduce

    folder = Path(folder)
    document, certification = read_and_reduce(folder)
    control = load_folder(folder / "control") if (folder / "control").is_dir() else None
    return Certificate(certification=certification, stated=document, control=control)


def reduce(
    records: RecordsFolder,
    *,
    replaces: ResultFolder | None = None,
    reason: str = "",
    history: ResultFolders = (),
) -> Certificate:
    """Compute a certificate from raw records.

    The sealed true values are not read.

    Parameters
    ----------
    records
        Folder of raw records: the folder ``records`` of a result folder, or a folder from another
        laboratory that contains a ``laboratory.toml``.
    replaces
        Result folder of the report that the new report replaces.
    reason
        Reason for the replacement. The certificate states the replaced report and the reason.
    history
        Result folders of at least three earlier tests, or a folder that contains them. The earlier
        tests are of this bat design, by the same procedure, in this laboratory. They are used
        instead of the history that is stored with the records.

    Returns
    -------
    Certificate
        The certificate in memory. Its method ``save`` writes the files.

    Raises
    ------
    InputError
        A record, calibration or procedure is missing or cannot be used. The folder `replaces` has
        no certificate. Only one of `replaces` and `reason` is stated. `history` has fewer than
        three tests, or tests of another kind.
    """
    from virtual_lab import catalog
    from virtual_lab.certificate.chain import replaced_report
    from virtual_lab.certificate.history import earlier_scatter, kind_of
    from virtual_lab.measurement.procedure import Procedure
    from virtual_lab.studies.foreign import certify_folder

    folders = paths_of(history)

    def with_options(session: Session) -> Session:
        particulars = session.particulars
        rules = catalog.read(session.procedure_text, "procedure.toml", Procedure)
        replaced = replaced_report(replaces, reason, session.bat, rules.spec.name)
        return replace(
            session,
            particulars=replace(particulars, replaces=replaced) if replaced else particulars,
            history=earlier_scatter(folders, kind_of(session), session) or session.history,
        )

    return Certificate(certification=certify_folder(Path(records), with_options))


def compare_with_truth(folder: ResultFolder, *, progress: Progress = quiet) -> CertificateScore:
    """Compare a certificate with the true values.

    The test is played again from its truth. The exit code of the command is 3 if files were changed
    since the test, if the folder contradicts itself, or if truth or records differ from the replay.
    It is 4 if the test could not be played again: another version made it, or a rig is missing.

    Parameters
    ----------
    folder
        Result folder with ``certificate.json`` and ``truth/``.
    progress
        Function that is called with a message that names the current task. If it is not given, the
        functions of `virtual_lab` and the commands show the progress on stderr.

    Raises
    ------
    InputError
        Certificate, truth or seal is missing or cannot be compared.
    """
    from virtual_lab.bench.entrance.review import play_day
    from virtual_lab.studies.score import score_folder

    return score_folder(Path(folder), play_day, progress)


def sweep(
    bats: AnyBats,
    *more: AnyBat,
    procedures: AnyProcedures = ("astm-f1881",),
    laboratories: Positive = 100,
    seed: Seed = 1,
    individual: bool = False,
    workers: Positive = 1,
    certificates: NewFolder | None = None,
    traces: bool = False,
    truth: bool = True,
    laboratory: AnyLaboratory | None = None,
    instruments: Instruments = (),
    progress: Progress = quiet,
) -> pd.DataFrame:
    """Test bats in many laboratories.

    The table has one row per test. By default every laboratory tests the nominal bat. To save time,
    the instruments record summary values instead of every gate edge and encoder count.

    Parameters
    ----------
    bats
        Bat: a name in the catalog or a .toml file.

        In Python, a sheet such as ``vl.bat("r161")``, or a list, is also allowed.
    more
        Further bats. A list as `bats` has the same effect.
    procedures
        Test procedure: a name in the catalog or a .toml file.

        In Python, a sheet such as ``vl.procedure("bbcor")``, or a list, is also allowed.
    laboratories
        Number of laboratories. They are numbered from 0. The seed and this number identify a
        laboratory.
    seed
        Seed of the study.
    individual
        Give every laboratory an individual bat, as in ``certify``, instead of the nominal bat.
    workers
        Number of processes. Each has one thread and computes a part of the laboratories.
    certificates
        Folder in which one result folder per test is written, named after bat and procedure.

        The result folders are the same as from ``Certificate.save``, and `load`, `verify` and
        `report` can read them. By default none is written.
    traces
        Let the instruments record every gate edge and encoder count, as in ``certify``. The
        certificates then include the encoder records and their figures, and every laboratory has an
        individual bat. A folder takes 400 kB with traces and 120 kB without, each including the
        truth. Needs ``certificates``.
    truth
        Store the sealed truth with each certificate, for ``score``. It takes 11 kB per folder.
        Without certificates: state the true values and errors in the table.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog.
    instruments
        Instruments and rigs with changed values, used instead of the catalog entries.

        Example: ``[vl.instrument("pivot-gates").with_(distance_u="0.2 mm")]``.
    progress
        Function that is called with a message, the number of tests done, and the total. If it is
        not given, the functions of `virtual_lab` and the commands show the progress on stderr.

    Returns
    -------
    pandas.DataFrame
        Columns: ``bat``, ``procedure``, ``laboratory`` (number), ``verdict``, ``reason`` (empty
        for PASS, or without a limit), ``metric`` (symbol) and ``unit``. The columns
        ``value``, ``u``, ``low`` and ``high`` (95 % interval), ``true`` and ``error`` (value minus
        true) are in this unit. The collision efficiency e_A, the bat-ball restitution e, the recoil
        factor r and the ball-wall restitution e0 have three columns each: value, u and true value,
        such as ``restitution``, ``restitution_u`` and ``restitution_true``. Numbers are NaN for a
        test without a result. Each changed number of a sheet has a column named by its key and
        unit, such as ``windows.speed_tolerance_mph``. ``attrs["units"]`` has the unit of each
        column.

    Raises
    ------
    InputError
        A name is unknown, a file cannot be used, `seed` is not a whole number of at least 0, there
        is not at least one laboratory and one worker, or `traces` is requested without
        `certificates`.
    """
    from virtual_lab.files import check_writable
    from virtual_lab.studies.sweep import sweep_tests

    if traces and certificates is None:
        raise InputError("", "traces", traces, "allowed only with {certificates}")
    if certificates is not None:
        check_writable(Path(certificates), "certificates")
    keep = None if certificates is None else partial(_keep, Path(certificates), seed, truth)
    table = sweep_tests(
        entry_names(bats) + entry_names(more),
        entry_names(procedures),
        laboratories,
        seed,
        individual=individual,
        workers=workers,
        summed=not traces,
        keep=keep,
        progress=progress,
    )
    hidden = "" if truth or keep else r"^(true|error|.*_true)$"
    return table.drop(columns=table.filter(regex=hidden).columns) if hidden else table


def _keep(folder: Path, seed: int, truth: bool, test: BatTest) -> Path:
    """Write the certificate of one test of a study, with its truth or without."""
    session, number = test.certification.session, test.sealed.number
    name = f"{session.bat}-{test.certification.procedure.name}-{number:05d}"
    sealed = test.sealed if truth else None
    folder.mkdir(exist_ok=True)
    return Certificate(certification=test.certification, sealed=sealed, seed=seed).save(
        folder / name
    )
