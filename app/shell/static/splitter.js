/* The bar between map and view: dragged, or moved with arrow keys; where it stands is remembered. */
const LEAST = 0.15, MOST = 0.8, STEP = 0.02;
/** Whether map, view and panels lie one below the other. */
export const narrow = matchMedia("(max-width: 1000px)");

export function split(bar) {
  const style = document.documentElement.style;
  const key = () => `symgrasp.map.${narrow.matches ? "height" : "width"}`;
  let share = 0;

  function put(value) {
    share = Math.min(MOST, Math.max(LEAST, value));
    style.setProperty("--share", String(share));
    bar.setAttribute("aria-valuenow", String(Math.round(100 * share)));
  }
  function keep() {
    try { localStorage.setItem(key(), String(share)); } catch { /* a browser that keeps nothing */ }
  }
  function recall() {
    bar.setAttribute("aria-orientation", narrow.matches ? "horizontal" : "vertical");
    style.removeProperty("--share");
    let kept = null;
    try { kept = localStorage.getItem(key()); } catch { /* as above */ }
    const value = Number(kept);
    put(kept !== null && value > 0 ? value : Number(getComputedStyle(document.documentElement).getPropertyValue("--share")));
  }

  bar.addEventListener("pointerdown", (event) => bar.setPointerCapture(event.pointerId));
  bar.addEventListener("pointermove", (event) => {
    if (!bar.hasPointerCapture(event.pointerId)) return;
    put(narrow.matches ? event.clientY / innerHeight : event.clientX / innerWidth);
  });
  bar.addEventListener("pointerup", keep);
  bar.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -STEP, ArrowUp: -STEP, ArrowRight: STEP, ArrowDown: STEP }[event.key];
    if (!by) return;
    event.preventDefault();
    put(share + by);
    keep();
  });
  narrow.addEventListener("change", recall);
  recall();
}
