// Tables that are sorted by their heads, searched, and walked through by the arrow keys.

function compare(a, b) {
  const blank = (value) => value === null || value === "" || Number.isNaN(value);
  if (blank(a) || blank(b)) return blank(a) - blank(b);
  return typeof a === "number" && typeof b === "number" ? a - b : String(a).localeCompare(String(b), "en", { numeric: true });
}

function sortHead(head, act) { // lays a button over a head cell, whose words stay words (on paper they are repeated); act gets +1 or -1
  const button = document.createElement("button");
  button.type = "button";
  button.setAttribute("aria-label", `Sort by ${head.textContent}`);
  head.append(button);
  head.scope = "col";
  button.addEventListener("click", () => {
    const down = head.getAttribute("aria-sort") === "ascending";
    for (const other of head.parentElement.children) other.removeAttribute("aria-sort");
    head.setAttribute("aria-sort", down ? "descending" : "ascending");
    act(down ? -1 : 1);
  });
}

const RAISED = "⁰¹²³⁴⁵⁶⁷⁸⁹";

// A number as the page writes it: 12 300, 3 × 10⁻⁵, 40.9 kN beside 950 N; NaN where the text begins with none.
function written(text) {
  const [, digits, power = "0", prefix = ""] = text.replaceAll("\u202f", "").replaceAll("−", "-").match(/^(-?[\d.]+)(?: × 10([⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+))?(?: ([kM])?N)?/) ?? [, ""];
  return parseFloat(digits) * 10 ** Number(power.replace("⁻", "-").replace(/[¹²³⁰-⁹]/g, (raised) => RAISED.indexOf(raised))) * ({ k: 1e3, M: 1e6 }[prefix] ?? 1);
}

function sortStatic(table) { // one that the page came with
  const body = table.tBodies[0];
  [...table.tHead.rows[0].cells].forEach((head, column) => sortHead(head, (sign) => {
    const value = (row) => {
      const text = row.cells[column].textContent.trim();
      return row.cells[column].classList.contains("num") ? written(text) : text;
    };
    body.append(...[...body.rows].sort((a, b) => sign * compare(value(a), value(b))));
  }));
}

function saveCsv(rows, name) {
  const quoted = (value) => (/[",\n]/.test(value) ? `"${value.replaceAll('"', '""')}"` : value);
  const text = rows.map((cells) => cells.map((cell) => quoted(String(cell ?? ""))).join(",")), link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([`${text.join("\n")}\n`], { type: "text/csv" }));
  link.download = `${name}.csv`;
  link.click();
  URL.revokeObjectURL(link.href);
}

class LiveTable {
  constructor(table, search, count, columns, onpick) { // columns: { title, value(row), text(row), number }
    Object.assign(this, { table, search, count, columns, onpick, rows: [], order: null, picked: null });
    const head = table.createTHead().insertRow();
    this.body = table.createTBody();
    columns.forEach((column) => {
      const cell = document.createElement("th");
      cell.textContent = column.title;
      if (column.number) cell.className = "num";
      head.append(cell);
      sortHead(cell, (sign) => { this.order = { column, sign }; this.write(); });
    });
    search.addEventListener("input", () => this.write());
    this.body.addEventListener("click", (event) => this.choose(event.target.closest("tr")));
    this.body.addEventListener("keydown", (event) => this.key(event));
  }

  fill(rows) { // each with a `key`
    this.rows = rows;
    this.write();
  }

  write() {
    const sought = this.search.value.trim().toLowerCase().replace("-", "−");
    let shown = this.rows.filter((row) => this.columns.some((column) => column.text(row).toLowerCase().includes(sought)));
    if (this.order) {
      const { column, sign } = this.order;
      shown = [...shown].sort((a, b) => sign * compare(column.value(a), column.value(b)));
    }
    this.body.replaceChildren(...shown.map((row) => {
      const line = document.createElement("tr");
      line.dataset.key = row.key;
      line.tabIndex = -1;
      this.columns.forEach((column) => {
        const cell = line.insertCell();
        cell.textContent = column.text(row);
        if (column.number) cell.className = "num";
        if (row.faint) cell.classList.add("slack");
      });
      return line;
    }));
    this.count.textContent = shown.length === this.rows.length ? `${shown.length} rows` : `${shown.length} of ${this.rows.length} rows`;
    this.mark(this.picked);
  }

  save(name) { // all rows as a CSV file
    saveCsv([this.columns.map((column) => column.title), ...this.rows.map((row) => this.columns.map((column) => (column.number ? column.value(row) : column.text(row))))], name);
  }

  mark(key, show = false) { // which row is picked
    this.picked = key;
    const lines = [...this.body.rows], own = lines.find((line) => Number(line.dataset.key) === key);
    for (const line of lines) {
      line.setAttribute("aria-selected", String(line === own));
      line.tabIndex = -1;
    }
    if (lines.length) (own || lines[0]).tabIndex = 0;
    if (own && show) {
      const frame = this.table.parentElement; // scrolls the table alone: the page stays where the view is seen
      frame.scrollTop = Math.max(0, own.offsetTop - frame.clientHeight / 2);
    }
  }

  choose(line) {
    if (!line) return;
    this.onpick(Number(line.dataset.key));
    this.mark(Number(line.dataset.key));
  }

  key(event) {
    const line = event.target.closest("tr"), to = { ArrowDown: line?.nextElementSibling, ArrowUp: line?.previousElementSibling, Home: this.body.firstElementChild, End: this.body.lastElementChild }[event.key];
    if (event.key === "Enter" || event.key === " ") this.choose(line);
    else if (!to) return;
    event.preventDefault();
    if (!to) return;
    line.tabIndex = -1;
    to.tabIndex = 0;
    to.focus();
  }
}
