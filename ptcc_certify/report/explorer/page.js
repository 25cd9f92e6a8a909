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
  if (drawn[name] === svg) return;
  drawn[name] = svg;
  const image = document.querySelector(`#panel-${name} img`);
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
  const names = [...document.querySelectorAll("figure")].map((figure) => figure.id.slice("panel-".length));
  await Promise.all(names.map((name) => showPanel(name, view.panels[name])));
  verdict.className = view.grade;
  setText(verdict.lastElementChild, unbroken(view.verdict));
  for (const place of document.querySelectorAll("dd")) setText(place, unbroken(view.facts[place.dataset.head]));
  setText(document.getElementById("python"), view.python);
  showWords(document.getElementById("command"), view.command);
}

function tellGone() {
  show({ refusal: "ptcc explore has ended or does not answer; start it again in the terminal" });
}

async function ask(what, signal) {
  const answer = await fetch(`${what}?${settings()}`, { signal });
  if (answer.status === 409) return null;
  if (!answer.ok) throw new Error(await answer.text());
  return answer.json();
}

async function preview() {
  if (asking) return;
  asking = true;
  let seen;
  try {
    do {
      seen = wanted;
      const view = await ask("preview");
      await show(view);
      if (!("refusal" in view)) timer = setTimeout(certify, REST);
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
    const view = await ask("view", certifying.signal);
    if (seen !== wanted) return;
    if (view === null) timer = setTimeout(certify, REST);
    else await show(view);
  } catch (error) {
    if (error.name !== "AbortError") tellGone();
  }
}

function move() {
  wanted += 1;
  clearTimeout(timer);
  if (certifying) certifying.abort();
  verdict.className = "open"; // nothing is called certified but what is shown
  setText(verdict.lastElementChild, "computing");
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
