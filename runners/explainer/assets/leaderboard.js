// Sorts tables by a header, and hides what the filters do not let through.

const form = document.getElementById("filters");
const selects = [...form.querySelectorAll("select[data-filter]")];
const search = form.querySelector("[data-search]");
const older = document.getElementById("older");

/** The value that a cell is sorted by: numbers, or its first text in lower case; null for a missing one. */
function sortValue(row, column) {
  const cell = row.cells[column];
  const { value } = cell.dataset;
  if (value === undefined) return (cell.firstChild?.textContent ?? "").toLowerCase();
  return value === "" ? null : value.split(" ").map(Number);
}

function compare(one, other) {
  if (typeof one === "string") return one.localeCompare(other, undefined, { numeric: true });
  const at = one.findIndex((number, index) => number !== other[index]);
  return at < 0 ? 0 : one[at] - (other[at] ?? -Infinity);
}

/** Sort the rows of a table; a missing value comes last in both directions. */
function sort(header) {
  const descending = header.ariaSort ? header.ariaSort === "ascending" : header.dataset.first === "descending";
  for (const other of header.parentElement.cells) other.ariaSort = null;
  header.ariaSort = descending ? "descending" : "ascending";
  const body = header.closest("table").tBodies[0];
  const rows = [...body.rows].map((row) => [row, sortValue(row, header.cellIndex)]);
  rows.sort(([, one], [, other]) => {
    if (one === null || other === null) return (one === null) - (other === null);
    return descending ? compare(other, one) : compare(one, other);
  });
  body.append(...rows.map(([row]) => row));
}

/** Whether an element's map, robot and simulator are those chosen. */
function isChosen({ dataset }) {
  return selects.every(({ value, dataset: { filter } }) => value === "" || dataset[filter] === value);
}

function applyFilters() {
  const words = search.value.trim().toLowerCase();
  for (const part of document.querySelectorAll("[data-map]")) part.hidden = !isChosen(part);
  for (const row of document.querySelectorAll("tr[data-system]")) {
    const cells = [...row.querySelectorAll("td[data-map]")];
    const empty = cells.length > 0 && cells.every((cell) => cell.hidden || !cell.querySelector("a"));
    const unchosen = row.dataset.map !== undefined && !isChosen(row);
    const repeated = row.classList.contains("older") && !older.checked;
    row.hidden = empty || unchosen || repeated || !row.dataset.system.toLowerCase().includes(words);
  }
  const shown = document.querySelectorAll("tr[id]:not([hidden])").length;
  document.getElementById("found").textContent = `${shown} shown`;
}

/** A link to a run that the filters hide shows it first. */
function revealTarget() {
  const row = document.getElementById(location.hash.slice(1));
  if (row?.hidden) {
    form.reset();
    older.checked ||= row.classList.contains("older");
    applyFilters();
    row.scrollIntoView();
  }
}

for (const header of document.querySelectorAll("thead th")) {
  const numeric = header.closest("table").tBodies[0].rows[0]?.cells[header.cellIndex].dataset.value;
  header.dataset.first = numeric === undefined ? "ascending" : "descending";
  header.querySelector("button").addEventListener("click", () => sort(header));
}
form.addEventListener("input", applyFilters);
form.addEventListener("submit", (event) => event.preventDefault());
document.getElementById("theme").addEventListener("click", switchTheme);
window.addEventListener("hashchange", revealTarget);
recallTheme();
sort(document.querySelector("thead th:nth-child(2)")); // the setting that most systems were driven in
applyFilters();
revealTarget();
document.body.classList.add("ready");
