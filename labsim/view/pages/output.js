"use strict";
// An output folder: the report, pictures, and numbers as tables.
const at = (id) => document.getElementById(id);
const MOST_ROWS = 1000;
let files = [], shown = 0;

function element(name, properties = {}, ...children) {
  const made = Object.assign(document.createElement(name), properties);
  made.append(...children);
  return made;
}
const address = (name) => "files/" + name.split("/").map(encodeURIComponent).join("/");
const say = (value) => typeof value === "number" ? String(Number(value.toPrecision(6))) : value === null ? "–" : String(value);

// one line a number, named as in the file: posterior.mean
function* flatten(value, name = "") {
  if (Array.isArray(value) && value.every((each) => each === null || typeof each !== "object")) yield [name, value.map(say).join(", ")];
  else if (value !== null && typeof value === "object") for (const [key, each] of Object.entries(value)) yield* flatten(each, name ? `${name}.${key}` : key);
  else yield [name, say(value)];
}
function table(rows, heading, name = "") {
  const made = element("table", { className: name });
  if (heading) made.append(element("thead", {}, element("tr", {}, ...heading.map((text) => element("th", { textContent: text })))));
  made.append(element("tbody", {}, ...rows.slice(0, MOST_ROWS).map((row) => element("tr", {}, ...row.map((text) => element("td", { textContent: text }))))));
  const left = rows.length - MOST_ROWS;
  return element("div", { className: "wide" }, made, ...(left > 0 ? [element("p", { textContent: `… and ${left} more rows` })] : []));
}

async function make(name) {
  const kind = name.split(".").pop().toLowerCase(), url = address(name);
  if (kind === "html") return element("iframe", { src: url, title: name, sandbox: "allow-scripts" });
  if (kind === "png" || kind === "svg") return element("img", { src: url, alt: name });
  if (kind === "mp4") return element("video", { src: url, controls: true });
  const answer = await fetch(url);
  if (!answer.ok) throw new Error(`${name} cannot be read any more`);
  const text = await answer.text();
  if (kind === "json") return table([...flatten(JSON.parse(text))], ["key", "value"], "facts");
  if (kind === "csv") { const [heading, ...rows] = text.trim().split("\n").map((each) => each.split(",")); return table(rows, heading); }
  return element("pre", { textContent: text });
}

async function go(number) {
  shown = Math.min(Math.max(number, 0), files.length - 1);
  const name = files[shown];
  [...at("list").querySelectorAll("button")].forEach((each, i) => { each.setAttribute("aria-current", i === shown); if (i === shown) each.scrollIntoView({ block: "nearest" }); });
  at("title").textContent = name;
  at("trouble").textContent = "";
  try { const made = await make(name); if (files[shown] === name) at("shown").replaceChildren(made); }
  catch (trouble) { at("shown").replaceChildren(); at("trouble").textContent = trouble.message; }
  document.documentElement.dataset.shown = name;
}
addEventListener("keydown", (event) => {
  const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
  if (by && files.length && !event.ctrlKey && !event.altKey && !event.metaKey) { event.preventDefault(); go(shown + by); }
});
(async () => {
  try {
    const state = await (await fetch("state")).json();
    document.title = `${state.name} – labsim view`;
    at("name").textContent = state.name;
    files = state.files;
    at("list").append(...files.map((name, i) => element("li", {}, element("button", { textContent: name, onclick: () => go(i) }))));
    if (state.left_off) at("list").append(element("li", { textContent: `… and ${state.left_off} more files` }));
    if (files.length) go(0); else at("trouble").textContent = "holds no report, picture or table";
  } catch { at("trouble").textContent = "labsim view has ended; start it again"; }
})();
