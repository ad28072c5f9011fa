"""The web application of the page: forms, runs, results and their files."""

from __future__ import annotations

import io
import re
import zipfile
from collections.abc import Callable, Mapping, Sequence
from datetime import datetime
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import parse_qs, quote

from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import Route

from virtual_lab.api.describing import REQUIRED
from virtual_lab.commands.call import RefusedError
from virtual_lab.commands.command import Command
from virtual_lab.commands.table import SECTIONS, every_command
from virtual_lab.commands.wording import parameters_named
from virtual_lab.errors import InputError
from virtual_lab.files import inside
from virtual_lab.files.folders import folder_kinds
from virtual_lab.output.template import page_template
from virtual_lab.page import wording
from virtual_lab.page.clips import clip_size, frame_picture
from virtual_lab.page.fields import choices_in, controls, form_values
from virtual_lab.page.runs import Runs, StartedRun
from virtual_lab.page.uploads import LARGEST_UPLOAD, UPLOADS, receive
from virtual_lab.page.wording import field_name, limits, refusal, texts
from virtual_lab.web.answers import KEPT, SANDBOX, sentence_page, static_routes
from virtual_lab.web.door import Door, Seat

Thing = TypeVar("Thing")
PACKAGE = "virtual_lab.page"
Form = Mapping[str, Sequence[str]]  # texts of a form by name of the field
SHOWN = (".html", ".png", ".svg", ".webp")  # files that a browser shows


class Page:
    """The page of one folder."""

    def __init__(self, folder: Path, quit_now: Callable[[], None]) -> None:
        self.folder, self.runs, self.quit_now = folder, Runs(folder), quit_now
        self.commands = every_command()

    def render(self, name: str, status: int = 200, **values: Any) -> Response:
        """Return a page made from a template."""
        template = page_template(PACKAGE, name, "virtual_lab.web")
        html = template.render(
            folder=self.folder,
            commands=self.commands,
            sections=SECTIONS,
            local_time=datetime.fromtimestamp,
            words=wording,
            REQUIRED=REQUIRED,
            **values,
        )
        return HTMLResponse(html, status_code=status)

    def start(self, request: Request) -> Response:
        """Return the start page."""
        self.runs.adopt()
        size = sum(path.stat().st_size for path in self.folder.rglob("*") if path.is_file())
        asks = "quit" in request.query_params
        return self.render("start.html", runs=self.runs.all(), size=size, asks=asks)

    def form(self, command: Command, values: Form, faults: Mapping[str, str]) -> Response:
        """Return the form of a command, with sentences about values that were refused.

        The key of a sentence is the name of its field, or empty for a sentence above the form.
        """
        fields = controls(command, self.folder, values, faults)
        status, general = 422 if any(faults.values()) else 200, faults.get("", "")
        return self.render("form.html", status, command=command, fields=fields, general=general)

    def ask(self, request: Request) -> Response:
        """Return the form of a command, with the values of an address or of an earlier run."""
        command, stated = self._command(request), request.query_params
        if (run := self._earlier(request)) is None:
            # with `all` the address states each field: one without a value is not ticked
            keys = command.parameters if "all" in stated else stated
            return self.form(command, {key: stated.getlist(key) for key in keys}, {})
        values = {key: texts(each) for key, each in run.call["values"].items()}
        return self.form(command, values, {run.outcome["field"]: run.outcome["refused"]})

    def _earlier(self, request: Request) -> StartedRun | None:
        """Return the run that the address of a form states, or None."""
        number = request.query_params.get("run", "")
        return self.runs.get(int(number)) if number.isdecimal() and len(number) < 7 else None

    def _command(self, request: Request) -> Command:
        return _require(self.commands.get(request.path_params["name"]))

    @parameters_named(field_name)
    def begin(self, request: Request, form: Form) -> Response:
        """Start a run with the values of a form, or return the form with what is refused."""
        command, earlier = self._command(request), self._earlier(request)
        form = {key: form.get(key, ()) for key in command.parameters}
        try:
            run = self.runs.start(command, form_values(command, form), earlier)
        except RefusedError as fault:
            refused = {key: self._sentence(command, key, form, fault) for key in fault.faults}
            return self.form(command, form, refused)
        except InputError as fault:
            return self.form(command, form, dict([refusal(command, fault, form)]))
        return RedirectResponse(f"/run/{run.number}", status_code=303)

    def _sentence(self, command: Command, key: str, form: Form, fault: RefusedError) -> str:
        """Return the sentence about a refused value of a form."""
        text, rule = ", ".join(form.get(key, ())).strip(), command.fields[key].rule
        if of_other_kind := re.fullmatch("(.*): folder; (is .*)", fault.faults[key]):
            return "“{}” {}.".format(*of_other_kind.groups())
        number = re.sub("^one ", "a ", rule.allowed).replace("2^128 - 1", "2¹²⁸ − 1")
        allowed = number if rule.kind == "number" else limits(rule) or "one of the choices"
        return f"“{text}” cannot be used. Allowed: {allowed}." if text else "Fill in this field."

    def result(self, request: Request) -> Response:
        """Return the page of a run: its progress, or its result."""
        run = self._run(request)
        written = [*run.outcome["written"], run.day]
        target = next((each for each in written if each and Path(each).is_dir()), "")
        return self.render(
            "result.html",
            run=run,
            command=self.commands[run.call["command"]],
            files=[name for name, path in run.files.items() if "truth" not in path.parts],
            target=target,
            sources=[each for each in self.runs.all() if run.is_of(each)],
            kinds=folder_kinds(Path(target)) if target else (),
            sealed=(Path(target) / "truth" / "truth.json").is_file(),
            comparable=len([*choices_in(self.folder, ("result",), ())]) > 1,
        )

    def _run(self, request: Request) -> StartedRun:
        return _require(self.runs.get(request.path_params["number"]))

    def progress(self, request: Request) -> Response:
        """Return the progress of a run as JSON. It is not live if its page shows another stage."""
        run = self._run(request)
        counted = re.search(r": +(\d+) of (\d+)", run.progress)
        done, total = map(int, counted.groups()) if counted else (0, 0)
        live = run.live and run.stage == request.query_params.get("stage", "")
        return JSONResponse({"live": live, "line": run.progress, "done": done, "total": total})

    def file(self, request: Request) -> Response:
        """Return a file of a result; a page or picture to be shown, anything else to be kept."""
        run = self._run(request)
        path = _require(run.files.get(request.query_params.get("name", "")))
        shown = "inline" if path.suffix in SHOWN else "attachment"
        kept = f"{shown}; filename*=utf-8''{quote(path.name)}"
        return FileResponse(path, headers={**SANDBOX, "Content-Disposition": kept})

    def clip(self, request: Request) -> Response:
        """Return the size of a clip as JSON, or the frame with a number as a picture."""
        asked = request.query_params
        try:
            path = inside(self.folder, asked["path"], "clip", "path")
            if "frame" not in asked:
                return JSONResponse(clip_size(path))
            picture = frame_picture(path, int(asked["frame"]))
            return Response(picture, media_type="image/jpeg", headers=KEPT)
        except (KeyError, ValueError) as fault:  # includes InputError
            return sentence_page(404, str(fault))

    def archive(self, request: Request) -> Response:
        """Return the files of a result as one file; the sealed truth only if it was ticked."""
        run = self._run(request)
        with_truth, content = "truth" in request.query_params, io.BytesIO()
        with zipfile.ZipFile(content, "w", zipfile.ZIP_DEFLATED) as archive:
            for name, path in run.files.items():
                if with_truth or "truth" not in path.parts:
                    archive.write(path, name)
        name = f"{run.call['command']}-{run.number}.zip".replace(" ", "-")
        headers = {"Content-Disposition": f'attachment; filename="{name}"'}
        return Response(content.getvalue(), media_type="application/zip", headers=headers)

    def cancel(self, request: Request) -> Response:
        """End a run in progress."""
        self.runs.cancel(request.path_params["number"])
        return RedirectResponse("/", status_code=303)

    def quit(self, request: Request) -> Response:
        """End all runs and the server. With a run in progress the start page asks first."""
        asks = any(run.live and not run.outcome["answer"] for run in self.runs.all())
        if asks and "sure" not in request.query_params:
            return RedirectResponse("/?quit=yes", status_code=303)
        self.runs.end()
        self.quit_now()
        return sentence_page(200, f"Results are in {self.folder}.", title="The page is closed")


def _require(thing: Thing | None) -> Thing:
    """Return `thing`. Raise `HTTPException` if it is None, so that there is no such page."""
    if thing is None:
        raise HTTPException(404)
    return thing


class PageDoor(Door):
    """The door of the page, through which large files come to one address only."""

    once = f"{Door.once} Start the program again for another address: all results are there again."

    @property
    def last_request(self) -> float:
        """Time of the last request of the user [s], 0 without one."""
        # another thread appends to the times, so none are iterated
        times = [seat.request_times for seat in list(self.seats.values())]
        return max([0.0, *(each[-1] for each in times if each)])

    def largest_body(self, request: Request) -> int:
        """Return the largest length of a request [B]."""
        return LARGEST_UPLOAD if request.url.path == "/upload" else super().largest_body(request)


def page_application(page: Page, token: str, hosts: frozenset[str]) -> PageDoor:
    """Return the web application of a page, whose first address has a token."""

    async def begin(request: Request) -> Response:
        body = (await request.body()).decode("utf-8", errors="replace")
        try:
            form = parse_qs(body, max_num_fields=500)
        except ValueError:
            return sentence_page(422, "A form may have at most 500 fields.")
        return await run_in_threadpool(page.begin, request, form)

    async def upload(request: Request) -> Response:
        try:
            path = await receive(request, page.folder)
        except InputError as fault:
            return JSONResponse({"fault": fault.allowed}, status_code=422)
        home = page.folder / UPLOADS
        whole = home / path.relative_to(home).parts[0]  # the folder of which it is a file
        title = str(path.relative_to(page.folder))
        return JSONResponse({"path": str(path), "title": title, "folder": str(whole)})

    routes = [
        Route("/", page.start),
        Route("/form/{name}", begin, methods=["POST"]),
        Route("/form/{name}", page.ask),
        Route("/run/{number:int}", page.result),
        Route("/run/{number:int}/progress", page.progress),
        Route("/run/{number:int}/file", page.file),
        Route("/run/{number:int}/zip", page.archive),
        Route("/run/{number:int}/cancel", page.cancel, methods=["POST"]),
        Route("/clip", page.clip),
        Route("/upload", upload, methods=["POST"]),
        Route("/quit", page.quit, methods=["POST"]),
        *static_routes(PACKAGE, "page.css", "page.js"),
        *static_routes("virtual_lab.web", "base.css", "icon.svg"),
    ]
    absent = {404: lambda *_: sentence_page(404, "There is no such page.")}
    inside = Starlette(routes=routes, exception_handlers=absent)
    return PageDoor(inside, {token: Seat()}, hosts=hosts)
