// The table of all points: sorting, filters, choice of columns, download.

const table = byId("table");
const body = table.tBodies[0];
const headings = Array.from(table.tHead.rows[0].cells);

/** The value of a cell for sorting: a number, a text, or null if it is missing. */
function cellValue(row, position) {
  const cell = row.cells[position];
  if (cell.dataset.raw === "") return null;
  return "number" in cell.dataset ? Number(cell.dataset.raw) : cell.dataset.raw;
}

/** Order of two values: numbers, then texts, then what is missing, whichever the direction. */
function compareValues(left, right, direction) {
  if (left === null || right === null) return (left === null) - (right === null);
  if (typeof left !== typeof right) return typeof left === "number" ? -1 : 1;
  const order = typeof left === "number" ? left - right : left.localeCompare(right, "en", { numeric: true });
  return direction * order;
}

function sortBy(position) {
  const heading = headings[position];
  const isAscending = heading.getAttribute("aria-sort") !== "ascending";
  for (const other of headings) other.setAttribute("aria-sort", "none");
  heading.setAttribute("aria-sort", isAscending ? "ascending" : "descending");
  const rows = Array.from(body.rows);
  const direction = isAscending ? 1 : -1;
  rows.sort((a, b) => compareValues(cellValue(a, position), cellValue(b, position), direction));
  body.append(...rows);
}

function filterRows() {
  const words = byId("filter").value.toLowerCase().split(/\s+/).filter(Boolean);
  const column = byId("limit-column").value;
  const limit = byId("limit-value").value;
  const isLeast = byId("limit-sign").value === "least";
  const frontOnly = byId("front-only")?.checked;
  let count = 0;
  for (const row of body.rows) {
    const text = row.querySelectorAll(".name").length
      ? Array.from(row.querySelectorAll(".name"), (cell) => cell.textContent)
          .join(" ")
          .toLowerCase()
      : "";
    let isShown = words.every((word) => text.includes(word)) && (!frontOnly || row.classList.contains("front"));
    if (isShown && column !== "" && limit !== "") {
      const value = cellValue(row, Number(column));
      isShown = typeof value === "number" && (isLeast ? value >= Number(limit) : value <= Number(limit));
    }
    row.hidden = !isShown;
    count += isShown;
  }
  byId("row-count").value = `${count} of ${body.rows.length} points`;
}

/** A field of CSV. A text that a spreadsheet would run as a formula gets an apostrophe. */
function csvField(text, isNumber) {
  const safe = !isNumber && /^[=+\-@\t\r]/.test(text) ? `'${text}` : text;
  return /[",\r\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
}

/** The rows and columns that are shown, in the order shown, with all digits. */
function tableAsCsv() {
  const shown = headings.map((_, position) => position).filter((position) => !headings[position].hidden);
  const lines = [shown.map((position) => csvField(headings[position].querySelector("button").dataset.label, false))];
  for (const row of body.rows) {
    if (row.hidden) continue;
    const cells = shown.map((position) => row.cells[position]);
    lines.push(cells.map((cell) => csvField(cell.dataset.raw, "number" in cell.dataset)));
  }
  return lines.map((line) => line.join(",") + "\r\n").join("");
}

function downloadCsv() {
  const address = URL.createObjectURL(new Blob([tableAsCsv()], { type: "text/csv" }));
  const link = element("a", { href: address, download: "points.csv" });
  link.click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}

headings.forEach((heading, position) => {
  heading.querySelector("button").addEventListener("click", () => sortBy(position));
  if (position === 0) return;
  const box = element("input", { type: "checkbox", checked: "" });
  box.addEventListener("change", () => {
    for (const row of table.rows) row.cells[position].hidden = !box.checked;
  });
  byId("column-choice").append(element("label", null, box, ` ${heading.querySelector("button").dataset.label}`));
});
for (const id of ["filter", "limit-value"]) byId(id).addEventListener("input", filterRows);
for (const id of ["limit-column", "limit-sign", "front-only"]) byId(id)?.addEventListener("change", filterRows);
byId("csv").addEventListener("click", downloadCsv);
body.addEventListener("click", (event) => {
  const button = event.target.closest(".pick");
  if (button) selectPoint(button.closest("tr").dataset.point);
});
selectionListeners.push((name) => {
  for (const row of body.rows) row.classList.toggle("selected", row.dataset.point === name);
});
