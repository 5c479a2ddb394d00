// Sorts the runs of each setting, hides what the filters do not let through, and opens the details of a run.

const form = document.getElementById("filters");
const selects = [...form.querySelectorAll("select[data-filter]")];
const search = form.querySelector("[type=search]");
const order = document.getElementById("order");
const older = document.getElementById("older"); // only where there are repeats
const board = document.getElementById("board");
const headers = [...board.tHead.rows[0].cells];
const settings = [...board.tBodies];
const runs = [...board.querySelectorAll("tr.run")];
const { parts, runs: configs } = JSON.parse(document.getElementById("data").textContent);

const moreOf = (run) => run.nextElementSibling;
const buttonOf = (run) => run.querySelector("th button");

/** What a run is sorted by: numbers, or a text; null where it is missing. */
function sortValue(run, key) {
  const value = run.dataset[key];
  if (key === "system" || key === "started") return value;
  return value === "" ? null : value.split(" ").map(Number);
}

function compare(one, other) {
  if (typeof one === "string") return one.localeCompare(other, undefined, { numeric: true });
  const at = one.findIndex((number, index) => number !== other[index]);
  return at < 0 ? 0 : one[at] - (other[at] ?? -Infinity);
}

/** Sort the runs within each setting; a missing value comes last in both directions. */
function sort(key, direction) {
  for (const header of headers) header.ariaSort = header.dataset.key === key ? direction : null;
  order.value = key;
  for (const setting of settings) {
    const rows = [...setting.querySelectorAll("tr.run")].map((run) => [run, moreOf(run), sortValue(run, key)]);
    rows.sort(([, , one], [, , other]) => {
      if (one === null || other === null) return (one === null) - (other === null);
      return direction === "descending" ? compare(other, one) : compare(one, other);
    });
    setting.append(...rows.flatMap(([run, more]) => [run, more]));
  }
  arrange(key);
}

/** The newest first puts the setting of the newest run on top; any other order keeps the settings in theirs. */
function arrange(key) {
  const newest = (setting) => [...setting.querySelectorAll("tr.run")].map((run) => run.dataset.started).sort().at(-1);
  const arranged = [...settings];
  if (key === "started") arranged.sort((one, other) => compare(newest(other), newest(one)));
  board.append(...arranged);
}

function firstDirection(key) {
  return [...order.options].find(({ value }) => value === key).dataset.first;
}

function sortByHeader(header) {
  const { key } = header.dataset;
  const turned = header.ariaSort === "descending" ? "ascending" : "descending";
  sort(key, header.ariaSort ? turned : firstDirection(key));
}

/** Whether a setting's map, robot and simulator are those chosen. */
function isChosen({ dataset }) {
  return selects.every(({ value, dataset: { filter } }) => value === "" || dataset[filter] === value);
}

function applyFilters() {
  const words = search.value.toLowerCase().split(/\s+/).filter(Boolean);
  for (const run of runs) {
    const repeated = run.classList.contains("older") && !older.checked;
    run.hidden = repeated || !words.every((word) => run.dataset.words.includes(word));
    moreOf(run).hidden = run.hidden || buttonOf(run).ariaExpanded !== "true";
  }
  for (const setting of settings) setting.hidden = !isChosen(setting) || !setting.querySelector("tr.run:not([hidden])");
  const shown = board.querySelectorAll("tbody:not([hidden]) tr.run:not([hidden])").length;
  document.getElementById("found").textContent = `${shown} of ${runs.length} shown`;
  document.getElementById("none").hidden = shown > 0;
  board.hidden = shown === 0;
}

/** Open or close the details of a run. */
function toggle(run, open = moreOf(run).hidden) {
  buttonOf(run).ariaExpanded = String(open);
  moreOf(run).hidden = !open;
}

/** A click on a line does what its button does, unless it is on a button or ends the selection of text. */
function clicked(run, event) {
  const button = event.target.closest("button");
  if (button === buttonOf(run) || (!button && getSelection().isCollapsed)) toggle(run);
}

/** List every key of a run's config; those that are changed stand out. */
function fill(details, number) {
  if (details.querySelector("dl")) return;
  const told = [...details.parentElement.querySelectorAll("li")].map((item) => item.textContent.split("=")[0]);
  const list = document.createElement("dl");
  for (const [key, value] of configs[number].flatMap((part) => Object.entries(parts[part]))) {
    const pair = document.createElement("div");
    pair.className = told.includes(key) ? "changed" : "";
    pair.append(breakable("dt", key), breakable("dd", typeof value === "string" ? value : JSON.stringify(value)));
    list.append(pair);
  }
  details.append(list);
}

/** An element with a text that may break between the words of a key, and not within them. */
function breakable(tag, text) {
  const element = document.createElement(tag);
  element.append(...text.split(/(?<=[.,])/).flatMap((word) => [word, document.createElement("wbr")]));
  return element;
}

/** A link to a run opens it, whatever the filters hide. */
function revealTarget() {
  const run = document.getElementById(location.hash.slice(1));
  if (!runs.includes(run)) return;
  if (run.hidden || run.parentElement.hidden) clear();
  if (older) older.checked ||= run.classList.contains("older");
  applyFilters();
  toggle(run, true);
  run.scrollIntoView({ block: "center" });
}

function clear() {
  const key = order.value;
  form.reset();
  order.value = key;
  applyFilters();
}

/** As cards on a phone, the lines stay lines of a table to a screen reader. */
function keepRoles() {
  const roles = { table: "table", "thead, tbody": "rowgroup", tr: "row", td: "cell", "th[scope=row]": "rowheader" };
  for (const [selector, role] of Object.entries(roles)) {
    for (const element of document.querySelectorAll(selector)) element.role = role;
  }
}

for (const header of headers) header.querySelector("button").addEventListener("click", () => sortByHeader(header));
for (const [number, run] of [...runs].sort((one, other) => one.id.slice(4) - other.id.slice(4)).entries()) {
  run.addEventListener("click", (event) => clicked(run, event));
  const details = moreOf(run).querySelector("details");
  details?.addEventListener("toggle", () => fill(details, number));
}
order.addEventListener("change", () => sort(order.value, firstDirection(order.value)));
form.addEventListener("input", applyFilters);
form.addEventListener("submit", (event) => event.preventDefault());
document.getElementById("clear").addEventListener("click", clear);
document.getElementById("theme").addEventListener("click", switchTheme);
window.addEventListener("hashchange", revealTarget);
recallTheme();
keepRoles();
sort("success", "descending");
applyFilters();
revealTarget();
document.body.classList.add("ready");
