// The view without a page round it, as notebooks show it.

const data = JSON.parse(document.getElementById("data").textContent);
const alone = new Viewer(document.querySelector(".run"), data.runs, 0, data.viridis);
alone.open();
matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => alone.update());
