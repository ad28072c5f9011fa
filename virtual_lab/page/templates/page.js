const one = (selector, within = document) => within.querySelector(selector);
const all = (selector, within = document) => [...within.querySelectorAll(selector)];
// the progress of a run, and a new page at its end
const running = one("[data-progress]");
async function follow() {
  const answer = await fetch(running.dataset.progress);
  const state = answer.ok ? await answer.json() : { live: true };
  if (!state.live) return location.reload();
  if (state.line && one("#line").textContent !== state.line) one("#line").textContent = state.line;
  if (state.total) Object.assign(one("progress"), { max: state.total, value: state.done });
  setTimeout(follow, 1000);
}
if (running) setTimeout(follow, 500); else setInterval(() => fetch("/alive").catch(() => 0), 60000);
// the first refused field has the focus
one("[aria-invalid]:not([role]), .wrong input")?.focus();
all("time").forEach(each => { each.textContent = new Date(1000 * each.textContent).toLocaleString([], { dateStyle: "medium", timeStyle: "short" }); });
// a page in full height, and its print
all("iframe").forEach(frame => {
  const whole = () => frame.contentDocument.documentElement;
  const fit = () => { frame.style.height = `${whole().offsetHeight + 24}px`; };
  addEventListener("load", () => new ResizeObserver(fit).observe(whole()));
  const print = one("[data-print]");
  print.hidden = false;
  print.addEventListener("click", () => frame.contentWindow.print());
});
// names that may be chosen in place of a free text
all("[data-fills]").forEach(each => {
  each.hidden = false;
  each.addEventListener("change", () => { document.getElementById(each.dataset.fills).value = each.value; });
});
// uploads with progress
const send = (file, name, bar) => new Promise((resolve, reject) => {
  const request = new XMLHttpRequest();
  request.open("POST", `/upload?name=${encodeURIComponent(name)}`);
  request.responseType = "json";
  request.upload.onprogress = event => { bar.value = event.loaded / event.total; };
  request.onloadend = () => request.status === 200 ? resolve(request.response) : reject(new Error(request.response?.fault || "The file could not be stored."));
  request.send(file);
});
function offer(control, path, title) {
  if (control.tagName === "SELECT") control.add(new Option(title, path, true, true));
  else {
    const box = Object.assign(document.createElement("input"), { type: "checkbox", name: control.closest(".row").dataset.name, value: path, checked: true });
    control.appendChild(document.createElement("label")).append(box, ` ${title}`);
  }
  control.dispatchEvent(new Event("change"));
}
async function upload(input, place) {
  let [bar, words, stored] = [one("progress", place), one("output", place)];
  bar.hidden = false;
  try {
    for (const file of input.files) {
      words.textContent = `sending ${file.name}`;
      stored = await send(file, file.webkitRelativePath || file.name, bar);
    }
    offer(document.getElementById(place.dataset.for), input.webkitdirectory ? stored.folder : stored.path, input.webkitdirectory ? input.files[0].webkitRelativePath.split("/")[0] : stored.title);
    words.textContent = "stored and chosen";
  } catch (fault) { words.textContent = fault.message; }
  bar.hidden = true;
}
all(".upload").forEach(place => {
  place.hidden = false;
  all("input", place).forEach(input => input.addEventListener("change", () => input.files.length && upload(input, place)));
});
// a clip: points set in its frames become fields of the form, or correct the track of a result
const panel = one(".clip");
if (panel) {
  const [stage, slide, chosen, words] = [one(".stage", panel), one("[type=range]", panel), one("[name=clip]"), one("[role=status]", panel)];
  const [picture, drawing, form, flight, track] = [one("img", stage), one("svg", stage), chosen.form, one("[data-flight]", panel), panel.dataset.track];
  const COLUMNS = ["frame", "time_s", "x_px", "y_px", "radius_px", "flight", "drift_x_px", "drift_y_px"];
  const field = name => one(`[name="${name}"]`);
  const numbers = name => (field(name)?.value.match(/[\d.]+/g) ?? []).map(Number);
  const kind = () => one("[type=radio]:checked", panel)?.value ?? "track";
  let size = null, cross = [0, 0], corner = null, drag = null, busy = false, rows = [];
  const here = () => rows.find(row => +row.frame === +slide.value);
  // the drift of the camera in the shown frame, from those of the positions around it
  const drift = () => {
    const [a, b] = [rows.findLast(row => +row.frame <= slide.value) ?? rows[0], rows.find(row => +row.frame >= slide.value) ?? rows.at(-1)];
    return ["drift_x_px", "drift_y_px"].map(name => a ? +a[name] + (b[name] - a[name]) * (slide.value - a.frame) / (b.frame - a.frame || 1) : 0);
  };
  const spot = (row, [x, y] = drift()) => [+row.x_px + x, +row.y_px + y];
  const draw = () => {
    const shape = (name, values) => {
      const each = drawing.appendChild(document.createElementNS("http://www.w3.org/2000/svg", name));
      Object.entries(values).forEach(pair => each.setAttribute(...pair));
    };
    const circle = ([cx, cy], r) => shape("circle", { cx, cy, r });
    const rectangle = ([x, y], [u, v]) => shape("rect", { x: Math.min(x, u), y: Math.min(y, v), width: Math.abs(u - x), height: Math.abs(v - y) });
    const [r, shift] = [size.width / 60, drift()];
    one("output", panel).textContent = `${slide.value} of ${slide.max}${numbers("frames").length ? `, used: ${numbers("frames").join(" to ")}` : ""}`;
    drawing.replaceChildren();
    drawing.setAttribute("viewBox", `-.5 -.5 ${size.width} ${size.height}`);
    shape("path", { d: `M${cross[0] - r} ${cross[1]}h${2 * r}M${cross[0]} ${cross[1] - r}v${2 * r}` });
    if (corner) kind() === "region" ? rectangle(corner, cross) : shape("path", { d: `M${corner}L${cross}` });
    const [[x, y, frame], part, scale] = [numbers("ball_at"), numbers("region"), numbers("scale")];
    if (!track && frame === +slide.value) circle([x, y], r);
    if (part.length === 4) rectangle(part, [part[0] + part[2], part[1] + part[3]]);
    if (scale.length > 3) shape("path", { d: `M${scale.slice(0, 2)}L${scale.slice(2, 4)}` });
    rows.forEach(row => circle(spot(row, shift), row === here() ? row.radius_px || rows[0].radius_px || r : r / 6));
  };
  const tell = () => {
    const row = here();
    words.textContent = `Frame ${slide.value}: ${row ? `the ball at ${spot(row).map(each => each.toFixed(1)).join(", ")} px, ${row.flight ? `flight ${row.flight}` : "outside flights"}` : "no position"}`;
    if (row) [cross, flight.value] = [spot(row), row.flight];
    draw();
  };
  const step = async () => {
    track ? tell() : draw();
    if (busy) return;
    for (busy = true; slide.value !== picture.dataset.frame;) {
      picture.dataset.frame = slide.value;
      picture.src = `/clip?path=${encodeURIComponent(chosen.value)}&state=${size.state}&frame=${slide.value}`;
      await Promise.all([picture.decode().catch(() => 0), new Promise(done => setTimeout(done, 60))]);
    }
    busy = false;
    picture.alt = `Frame ${slide.value} of the clip`;
  };
  const put = (name, text) => {
    field(name).value = text;
    words.textContent = `${one(`label[for="f-${name}"]`).textContent}: ${text}`;
    draw();
  };
  const change = values => {
    const row = here();
    rows = [...rows.filter(each => each !== row), ...values ? [{ ...row, ...values }] : []].sort((a, b) => a.frame - b.frame);
    one("button.main", form).disabled = !rows.length;
    tell();
  };
  const set = () => {
    const [drift_x_px, drift_y_px] = drift();
    if (track) return change({ frame: slide.value, flight: flight.value, x_px: cross[0] - drift_x_px, y_px: cross[1] - drift_y_px, drift_x_px, drift_y_px });
    const [x, y] = cross = cross.map(Math.round);
    if (kind() === "ball_at") return put("ball_at", `${x},${y}@${slide.value}`);
    const [u, v] = corner ?? [];
    corner = corner ? null : cross;
    if (corner) words.textContent = "Set the second point.";
    else if (kind() === "scale") put("scale", `${u},${v}:${x},${y}=${one("[data-length]", panel).value.replace(/ /g, "")}`);
    else put("region", [Math.min(x, u), Math.min(y, v), Math.abs(u - x), Math.abs(v - y)].join());
    draw();
  };
  const move = (right, down) => {
    cross = [[cross[0] + right, size.width], [cross[1] + down, size.height]].map(([at, end]) => Math.min(Math.max(at, 0), end - 1));
    draw();
  };
  // a click sets a point, a drag two
  const pointer = {
    pointerdown: event => { drag = cross; stage.setPointerCapture(event.pointerId); },
    pointermove: () => { if (["scale", "region"].includes(kind()) && Math.hypot(cross[0] - drag[0], cross[1] - drag[1]) > size.width / 100) corner = drag.map(Math.round); },
    pointerup: () => { drag = set(); },
    pointercancel: () => { drag = corner = null; },
  };
  Object.entries(pointer).forEach(([name, act]) => stage.addEventListener(name, event => {
    if (name === "pointerdown" ? event.button : !drag) return;
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(drawing.getScreenCTM().inverse());
    move(at.x - cross[0], at.y - cross[1]);
    act(event);
    draw();
  }));
  const go = frames => step(slide.stepUp(frames));
  stage.addEventListener("keydown", event => {
    const by = event.shiftKey ? 1 : 8;
    const moves = { ArrowLeft: () => move(-by, 0), ArrowRight: () => move(by, 0), ArrowUp: () => move(0, -by), ArrowDown: () => move(0, by) };
    const act = { ...moves, Enter: set, Delete: () => here() && change(), PageUp: () => go(-1), PageDown: () => go(1) }[event.key];
    if (act) act(event.preventDefault());
  });
  slide.addEventListener("input", step);
  all("[data-step]", panel).forEach(button => button.addEventListener("click", () => go(+button.dataset.step)));
  one("[data-remove]", panel)?.addEventListener("click", () => here() && change());
  flight?.addEventListener("input", () => here() && change({ flight: flight.value }));
  one("[data-length]", panel)?.addEventListener("input", ({ target }) => field("scale").value && put("scale", `${field("scale").value.split("=")[0]}=${target.value.replace(/ /g, "")}`));
  all("[data-end]", panel).forEach((button, index) => button.addEventListener("click", () => {
    const ends = (field("frames").value || `0:${slide.max}`).split(":").with(index, slide.value);
    if (+ends[0] >= +ends[1]) ends[1 - index] = index ? 0 : slide.max;
    put("frames", ends.join(":"));
  }));
  form.addEventListener("input", ({ target }) => {
    if (target.type === "radio") corner = null;
    if (size) draw();
  });
  form.addEventListener("submit", () => { sessionStorage[chosen.value] = slide.value; }); // kept if a field is refused
  if (track) form.addEventListener("submit", event => {
    event.preventDefault();
    const lines = [COLUMNS, ...rows.map(row => COLUMNS.map(name => row[name] ?? ""))];
    const stored = send(new Blob([lines.join("\n")]), `${chosen.value.split(/[\\/]/).at(-1)}-corrected.csv`, {});
    stored.then(({ path }) => { field("corrected").value = path; form.submit(); }, fault => { words.textContent = fault.message; });
  });
  const load = async () => {
    [panel.inert, panel.hidden, words.textContent] = [true, false, "reading the clip"];
    const answer = await fetch(`/clip?path=${encodeURIComponent(chosen.value)}`);
    const [head, ...lines] = track ? (await (await fetch(track)).text()).trim().split(/\r?\n/).map(line => line.split(",")) : [];
    rows = lines.map(cells => Object.fromEntries(head.map((name, n) => [name, cells[n]]))).filter(row => row.x_px);
    if (panel.hidden = !answer.ok || (track && !rows.length)) return;
    size = await answer.json();
    [cross, slide.max] = [[size.width / 2, size.height / 2].map(Math.round), size.count - 1];
    Object.assign(stage.style, { aspectRatio: size.width / size.height, maxWidth: `${75 * size.width / size.height}vh` });
    slide.value = track ? rows[0].frame : sessionStorage[chosen.value] ?? 0;
    [panel.inert, words.textContent, picture.dataset.frame] = [false, "", ""];
    step();
  };
  chosen.addEventListener("change", load);
  if (chosen.value) load();
}
