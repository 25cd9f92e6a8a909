"use strict";
// One request at a time: whatever is moved meanwhile, the next asks for the settings as they then are.
const REST = 250; // milliseconds of rest after which settings are certified
const controls = document.getElementById("controls");
const verdict = document.getElementById("verdict");
const number = (range) => document.getElementById(range.dataset.of);
const ranges = [...controls.querySelectorAll("input[type=range]")];
let wanted = 0; // counts the moves
let asking = false;
let certifying = null; // the request that certifies, to be given up at the next move
let timer = 0;

const kind = () => document.getElementById("kind").value;

function settings() {
  const query = new URLSearchParams();
  for (const control of controls.querySelectorAll("[name]")) {
    if (control.closest("[hidden]")) continue;
    query.set(control.name, control.type === "checkbox" ? control.checked : control.value);
  }
  return query;
}

function showControls() {
  for (const place of controls.querySelectorAll("[data-kind]")) place.hidden = place.dataset.kind !== kind();
}

function setText(element, text) {
  if (element.textContent !== text) element.textContent = text;
}

// With a true minus sign no line ends within a number such as 1e-10.
function unbroken(text) {
  return text.replace(/(?<=\de)-(?=\d)/g, "\u2212");
}

function showWords(place, text) {
  const words = text.split(" ").map((word) => Object.assign(document.createElement("span"), { textContent: word }));
  place.replaceChildren(...words.flatMap((word) => [word, " "]).slice(0, -1));
}

const drawn = {}; // the panels as they are shown

async function showPanel(name, svg) {
  const panel = document.getElementById(`panel-${name}`);
  panel.classList.remove("old");
  if (drawn[name] === svg) return;
  drawn[name] = svg;
  const image = panel.querySelector("img");
  const old = image.src;
  if (svg === undefined) {
    image.removeAttribute("src");
  } else {
    image.src = URL.createObjectURL(new Blob([svg], { type: "image/svg+xml" }));
    await image.decode().catch(() => {});
  }
  if (old) URL.revokeObjectURL(old);
}

async function show(view) {
  document.body.classList.toggle("refused", "refusal" in view);
  setText(verdict.firstElementChild, "refusal" in view ? "Refused" : "Verdict");
  if ("refusal" in view) {
    verdict.className = "bad";
    return setText(verdict.lastElementChild, view.refusal);
  }
  if ("facts" in view) {
    for (const place of document.querySelectorAll("dd")) setText(place, unbroken(view.facts[place.dataset.head]));
    setText(document.getElementById("python"), view.python);
    showWords(document.getElementById("command"), view.command);
    for (const { id } of document.querySelectorAll("figure")) {
      const name = id.slice("panel-".length);
      if (!view.names.includes(name)) await showPanel(name);
    }
  }
  for (const [name, svg] of Object.entries(view.panels ?? {})) await showPanel(name, svg);
  if ("verdict" in view) {
    verdict.className = view.grade;
    setText(verdict.lastElementChild, unbroken(view.verdict));
  }
}

function tellGone() {
  show({ refusal: "ptcc explore has ended or does not answer; start it again in the terminal" });
}

// One line of JSON for every part of the answer, shown as it comes; false where a control was moved meanwhile, on this
// page or on another of this server, so that no verdict came.
async function ask(what, wished, signal) {
  const answer = await fetch(`${what}?${settings()}`, { signal });
  if (answer.status === 409) return false;
  if (!answer.ok) throw new Error(await answer.text());
  const reader = answer.body.pipeThrough(new TextDecoderStream()).getReader();
  let text = "";
  let ended = false;
  for (;;) {
    const { value, done } = await reader.read();
    if (done) return ended;
    const lines = (text + value).split("\n");
    text = lines.pop();
    for (const view of lines.map((line) => JSON.parse(line))) {
      ended = "verdict" in view || "refusal" in view;
      if (wished()) await show(view);
    }
  }
}

async function preview() {
  if (asking) return;
  asking = true;
  let seen;
  try {
    do {
      seen = wanted;
      await ask("preview", () => true);
      clearTimeout(timer);
      if (!document.body.classList.contains("refused")) timer = setTimeout(certify, REST);
    } while (seen !== wanted);
  } catch (error) {
    tellGone();
  }
  asking = false;
}

async function certify() {
  const seen = wanted;
  certifying = new AbortController();
  try {
    const shown = await ask("view", () => seen === wanted, certifying.signal);
    if (!shown && seen === wanted) timer = setTimeout(certify, REST);
  } catch (error) {
    if (error.name !== "AbortError") tellGone();
  }
}

function move() {
  wanted += 1;
  clearTimeout(timer);
  if (certifying) certifying.abort();
  verdict.className = "open"; // nothing is called certified but what is shown
  setText(verdict.firstElementChild, "Verdict");
  setText(verdict.lastElementChild, "computing");
  for (const panel of document.querySelectorAll("figure")) panel.classList.add("old");
  history.replaceState(null, "", `?${settings()}`);
  preview();
}

controls.addEventListener("input", (event) => {
  const moved = event.target;
  if (moved.type === "range") number(moved).value = moved.value;
  else for (const range of ranges) if (number(range) === moved) range.value = moved.value;
  showControls();
  move();
});
controls.addEventListener("submit", (event) => event.preventDefault());
for (const button of document.querySelectorAll("[data-copies]")) {
  button.addEventListener("click", async () => {
    const text = document.getElementById(button.dataset.copies);
    const told = document.getElementById("copied");
    try {
      await navigator.clipboard.writeText(text.textContent);
      told.textContent = "copied";
    } catch (error) {
      getSelection().selectAllChildren(text);
      told.textContent = "selected; press Ctrl-C";
    }
    setTimeout(() => { told.textContent = ""; }, 2000);
  });
}

// The address keeps the settings: a page that is loaded again shows what it showed.
for (const [name, value] of new URLSearchParams(location.search)) {
  const control = controls.querySelector(`[name="${CSS.escape(name)}"]`);
  if (control && control.type === "checkbox") control.checked = value === "true";
  else if (control) control.value = value;
}
for (const range of ranges) range.value = number(range).value;
showControls();
move();
