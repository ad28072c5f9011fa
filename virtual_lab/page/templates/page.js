const one = (selector, within = document) => within.querySelector(selector);
const all = (selector, within = document) => [...within.querySelectorAll(selector)];
const encode = encodeURIComponent;
// the progress of a run, and a new page at its end
const running = one("[data-progress]");
async function follow() {
  const answer = await fetch(running.dataset.progress).catch(() => ({})); // the server may be busy, or end
  const state = answer.ok ? await answer.json() : { live: true };
  if (!state.live) return location.reload();
  if (state.line && one("#line").textContent !== state.line) one("#line").textContent = state.line;
  if (state.total) Object.assign(one("progress"), { max: state.total, value: state.done });
  setTimeout(follow, 500);
}
if (running) setTimeout(follow, 500); else setInterval(() => fetch("/icon.svg", { cache: "reload" }).catch(() => 0), 60000);
// a page in full height, and its print, also by Ctrl-P: a frame in a print is cut at the ends of the pages
all("iframe").forEach(frame => {
  const fit = () => { frame.style.height = `${frame.contentDocument.documentElement.offsetHeight + 24}px`; };
  const print = event => {
    if (event.key && !(event.key === "p" && (event.ctrlKey || event.metaKey))) return;
    event.preventDefault();
    frame.contentWindow.print();
  };
  addEventListener("load", () => {
    new ResizeObserver(fit).observe(frame.contentDocument.documentElement);
    [window, frame.contentWindow].forEach(each => each.addEventListener("keydown", print));
  });
  one("[data-print]").addEventListener("click", print);
});
// Back shows a form with its values, and no question whether to send them again
const form = one("form.card");
const keep = () => history.replaceState(null, "", `?${new URLSearchParams([["all", "yes"], ...[...new FormData(form)].filter(([, text]) => text)])}`);
form?.addEventListener("submit", keep);
if (form && !location.search && one(".wrong, .message")) keep();
// uploads with progress
const send = (file, name, bar) => new Promise((resolve, reject) => {
  const request = new XMLHttpRequest();
  request.open("POST", `/upload?name=${encode(name)}`);
  request.responseType = "json";
  request.upload.onprogress = event => { bar.value = event.loaded / event.total; };
  request.onloadend = () => request.status === 200 ? resolve(request.response) : reject(new Error(request.response?.fault || "The file could not be stored."));
  request.send(file);
});
function offer(control, path, title) {
  if (control.tagName === "SELECT") control.add(new Option(title, path, true, true));
  else {
    const box = Object.assign(document.createElement("input"), { type: "checkbox", name: control.dataset.name, value: path, checked: true });
    control.prepend(document.createElement("label"));
    control.firstChild.append(box, ` ${title}`);
  }
  control.dispatchEvent(new Event("change"));
}
// a file that is being sent holds the form back, and one that cannot be stored does so once
all(".upload").forEach(place => {
  const [bar, words, inputs, control] = [one("progress", place), one("output", place), all("input", place), document.getElementById(place.dataset.for)];
  const hold = reason => inputs.forEach(each => each.setCustomValidity(reason));
  const say = (text, reason = "", kind = "") => {
    [words.textContent, words.className] = [text, kind];
    hold(reason);
  };
  const upload = async ({ target: input }) => {
    const [files, folder] = [[...input.files], input.webkitdirectory];
    let [stored, name] = [];
    try {
      for (const file of files) {
        say(`sending ${name = file.name}`, `Wait until ${name} is stored.`);
        stored = await send(file, file.webkitRelativePath || name, bar);
      }
      if (stored) offer(control, ...(folder ? [stored.folder, stored.folder.split(/[\\/]/).at(-1)] : [stored.path, stored.title]));
      say(stored ? "stored and chosen" : "");
    } catch ({ message }) {
      const fault = `${name}: ${message} Choose another file, or press Run again to run without it.`;
      [bar.value, input.value] = [0, ""];
      say(fault, fault, "fault");
    }
  };
  place.addEventListener("change", upload);
  control.addEventListener("change", () => say(""));
  place.addEventListener("invalid", () => {
    place.closest("details")?.setAttribute("open", "");
    if (words.className) setTimeout(hold, 0, "");
  }, true);
});
// a clip: points set in its frames become fields of the form, or correct the track of a result
const panel = one(".clip");
if (panel) {
  const part = name => one(name, panel);
  const [view, stage, picture, drawing, slide, words] = [".view", ".stage", "img", "svg", "[type=range]", "[role=status]"].map(part);
  const [flight, radius, track, chosen] = [part("[data-flight]"), part("[data-radius]"), panel.dataset.track, one("[name=clip]")];
  const COLUMNS = ["frame", "time_s", "x_px", "y_px", "radius_px", "flight", "drift_x_px", "drift_y_px"];
  const field = name => one(`[name="${name}"]`);
  const numbers = name => (field(name)?.value.match(/[\d.]+/g) ?? []).map(Number);
  const kind = () => part("[type=radio]:checked")?.value;
  let size = null, cross = [0, 0], corner = null, drag = null, busy = null, first = [], rows = first, past = []; // first: rows of the result, or of the next one; past: functions that undo the changes
  const here = (among = rows) => among.find(row => +row.frame === +slide.value);
  const wrong = () => [flight, radius].find(each => each.validity.patternMismatch);
  // the drift of the camera in the shown frame, from those of the positions around it
  const drift = () => {
    const [a, b] = [rows.findLast(row => +row.frame <= slide.value) ?? rows[0], rows.find(row => +row.frame >= slide.value) ?? rows.at(-1)];
    return ["drift_x_px", "drift_y_px"].map(name => a ? +a[name] + (b[name] - a[name]) * (slide.value - a.frame) / (b.frame - a.frame || 1) : 0);
  };
  const spot = (row, [x, y] = drift()) => [+row.x_px + x, +row.y_px + y];
  const line = (...points) => `<path d="M${points.join("L")}"/>`;
  const box = ([x, y], [u, v]) => line([x, y], [u, y], [u, v], [x, v], [x, y]);
  const circle = ([x, y], r) => `<circle cx="${x}" cy="${y}" r="${r}"/>`;
  const draw = () => {
    const [[x, y], r, shift, used, row] = [cross, Math.hypot(size.width, size.height) / 70, drift(), numbers("frames"), here()];
    const [ball, [left, top, wide, high], scale] = ["ball_at", "region", "scale"].map(numbers);
    part("output").textContent = `${slide.value} of ${slide.max}${used.length ? `, used: ${used.join(" to ")}` : ""}`;
    drawing.innerHTML = [
      line([x - r, y], [x + r, y]) + line([x, y - r], [x, y + r]),
      corner && (kind() === "region" ? box : line)(corner, cross),
      !track && ball[2] === +slide.value && circle(ball, r),
      high && box([left, top], [left + wide, top + high]),
      scale.length > 3 && line(scale.slice(0, 2), scale.slice(2, 4)),
      ...rows.map(each => circle(spot(each, shift), each === row ? +each.radius_px || 0 : r / 6)),
    ].filter(Boolean).join("");
    part("[data-undo]").disabled = !corner && !past.length;
    all("[data-clear]", panel).forEach(each => { each.hidden = !field(each.dataset.clear).value; });
    if (!track) return;
    const [few, some] = Object.entries(Object.groupBy(rows, each => each.flight)).find(([name, of]) => name && of.length < 5) ?? [];
    const reason = few ? `flight ${few} has ${some.length} of the 5 positions that it needs` : "";
    flight.setCustomValidity(reason);
    part(".fault").textContent = wrong() === flight ? flight.title : reason;
    [part("[data-remove]").disabled, part("button.main").disabled] = [!row, !past.length || !rows.length || chosen.form.matches(":invalid")];
    const ends = [rows.findLast(each => +each.frame < slide.value), rows.find(each => +each.frame > slide.value)].map(each => each?.flight);
    const between = ends.every(Boolean) && ends[0] !== ends[1] ? ": between two flights the ball touches something, or is not seen free of it" : "";
    const none = `${here(first) ? "position removed" : `no position${between}`}; a click adds one of this flight and radius`;
    words.textContent = `Frame ${slide.value}: ${row ? `the ball at ${spot(row).map(each => each.toFixed(1)).join(", ")} px, ${row.flight ? `flight ${row.flight}` : "outside flights"}` : none}`;
  };
  const show = async () => {
    const frame = busy = slide.value;
    picture.src = `/clip?path=${encode(chosen.value)}&state=${size.state}&frame=${frame}`;
    await Promise.all([picture.decode().catch(() => 0), new Promise(done => setTimeout(done, 60))]);
    [picture.alt, busy] = [`Frame ${frame} of the clip`, null];
    if (frame !== slide.value) show();
  };
  const step = () => {
    const row = here();
    if (row) [cross, flight.value, radius.value] = [spot(row), row.flight, row.radius_px && +(+row.radius_px).toFixed(2)];
    draw();
    busy ?? show();
  };
  const put = (name, text, changes = past) => {
    changes.push(put.bind(null, name, field(name).value, []));
    field(name).value = text;
    words.textContent = `${one(`label[for="f-${name}"]`).textContent}: ${text || "not stated"}`;
    draw();
  };
  const change = values => {
    const [row, before, frame] = [here(), rows, slide.value];
    past.push(() => { [rows, slide.value] = [before, frame]; });
    rows = [...rows.filter(each => each !== row), ...values ? [{ ...row, ...values }] : []].sort((a, b) => a.frame - b.frame);
    draw();
  };
  const undo = () => {
    if (corner) [corner, words.textContent] = [null, ""];
    else past.pop()();
    step();
  };
  const set = () => {
    const [drift_x_px, drift_y_px] = drift();
    const stated = () => here() ? {} : { flight: flight.value, radius_px: radius.value };
    if (track) return wrong()?.reportValidity() ?? change({ ...stated(), frame: slide.value, x_px: cross[0] - drift_x_px, y_px: cross[1] - drift_y_px, drift_x_px, drift_y_px });
    const [[x, y], [u, v] = []] = [cross = cross.map(Math.round), corner ?? []];
    const region = [Math.min(x, u), Math.min(y, v), Math.abs(u - x), Math.abs(v - y)].join();
    const scale = `${u},${v}:${x},${y}=${part("[data-length]").value.replace(/ /g, "")}`;
    corner = kind() === "ball_at" || corner ? null : cross;
    if (!corner) return put(kind(), { ball_at: `${x},${y}@${slide.value}`, region, scale }[kind()]);
    words.textContent = "Set the second point.";
    draw();
  };
  const move = (right, down) => {
    cross = [[cross[0] + right, size.width], [cross[1] + down, size.height]].map(([at, end]) => Math.min(Math.max(at, 0), end - 1));
    draw();
  };
  // a click sets a point, a drag two
  const on = (name, act) => stage.addEventListener(name, event => {
    if (name === "pointerdown" ? event.button : !drag) return;
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(drawing.getScreenCTM().inverse());
    move(at.x - cross[0], at.y - cross[1]);
    act(event);
    draw();
  });
  on("pointerdown", event => { drag = cross; stage.setPointerCapture(event.pointerId); });
  on("pointermove", () => { if (["scale", "region"].includes(kind()) && Math.hypot(cross[0] - drag[0], cross[1] - drag[1]) > size.width / 100) corner = drag.map(Math.round); });
  on("pointerup", () => { drag = set(); });
  on("pointercancel", () => { drag = corner = null; });
  // scrolls the picture alone: the buttons of the page stay below the pointer
  const look = () => {
    const zoom = stage.clientWidth / size.width;
    view.scrollTo(cross[0] * zoom - view.clientWidth / 2, cross[1] * zoom - view.clientHeight / 2);
  };
  const go = frames => {
    slide.stepUp(frames);
    step();
    look();
  };
  stage.addEventListener("keydown", event => {
    const by = event.shiftKey ? 1 : 8;
    const moves = { ArrowLeft: () => move(-by, 0), ArrowRight: () => move(by, 0), ArrowUp: () => move(0, -by), ArrowDown: () => move(0, by) };
    const act = { ...moves, Enter: set, Delete: () => here() && change(), PageUp: () => go(-1), PageDown: () => go(1) }[event.key];
    if (!act) return;
    event.preventDefault();
    act();
    look();
  });
  // the frames of a warning
  if (track) all("main > .soft").forEach(each => { each.innerHTML = each.innerHTML.replace(/(?<= frames? [\d, ]*)\d+(?=[\d, ]* (?:is|are))/g, number => `<button type="button" data-frame="${number}">${number}</button>`); });
  panel.addEventListener("keydown", event => {
    if (!(event.ctrlKey || event.metaKey) || event.key !== "z" || part("[data-undo]").disabled) return;
    event.preventDefault();
    undo();
  });
  const end = which => {
    const ends = (field("frames").value || `0:${slide.max}`).split(":").with(which, slide.value);
    if (+ends[0] >= +ends[1]) ends[1 - which] = +which ? 0 : slide.max;
    put("frames", ends.join(":"));
  };
  const frame = number => {
    slide.value = number;
    step();
    stage.focus();
  };
  const acts = { step: go, end, undo, frame, remove: () => change(), clear: name => put(name, "") };
  addEventListener("click", ({ detail, target }) => Object.keys(target.dataset).filter(name => acts[name]).forEach(name => {
    acts[name](target.dataset[name]);
    if (detail || target.disabled || target.hidden) stage.focus({ preventScroll: true }); // a key stays on its button
  }));
  addEventListener("input", ({ target }) => {
    if (!size) return;
    if (target === slide) return step();
    if (target.type === "radio") corner = null;
    if ("zoom" in target.dataset) { stage.style.setProperty("--zoom", target.value); look(); }
    if (here() && [flight, radius].includes(target) && !wrong()) change({ [target === flight ? "flight" : "radius_px"]: target.value });
    if ("length" in target.dataset && field("scale").value) put("scale", `${field("scale").value.split("=")[0]}=${target.value.replace(/ /g, "")}`);
    draw();
  });
  addEventListener("beforeunload", event => rows !== first && event.preventDefault());
  chosen.form.addEventListener("submit", async event => {
    sessionStorage[chosen.value] = slide.value; // kept if a field is refused
    if (!track) return;
    event.preventDefault();
    const lines = [COLUMNS, ...rows.map(row => COLUMNS.map(name => row[name] ?? ""))];
    const name = `${chosen.value.split(/[\\/]/).at(-1)}-corrected.csv`;
    try { field("corrected").value = (await send(new Blob([lines.join("\n")]), name, {})).path; } catch (fault) { words.textContent = fault.message; return; }
    first = rows;
    chosen.form.submit();
  });
  const load = async () => {
    [panel.inert, panel.hidden, words.textContent] = [true, false, "reading the clip"];
    const answer = await fetch(`/clip?path=${encode(chosen.value)}`);
    if (panel.hidden = !answer.ok) return;
    const [head, ...lines] = track ? (await (await fetch(track)).text()).trim().split(/\r?\n/).map(each => each.split(",")) : [];
    first = rows = lines.map(cells => Object.fromEntries(head.map((name, n) => [name, cells[n]]))).filter(row => row.x_px);
    size = await answer.json();
    [cross, slide.max, past.length] = [[size.width / 2, size.height / 2].map(Math.round), size.count - 1, 0];
    Object.assign(stage.style, { aspectRatio: size.width / size.height, maxWidth: `calc(var(--zoom, 1) * ${75 * size.width / size.height}vh)` });
    drawing.setAttribute("viewBox", `-.5 -.5 ${size.width} ${size.height}`);
    slide.value = (track ? rows[0]?.frame : sessionStorage[chosen.value]) ?? 0;
    if (track) radius.value = +(+(rows[0]?.radius_px || size.width / 60)).toFixed(2);
    [panel.inert, words.textContent] = [false, ""];
    step();
    one(".wrong :focus")?.scrollIntoView({ block: "center" }); // the clip has moved it
  };
  chosen.addEventListener("change", load);
  if (chosen.value) load();
}
