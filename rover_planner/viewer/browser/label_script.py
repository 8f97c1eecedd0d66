# SPDX-License-Identifier: Apache-2.0
"""The script that draws the labels of the scene, and keeps them apart on the screen.

It runs in the page and in files that were saved from it. It follows the camera of viser, picture
by picture. In the order of their ranks, each box takes the nearest free position about its place
on the screen: first the place itself, then the position that it had, then positions on rings
around it. A line leads from the place to a box that has moved. What lies over the scene, such as
the header, is no free position, nor is what is between it and the edge of the window.
"""

STYLE = """
  #label-layer { position: absolute; inset: 0; overflow: hidden; pointer-events: none;
    z-index: 2; }
  .label-box { position: absolute; left: 0; top: 0; white-space: pre; color: #111;
    background: rgba(255, 255, 255, .92); border: 2px solid; border-radius: 3px;
    font: 13px/1.25 sans-serif; padding: 0 4px; }
  .label-box[data-path] { pointer-events: auto; cursor: pointer; user-select: none; }
  .label-box[data-shown="true"] { font-weight: 700; border-width: 3px; }
  .leader { position: absolute; left: 0; top: 0; border-top: 1.5px solid #111;
    transform-origin: 0 0; }
"""

SCRIPT = r"""
(() => {
  if (window.roverPlannerLabels) return;
  window.roverPlannerLabels = true;
  const style = document.createElement("style");
  style.textContent = `STYLE`;
  document.head.append(style);
  const layer = document.createElement("div");
  layer.id = "label-layer";

  const GAP = 2;  // least distance of two boxes [px]
  const RING = 7, TURNS = 16, RINGS = 24;  // distance of the rings [px], positions on each
  const OFFSETS = [];
  for (let ring = 1; ring <= RINGS; ring += 1)
    for (let k = 0; k < TURNS; k += 1) {
      const angle = 2 * Math.PI * (k + 0.5 * (ring % 2)) / TURNS;
      OFFSETS.push([ring * RING * Math.cos(angle), ring * RING * Math.sin(angle)]);
    }
  let labels = [], text = null;

  // Makes a box and a line for each label; what had the same name keeps its position.
  const build = () => {
    const source = document.getElementById("scene-labels");
    const now = source ? source.dataset.labels : "[]";
    if (now === text) return false;
    text = now;
    const before = new Map(labels.map((label) => [label.name, label.offset]));
    labels = JSON.parse(now).sort((one, other) => one.rank - other.rank);
    for (const label of labels) {
      label.offset = before.get(label.name) || [0, 0];
      label.leader = document.createElement("i");
      label.leader.className = "leader";
      label.box = document.createElement("span");
      label.box.className = "label-box";
      label.box.textContent = label.words;
      label.box.style.borderColor = label.colour;
      label.box.dataset.shown = label.shown;
      if (label.path) label.box.dataset.path = label.path;
    }
    layer.replaceChildren(...labels.map((label) => label.leader),
      ...labels.map((label) => label.box));
    for (const label of labels)
      label.half = [label.box.offsetWidth / 2, label.box.offsetHeight / 2];
    return true;
  };

  const times = (matrix, [x, y, z, w]) => [0, 1, 2, 3].map((row) =>
    matrix[row] * x + matrix[row + 4] * y + matrix[row + 8] * z + matrix[row + 12] * w);
  // Returns where on the layer a place of the scene is [px]; null behind the camera.
  const project = (view, place, width, height) => {
    let at = [...place, 1];
    for (const matrix of view) at = times(matrix, at);
    return at[3] <= 0 ? null :
      [(0.5 + 0.5 * at[0] / at[3]) * width, (0.5 - 0.5 * at[1] / at[3]) * height];
  };
  const meets = (one, other) =>
    Math.abs(one.x - other.x) < one.half[0] + other.half[0] + GAP &&
    Math.abs(one.y - other.y) < one.half[1] + other.half[1] + GAP;

  // Returns what lies over the scene, as boxes that reach to the upper or lower edge and beyond.
  const FAR = 1e4;
  const findCovers = () => {
    const scene = layer.getBoundingClientRect();
    return [...document.querySelectorAll(".over-scene, #report")].map((part) => {
      const { left, right, top, bottom, width } = part.getBoundingClientRect();
      const isUpper = top + bottom < scene.top + scene.bottom;
      const [from, to] = isUpper ? [-FAR, bottom] : [top, FAR];
      return { x: (left + right) / 2 - scene.left, y: (from + to) / 2 - scene.top,
        half: [width / 2, (to - from) / 2] };
    }).filter((cover) => cover.half[0] > 0);
  };

  const put = (label, anchor, taken) => {
    const [w, h] = label.half, down = label.stands ? -h : 0;
    const at = ([x, y]) => ({ x: anchor[0] + x, y: anchor[1] + down + y, half: label.half });
    const free = (offset) => !taken.some((other) => meets(at(offset), other));
    label.offset = [[0, 0], label.offset, ...OFFSETS].find(free) || [0, 0];
    const box = at(label.offset);
    taken.push(box);
    label.box.style.transform = `translate(${box.x - w}px, ${box.y - h}px)`;
    const x = box.x - anchor[0], y = box.y - anchor[1], away = Math.hypot(...label.offset) > 0;
    label.leader.style.visibility = away ? "visible" : "hidden";
    label.leader.style.width = `${Math.hypot(x, y)}px`;
    label.leader.style.transform =
      `translate(${anchor[0]}px, ${anchor[1]}px) rotate(${Math.atan2(y, x)}rad)`;
  };

  let last = "";
  const arrange = () => {
    requestAnimationFrame(arrange);
    const viser = window.__viserMutable;
    const root = viser && viser.nodeRefFromName[""];
    if (!root || !viser.camera || !viser.canvas) return;
    const scene = viser.canvas.parentElement;
    if (layer.parentElement !== scene) scene.append(layer);
    const isNew = build();
    const { clientWidth: width, clientHeight: height } = viser.canvas;
    const view = [root.matrixWorld.elements, viser.camera.matrixWorldInverse.elements,
      viser.camera.projectionMatrix.elements];
    const taken = findCovers();
    const now = [width, height, ...view.map((matrix) => matrix.join()),
      ...taken.map(({ x, y, half }) => [x, y, ...half].join())].join();
    if (now === last && !isNew) return;
    last = now;
    for (const label of labels) {
      const anchor = project(view, label.place, width, height);
      const seen = anchor && Math.abs(anchor[0]) < 2 * width && Math.abs(anchor[1]) < 2 * height;
      label.box.style.display = label.leader.style.display = seen ? "" : "none";
      if (seen) put(label, anchor, taken);
    }
  };
  arrange();
})();
""".replace("STYLE", STYLE)
"""JavaScript; running it again changes nothing."""
