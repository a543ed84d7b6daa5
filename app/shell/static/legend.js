/* The words around the map: its title and legend. Texts may come from files, and are never markup. */
import { patterned, tile } from "./patterns.js";

export function describe(element, pane) {
  const { look, prints } = pane;
  const title = element("title");
  title.textContent = look.title + (look.age ? ` — ${look.age}` : "");
  title.setAttribute("aria-busy", String(look.busy));
  const rows = look.legend.map(([color, label, cells], k) => {
    const name = patterned(look) ? look.patterns[k] : "";
    return row(color, label, `${cells} · ${share(cells, look.places)} %`, name);
  });
  for (const [color, label] of prints?.legend ?? []) rows.push(row(color, label, ""));
  element("legend").replaceChildren(...rows);
  element("counted").textContent = look.counted ?? "";
  const scale = element("scale");
  scale.hidden = !look.scale;
  if (look.scale) {
    const [label, high, colors] = look.scale;
    const [name, bar, end] = scale.children;
    name.textContent = `${label}: 0`;
    bar.style.background = `linear-gradient(to right, ${colors.join(", ")})`;
    end.textContent = String(high);
  }
}

function share(cells, all) {
  return cells && 200 * cells < all ? "<1" : String(Math.round((100 * cells) / all));
}

function row(color, label, count, pattern) {
  const item = document.createElement("li");
  const [swatch, name, number] = ["i", "span", "small"].map((tag) => document.createElement(tag));
  swatch.style.backgroundColor = color;
  if (pattern) swatch.style.backgroundImage = `url(${tile(pattern, color, 2).toDataURL()})`;
  name.textContent = label;
  number.textContent = count;
  item.append(swatch, name, number);
  return item;
}
