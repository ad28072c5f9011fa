"use strict";
// Adds to the pages: a cursor on the traces, slow motion, protection against double clicks, automatic
// refresh of the class table, and keys. After an action only the changed parts of the page are replaced.
// Without this file the pages have the same content and the same actions, but nothing moves.

function nearestIndex(values, wanted) {
  let best = 0;
  values.forEach((value, at) => { if (Math.abs(value - wanted) < Math.abs(values[best] - wanted)) best = at; });
  return best;
}

function addControls(figure, show) {
  const controls = figure.querySelector(".controls");
  const range = controls.querySelector("input");
  const output = controls.querySelector("output");
  const update = () => {
    const words = show(Number(range.value));
    output.textContent = words;
    range.setAttribute("aria-valuetext", words);
  };
  range.addEventListener("input", update);
  controls.hidden = false;
  return { range, update };
}

function addCursor(figure) {
  const trace = JSON.parse(figure.dataset.trace);
  const svg = figure.querySelector("svg"), cursor = svg.querySelector(".cursor");
  const { range, update } = addControls(figure, (time) => {
    const x = trace.left + (trace.right - trace.left) * (time - trace.first) / (trace.last - trace.first);
    cursor.setAttribute("x1", x);
    cursor.setAttribute("x2", x);
    const gates = trace.gates.map((edges, at) =>
      `gate ${at + 1} ${edges.some(([broke, cleared]) => broke <= time && time < cleared) ? "broken" : "free"}`);
    const counts = trace.times.length ? [`${trace.counts[nearestIndex(trace.times, time)]} counts`] : [];
    return [`${time.toFixed(1)} ms`, ...gates, ...counts].join(", ");
  });
  update();
  svg.addEventListener("pointermove", (event) => {
    const at = new DOMPoint(event.clientX, event.clientY).matrixTransform(svg.getScreenCTM().inverse());
    range.value = trace.first + (at.x - trace.left) / (trace.right - trace.left) * (trace.last - trace.first);
    update();
  });
}

function addMotion(figure) {
  const frames = JSON.parse(figure.dataset.motion);
  const bat = figure.querySelector(".bat"), ball = figure.querySelector(".ball");
  const axis = figure.querySelector(".axis").getAttribute("cy");
  const { range, update } = addControls(figure, (at) => {
    const [time, x, z, angle] = frames[at];
    ball.setAttribute("cx", x ?? -2000);
    ball.setAttribute("cy", z);
    bat.setAttribute("transform", `rotate(${angle} 0 ${axis})`);
    return `${time.toFixed(0)} ms ${time < 0 ? "before" : "after"} the contact`.replace("-", "");
  });
  range.max = frames.length - 1;
  range.value = nearestIndex(frames.map((frame) => frame[0]), 0);
  update();
  const play = figure.querySelector(".play");
  play.hidden = matchMedia("(prefers-reduced-motion: reduce)").matches;
  let timer = 0;
  play.addEventListener("click", () => {
    clearInterval(timer);
    range.value = 0;
    timer = setInterval(() => {
      range.value = Number(range.value) + 1;
      update();
      if (range.value === range.max) clearInterval(timer);
    }, 45);
  });
}

function addProgress(film) {
  const making = document.createElement("progress");
  making.setAttribute("aria-label", "The frames are being made");
  if (!film.complete) film.after(making);
  for (const end of ["load", "error"]) film.addEventListener(end, () => making.remove());
}

for (const part of document.querySelectorAll("[data-renew]")) {  // refreshes the part periodically
  setInterval(async () => {
    const answer = await fetch(location.href).catch(() => null);
    if (!answer?.ok) return;
    const page = new DOMParser().parseFromString(await answer.text(), "text/html");
    part.innerHTML = page.querySelector("[data-renew]").innerHTML;
  }, 1000 * part.dataset.renew);
}

for (const [key, way] of [["ArrowLeft", "prev"], ["ArrowRight", "next"]]) {  // arrow keys step through a replay
  const link = document.querySelector(`a[rel=${way}]`);
  addEventListener("keydown", (event) => {
    if (link && event.key === key && !event.target.closest("input, .scroll")) link.click();
  });
}
addEventListener("keydown", (event) => {  // key r opens the rules, i the instruments; Escape goes back
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.closest("input, select")) return;
  const link = document.querySelector(event.key === "Escape" ? "a[rel=up]" : `a[data-key="${CSS.escape(event.key)}"]`);
  if (link) link.click();
});
for (const now of document.querySelectorAll(".scroll [aria-current]")) {
  const list = now.closest(".scroll");
  list.scrollTop = now.offsetTop - list.clientHeight / 2;
}

function showProgress(form, shots) {  // shows the progress of several shots; returns the function that removes it
  const bar = document.createElement("progress"), words = document.createElement("span");
  words.setAttribute("role", "status");
  bar.max = shots;
  bar.value = 0;
  form.append(bar, words);
  let first;
  const timer = setInterval(async () => {
    const answer = await fetch("/progress").catch(() => null);
    if (!answer?.ok) return;
    const fired = Number(await answer.text());
    first ??= fired;
    bar.value = fired - first;
    words.textContent = `${bar.value} of ${shots} fired`;
  }, 300);
  return () => {
    clearInterval(timer);
    bar.remove();
    words.remove();
  };
}

function activate(part) {
  part.querySelectorAll("[data-trace]").forEach(addCursor);
  part.querySelectorAll("[data-motion]").forEach(addMotion);
  part.querySelectorAll(".film img").forEach(addProgress);
}

const CONTAINERS = ["header", "main", "nav ol"];  // elements whose children are replaced one by one
const sentText = new WeakMap();  // HTML text of each child, as the server sent it

function textOf(part) {
  return part.outerHTML.replace(/(name="entry_number" value=)"\d+"/g, "$1");  // this number changes with each action
}

function replaceChanged(live, now) {  // replaces the changed children of an element and keeps the others
  const kept = new Map([...live.children].map((each) => [sentText.get(each), each]));
  const wanted = [...now.children].map((each) => {
    const text = textOf(each), part = kept.get(text) ?? each;
    kept.delete(text);
    sentText.set(part, text);
    return part;
  });
  kept.forEach((each) => each.remove());
  wanted.forEach((each, at) => {
    if (live.children[at] === each) return;
    live.insertBefore(each, live.children[at] ?? null);
    activate(each);
  });
}

function showPage(page) {  // shows the page that follows an action
  document.title = page.title;
  for (const container of CONTAINERS) {
    const live = document.querySelector(container);
    if (live) replaceChanged(live, page.querySelector(container));
  }
  const number = page.querySelector("[name=entry_number]")?.value;
  document.querySelectorAll("[name=entry_number]").forEach((each) => { each.defaultValue = number; });
  for (const form of document.forms) form.reset();
  scrollTo(0, 0);
  document.querySelector("[autofocus]")?.focus();
  history.replaceState(null, "", "/");  // last, because tests wait for it
}

let sending = false;
async function sendForm(form, body) {
  sending = true;
  const shots = Number(form.elements.shots?.value ?? 0);
  const over = shots > 1 ? showProgress(form, shots) : () => {};
  const answer = await fetch(form.action, { method: "POST", body }).catch(() => null);
  const page = new DOMParser().parseFromString(await answer?.text() ?? "", "text/html");
  over();
  sending = false;
  if (page.getElementById("display")) showPage(page);
  else location.assign("/");  // the new page reports the problem
}

document.addEventListener("submit", (event) => {
  const form = event.target, ours = document.getElementById("display") && form.action.endsWith("/do");
  if (sending || ours) event.preventDefault();
  if (!sending && ours) sendForm(form, new URLSearchParams(new FormData(form, event.submitter)));
  else sending = true;
});
addEventListener("click", (event) => {  // ignores the second click of a double click
  if (event.detail > 1 && event.target.closest("form button")) event.preventDefault();
});
addEventListener("keydown", (event) => {  // ignores the repeats of a held Enter key
  if (event.repeat && event.key === "Enter" && event.target.closest("form")) event.preventDefault();
});
addEventListener("pageshow", (event) => { if (event.persisted) sending = false; });

function openLinked() {  // opens a closed section if a link leads into it
  const part = document.getElementById(location.hash.slice(1));
  if (part?.localName === "details") part.open = true;
}
addEventListener("hashchange", openLinked);
openLinked();
for (const container of CONTAINERS) {
  for (const part of document.querySelector(container)?.children ?? []) sentText.set(part, textOf(part));
}
activate(document);
