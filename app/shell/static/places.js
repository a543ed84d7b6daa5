/* Clicks on the heat map of a survey, which the panels have: viser shows their HTML, and says nothing of clicks on it. */
export function watchPlaces(view, send) {
  view.addEventListener("load", () => {
    view.contentDocument.addEventListener("click", ({ target }) => {
      const place = target.closest("[data-place]");
      if (place) send({ do: "place", index: Number(place.dataset.place) });
    });
  });
}
