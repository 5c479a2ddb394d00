// Sorts the systems of a setting by the column whose header is clicked.

/** Sort the lines of a table; a missing value comes last in both directions. Numbers have six decimals each. */
function sort(table, header) {
  const turned = header.ariaSort === "descending" ? "ascending" : "descending";
  const direction = header.ariaSort ? turned : header.dataset.first;
  for (const other of table.tHead.rows[0].cells) other.ariaSort = other === header ? direction : null;
  const lines = [...table.tBodies[0].rows].map((row) => [row, row.cells[header.cellIndex].dataset.value]);
  lines.sort(([, one], [, other]) => {
    if (one === "" || other === "") return (one === "") - (other === "");
    const order = one.localeCompare(other, undefined, { numeric: true });
    return direction === "descending" ? -order : order;
  });
  table.tBodies[0].append(...lines.map(([row]) => row));
}

for (const header of document.querySelectorAll("thead th")) {
  header.querySelector("button").addEventListener("click", () => sort(header.closest("table"), header));
}
document.body.classList.add("ready");
