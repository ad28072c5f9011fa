"""A whole day that an operator or a script carries out without a page, with its debrief."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from virtual_lab.bench.day.desk import Desk
from virtual_lab.bench.day.doubts import fault_titles
from virtual_lab.bench.day.log import LOG
from virtual_lab.bench.day.operators import Operator, by_script, operator_of
from virtual_lab.bench.day.scenario import load_scenario
from virtual_lab.bench.machines.stored_day import SECRET, StoredDay
from virtual_lab.bench.scoring.debrief import Debrief, debrief_of
from virtual_lab.bench.scoring.debrief_page import save_debrief
from virtual_lab.certificate.filling import certificate
from virtual_lab.certificate.html import certificate_page
from virtual_lab.certificate.result_folder import close_result, write_result
from virtual_lab.errors import InputError
from virtual_lab.files import new_folder, read_json
from virtual_lab.output.metrics import METRICS
from virtual_lab.output.result import preformatted_html
from virtual_lab.parameters import AnyLaboratory, File, OperatorSeed, Seed
from virtual_lab.records.session import pack
from virtual_lab.sheets import AnyName, Instruments
from virtual_lab.simulation.physics.truth import SealedTruth

SCRIPT = "actions.json"


@dataclass(frozen=True, kw_only=True, repr=False)
class RehearsedDay:
    """A day that an operator carried out: debrief, log, sealed file and desk."""

    debrief: Debrief
    files: Mapping[str, bytes]  # contents by file name
    desk: Desk
    sealed: SealedTruth | None = None  # None: its hits cannot be reduced
    settings: str = ""  # arguments of the call that made it, as ``settings.toml``

    @property
    def document(self) -> dict[str, Any]:
        """The debrief as a JSON object."""
        return self.debrief.document()

    @property
    def text(self) -> str:
        """Verdict, scores, faults and most costly decisions, as lines of text."""
        debrief, metric, titles = self.debrief, METRICS[self.debrief.metric], fault_titles()

        def change(value: float) -> str:
            return metric.text(lambda size: f"{value / size:+.4f}")

        because = f": {debrief.right_because}" if debrief.right_because else ""
        lines = [
            f"{debrief.title}: verdict {debrief.verdict}, correct {debrief.right_verdict}{because}"
        ]
        lines += [f"  {each.name:<10} {each.value:.2f}  {each.because}" for each in debrief.scores]
        for fault in debrief.fault_reviews:
            named = "named" if fault.name in debrief.found else "not named"
            effect = "unknown" if fault.moved is None else change(fault.moved)
            lines.append(f"  fault, {named}: {titles[fault.name]}; effect on the result: {effect}")
        for each in debrief.costly:
            cost = "" if each.cost is None else f" {change(each.cost)}"
            lines.append(f"  {each.word}{cost}: {each.what}")
        return "\n".join(lines)

    def save(self, folder: str | Path, *, overwrite: bool = False) -> Path:
        """Write the day and, if its hits can be reduced, its result into a new folder.

        The day consists of log, sealed file and debrief. ``actions.json`` is a script of all
        actions, which can be changed and carried out again. The result has the files of any test,
        so `verify`, `score`, `load`, `reduce` and `report` read it. Its records contain all shots
        and the operator's decisions about them; the certificate lists each decision against the
        rules.

        Parameters
        ----------
        folder
            The new folder.
        overwrite
            Replace a result folder of this name, as a whole.

        Returns
        -------
        Path
            The folder.

        Raises
        ------
        InputError
            The folder is not empty, or is not a result folder if it is to be overwritten.
        """
        target = Path(folder)
        with new_folder(target, self.settings, overwrite=overwrite) as draft:
            for name, content in self.files.items():
                (draft / name).write_bytes(content)
            (draft / SECRET).chmod(0o600)
            (draft / SCRIPT).write_text(self._script, encoding="utf-8")
            save_debrief(self.debrief, draft)
            if self.sealed is not None:
                certification, truth = self.desk.certification, self.sealed.content
                records = pack(certification.session)
                printed = certificate(
                    certification,
                    truth_digest=hashlib.sha256(truth).hexdigest(),
                    session_digest=records.digest,
                )
                write_result(draft, printed, certification, records, truth)
                (draft / "certificate.html").write_text(certificate_page(printed), "utf-8")
                close_result(draft, printed, certification)
        return target

    @property
    def _script(self) -> str:
        """The actions as a script, one per line."""
        lines = (
            json.dumps({"do": event.action, **event.arguments}) for event in self.desk.day.events
        )
        return '{"actions": [\n' + ",\n".join(lines) + "\n]}\n"

    def _repr_html_(self) -> str:
        return preformatted_html(self.text)

    def __repr__(self) -> str:
        return f"<Day of {self.text.splitlines()[0]}>"


def rehearse(
    scenario: AnyName = "plain-day",
    *,
    operator: str | Operator = "book",
    script: File | None = None,
    seed: Seed | None = None,
    operator_seed: OperatorSeed = 0,
    laboratory: AnyLaboratory | None = None,
    instruments: Instruments = (),
) -> RehearsedDay:
    """Let an operator carry out a day at the rehearsal bench; return the day and its debrief.

    Parameters
    ----------
    scenario
        Name of a shipped scenario, or path of a .toml file.
    operator
        ``book``, ``expert``, ``careful``, ``careless``, ``cheating``, or a generator function that
        yields actions. The generator function has one parameter, a function that returns the
        current `Desk` (the results of the day so far).
    script
        Path of a .json file with actions, instead of an operator. A saved day contains such a file,
        ``actions.json``.
    seed
        Seed of the laboratory. By default a random seed.
    operator_seed
        Seed that determines which mistakes the operator makes.
    laboratory
        Folder of a laboratory, made by ``laboratory`` or by hand. Its sheets of instruments, rigs
        and balls replace those of the catalog.
    instruments
        Sheets of instruments and rigs with changed values, as for `certify`.

    Raises
    ------
    InputError
        The scenario, the operator or an action does not exist, an action is not possible at its
        time, or the operator did not hand in the day.
    """
    if script is not None:
        taker = by_script(read_json(Path(script)), str(script))
    else:
        taker = operator_of(operator, operator_seed) if isinstance(operator, str) else operator
    entry = load_scenario(str(scenario))
    person = "the script" if script else getattr(operator, "__name__", str(operator))
    with TemporaryDirectory(prefix="virtual-lab-day-") as parent:
        folder = Path(parent) / "day"
        day = StoredDay.begin(folder, entry, seed, person)
        try:
            day.run_operator(taker)
            debrief = debrief_of(day)
        except InputError as fault:
            if script is None:
                raise
            number = len(day.day.events) - day.day.supplied_events + 1
            raise InputError(str(script), f"actions[{number}]", None, str(fault)) from fault
        files = {name: (folder / name).read_bytes() for name in (LOG, SECRET)}
    can_be_reduced = day.day.fired and not day.desk.reduction_error
    return RehearsedDay(
        debrief=debrief,
        files=files,
        desk=day.desk,
        sealed=day.apparatus.finish(day.desk).sealed if can_be_reduced else None,
    )
