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
  const fit = () => { frame.style.height = `${frame.contentDocument.documentElement.scrollHeight + 24}px`; };
  frame.addEventListener("load", fit);
  addEventListener("resize", fit);
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
// a clip: points set in its frames become fields of the form
const panel = one(".clip");
if (panel) {
  const [stage, slide, chosen] = [one(".stage", panel), one("[type=range]", panel), one("[name=clip]")];
  const field = name => one(`[name="${name}"]`);
  const [picture, drawing, words] = [one("img", stage), one("svg", stage), one("[role=status]", panel)];
  let size = null, cross = [0, 0], points = [], before = "";
  const draw = () => {
    const shape = (name, values) => {
      const each = drawing.appendChild(document.createElementNS("http://www.w3.org/2000/svg", name));
      Object.entries(values).forEach(pair => each.setAttribute(...pair));
    };
    const r = size.width / 60;
    drawing.replaceChildren();
    drawing.setAttribute("viewBox", `0 0 ${size.width} ${size.height}`);
    shape("path", { d: `M${cross[0] - r} ${cross[1]}h${2 * r}M${cross[0]} ${cross[1] - r}v${2 * r}` });
    points.forEach(([x, y]) => shape("circle", { cx: x, cy: y, r: r / 2 }));
    const [ball, part] = [/^([\d.]+),([\d.]+)@(\d+)$/.exec(field("ball_at").value), field("region").value.split(",")];
    if (ball && ball[3] === slide.value) shape("circle", { cx: ball[1], cy: ball[2], r });
    if (part.length === 4) shape("rect", { x: part[0], y: part[1], width: part[2], height: part[3] });
  };
  const step = () => {
    one("output", panel).textContent = `${slide.value} of ${size.count - 1}`;
    picture.src = `/clip?path=${encodeURIComponent(chosen.value)}&state=${size.state}&frame=${slide.value}`;
    picture.alt = `Frame ${slide.value} of the clip`;
    draw();
  };
  const put = (name, text) => {
    field(name).value = text;
    words.textContent = `${one(`label[for="f-${name}"]`).textContent}: ${text}`;
    draw();
  };
  const set = () => {
    const kind = one("[type=radio]:checked", panel).value;
    [points, before] = [kind === before ? [...points, cross] : [cross], kind];
    const [[x, y], [u, v] = []] = points;
    if (kind === "ball_at") put(kind, `${x},${y}@${slide.value}`);
    else if (points.length < 2) words.textContent = "Set the second point.";
    else if (kind === "scale") put(kind, `${x},${y}:${u},${v}=${one("[data-length]", panel).value.replace(/ /g, "")}`);
    else put(kind, [Math.min(x, u), Math.min(y, v), Math.abs(u - x), Math.abs(v - y)].join());
    if (kind === "ball_at" || points.length > 1) points = [];
    draw();
  };
  stage.addEventListener("click", event => {
    const box = stage.getBoundingClientRect();
    cross = [Math.round((event.clientX - box.left) / box.width * size.width), Math.round((event.clientY - box.top) / box.height * size.height)];
    set();
  });
  stage.addEventListener("keydown", event => {
    const move = { ArrowLeft: [-8, 0], ArrowRight: [8, 0], ArrowUp: [0, -8], ArrowDown: [0, 8], Enter: [0, 0] }[event.key];
    if (!move) return;
    event.preventDefault();
    cross = cross.map((each, n) => each + move[n] / (event.shiftKey ? 8 : 1));
    event.key === "Enter" ? set() : draw();
  });
  slide.addEventListener("change", step);
  one("[data-length]", panel).addEventListener("input", ({ target }) => field("scale").value && put("scale", `${field("scale").value.split("=")[0]}=${target.value.replace(/ /g, "")}`));
  all("[data-end]", panel).forEach((button, index) => button.addEventListener("click", () => {
    const ends = (field("frames").value || `0:${size.count - 1}`).split(":");
    put("frames", ends.with(index, slide.value).join(":"));
  }));
  const load = async () => {
    const answer = await fetch(`/clip?path=${encodeURIComponent(chosen.value)}`);
    if (panel.hidden = !answer.ok) return;
    size = await answer.json();
    [cross, slide.max] = [[size.width / 2, size.height / 2].map(Math.round), size.count - 1];
    step();
  };
  chosen.addEventListener("change", load);
  if (chosen.value) load();
}
