// The report on paper: the view as it is, finer and on white, and the part from four sides.

const SIDES = [["iso", "Isometric"], ["front", "Front"], ["left", "Left"], ["top", "Top"]];

function printViews(view, into) {
  const { camera, settings } = view, before = camera.pose, aspect = 4 / 3;
  const figures = SIDES.map(([name, text]) => {
    camera.set(camera.fitted(VIEWS[name], aspect));
    return element("figure", {}, element("img", { src: view.picture64(900, 675, settings), alt: "" }), element("figcaption", {}, text));
  });
  camera.set(before);
  into.replaceChildren(...figures);
}
