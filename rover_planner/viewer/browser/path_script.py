# SPDX-License-Identifier: Apache-2.0
"""The script with which a visitor points at paths and selects them, in the table or in the scene.

A row or a number under the mouse, or a row that has the focus, is coloured at once, and the server
is told to highlight its path. A click, Enter or Space selects it. Arrows go from row to row.
"""

POINTED = "rgba(240, 228, 66, .55)"
"""Ground of a row and of a number that is pointed at."""

SCRIPT = r"""
(() => {
  if (window.__VISER_EMBED_DATA__ || window.roverPlannerPaths) return;
  window.roverPlannerPaths = true;
  const style = document.createElement("style");  // it outlives rows that are drawn again
  document.head.append(style);
  const rows = () => Array.from(document.querySelectorAll("#candidates tr[data-path]"));
  const pathOf = (e) => {
    const part = e instanceof Element && e.closest("#candidates [data-path], .label-box");
    return part ? Number(part.dataset.path || 0) : 0;
  };
  let pointed = 0;
  const point = (path) => {
    if (path === pointed) return;
    pointed = path;
    style.textContent = !path ? "" :
      `#candidates tbody[data-path="${path}"] { background: POINTED !important; }
       .label-box[data-path="${path}"] { background: rgb(240, 228, 66) !important; }`;
    window.roverPlannerSay(`point ${path}`);
  };
  const select = (path) => window.roverPlannerSay(`show ${path}`);

  document.addEventListener("pointerover", (event) => point(pathOf(event.target)));
  document.documentElement.addEventListener("pointerleave", () => point(0));
  document.addEventListener("mousedown", (event) => {
    if (pathOf(event.target)) event.preventDefault();  // the keys stay those of the drive
  });
  document.addEventListener("click", (event) => {
    const path = pathOf(event.target);
    if (path) select(path);
  });

  let focused = 0;  // number of the row that has the focus; a row that is drawn again gets it back
  document.addEventListener("focusin", (event) => {
    const path = pathOf(event.target);
    if (path || focused) point(path);
    focused = path;
  });
  document.addEventListener("pointerdown", () => { focused = 0; });
  window.addEventListener("keydown", (event) => {
    const at = event.target;
    if (event.key === "Tab") {
      if (focused) point(0);
      focused = 0;
    }
    if (!(at instanceof Element) || !at.matches("#candidates tr:focus-visible")) return;
    const path = pathOf(at), all = rows();
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (step) (all[all.indexOf(at) + step] || at).focus();
    if (event.key === "Enter" || event.key === " ") select(path);
    if (step || event.key === "Enter" || event.key === " ") {
      event.preventDefault();
      event.stopImmediatePropagation();
    }
  }, true);
  const keepFocus = () => {
    requestAnimationFrame(keepFocus);
    if (!focused || document.activeElement !== document.body) return;
    const row = rows().find((one) => Number(one.dataset.path) === focused);
    if (row) row.focus({ preventScroll: true });
  };
  keepFocus();
})();
""".replace("POINTED", POINTED)
"""JavaScript; running it again changes nothing."""
