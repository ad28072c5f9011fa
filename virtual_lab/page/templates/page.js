"use strict";
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
if (running) setTimeout(follow, 500);
else setInterval(() => fetch("/alive").catch(() => 0), 60000);

// the first refused field has the focus
const wrong = one("[aria-invalid]:not([role]), .wrong input");
if (wrong) wrong.focus();

// times in the user's own zone
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

// uploads with progress
function send(file, name, bar) {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open("POST", `/upload?name=${encodeURIComponent(name)}`);
    request.responseType = "json";
    request.upload.onprogress = event => { bar.value = event.loaded / event.total; };
    request.onload = () => request.status === 200 ? resolve(request.response)
      : reject(new Error(request.response?.fault || "The file is too large."));
    request.onerror = () => reject(new Error("The file could not be sent."));
    request.send(file);
  });
}
async function upload(input, place) {
  const [bar, words] = [one("progress", place), one("output", place)];
  bar.hidden = false;
  try {
    let answer;
    for (const file of input.files) {
      words.textContent = `sending ${file.name}`;
      answer = await send(file, file.webkitRelativePath || file.name, bar);
    }
    const first = input.files[0].webkitRelativePath;
    const path = first ? answer.path.slice(0, answer.path.lastIndexOf(first.split("/")[0]) + first.split("/")[0].length) : answer.path;
    offer(document.getElementById(place.dataset.for), path, first ? first.split("/")[0] : answer.title);
    words.textContent = "stored and chosen";
  } catch (fault) {
    words.textContent = fault.message;
  }
  bar.hidden = true;
}
function offer(control, path, title) {
  if (control.tagName === "SELECT") {
    control.add(new Option(title, path, true, true));
  } else {
    const name = control.closest(".row").dataset.name;
    const label = document.createElement("label");
    label.append(Object.assign(document.createElement("input"), { type: "checkbox", name, value: path, checked: true }), ` ${title}`);
    control.append(label);
  }
  control.dispatchEvent(new Event("change", { bubbles: true }));
}
all(".upload").forEach(place => {
  place.hidden = false;
  all("input", place).forEach(input => input.addEventListener("change", () => input.files.length && upload(input, place)));
});
