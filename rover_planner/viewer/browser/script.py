# SPDX-License-Identifier: Apache-2.0
"""The script that the page runs in each browser: typed numbers, clicks, keys, lost connections.

viser sends a number at each key. "-0.05" is then 0 at its second key, and the page judges values
that nobody wants.
"""

SCRIPT = r"""
(() => {
  if (window.__VISER_EMBED_DATA__ || window.roverPlannerPage) return;
  window.roverPlannerPage = true;

  // The whole document is marked: viser makes the hint anew in a window of another width.
  if (localStorage.getItem("rover_planner-hint") === "off")
    document.documentElement.dataset.hint = "off";

  // A typed number counts when Enter is pressed or its box is left; Escape puts it back.
  const isBox = (e) => e instanceof HTMLInputElement &&
    e.classList.contains("mantine-NumberInput-input");
  const native = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value");
  let typing = null;  // the box that is typed into, and its text before
  let passes = false;  // whether the events are ours
  // A box that has the focus keeps its text: what the page writes into it meanwhile, as while the
  // drive plays, is written when it is left or its number counts.
  let held = null;  // the box, how the page writes into it, and the last text that it wrote
  const hold = (box) => {
    if (held && held.box === box) return;
    release();
    const own = Object.getOwnPropertyDescriptor(box, "value");
    const now = { box, own, text: box.value };
    held = now;
    Object.defineProperty(box, "value", {
      configurable: true,
      get: () => native.get.call(box),
      // viser's box also writes what it reads, to place the caret: that is no new text.
      set: (text) => { if (text !== native.get.call(box)) now.text = String(text); },
    });
    box.setSelectionRange = () => {};  // nor does it move the caret
  };
  const release = () => {
    if (!held) return;
    const { box, own, text } = held;
    held = null;
    delete box.value;
    delete box.setSelectionRange;
    if (own) Object.defineProperty(box, "value", own);
    if (box.value !== text) box.value = text;
  };
  const end = () => {
    if (held && held.box === typing.box) {
      typing.text = held.text;
      held.text = native.get.call(typing.box);
      release();
    }
    typing.box.style.fontStyle = "";
    const was = typing;
    typing = null;
    return was;
  };
  const limits = (box) => {
    for (let part = box.parentElement; part; part = part.parentElement) {
      const slider = part.querySelector('[role="slider"]');
      if (slider) return ["aria-valuemin", "aria-valuemax"].map((name) =>
        parseFloat(slider.getAttribute(name)));
    }
    return [-Infinity, Infinity];
  };
  // A number beyond the ends of its slider is limited, and a note at its box says so for a while.
  const note = document.createElement("div");
  note.id = "limited";
  note.setAttribute("role", "status");
  note.style.cssText = "display:none;position:fixed;z-index:1000;background:#333;color:#fff;" +
    "font-size:12px;line-height:1.4;padding:.2em .6em;border-radius:.3em;pointer-events:none";
  document.body.append(note);
  let noted = null, notedUntil = 0;  // the box of the note, and the end of its time [ms]
  const hideNote = () => {
    noted = null;
    note.style.display = "none";
  };
  const placeNote = () => {  // tables above the box come and go: the note stays at it
    if (!noted) return;
    const { right, top, bottom, width } = noted.getBoundingClientRect();
    if (width === 0 || performance.now() > notedUntil) {
      hideNote();
      return;
    }
    note.style.right = `${window.innerWidth - right}px`;
    note.style.top = `${bottom + 30 < window.innerHeight ? bottom + 4 : top - 26}px`;
    requestAnimationFrame(placeNote);
  };
  const sayLimited = (box, value, which) => {
    note.textContent = `limited to ${value}, the slider's ${which} value`;
    note.style.display = "block";
    const runs = noted !== null;
    noted = box;
    notedUntil = performance.now() + 6000;
    if (!runs) placeNote();
  };
  const commit = (box, isTyped = true) => {
    if (typing === null || typing.box !== box) return;
    const typed = box.value.trim().replace(",", ".");
    const before = end().text;
    let value = typed === "" ? NaN : Number(typed);
    const [low, high] = limits(box);
    const which = value > high ? "largest" : value < low ? "smallest" : "";
    value = Math.min(Math.max(value, low), high);
    const text = Number.isFinite(value) ? String(parseFloat(value.toFixed(9))) : before;
    if (which && isTyped) sayLimited(box, text, which);
    if (text === before) {
      box.value = before;
      return;
    }
    // The box compares the new text with the old one from where the caret was at the last key:
    // it must see all of the old text replaced.
    box.value = before;
    box.setSelectionRange(0, before.length);
    passes = true;
    box.dispatchEvent(new KeyboardEvent("keydown", { key: "Unidentified", bubbles: true }));
    native.set.call(box, text);
    box.setSelectionRange(text.length, text.length);
    box.dispatchEvent(new Event("input", { bubbles: true }));
    passes = false;
  };
  window.addEventListener("beforeinput", (event) => {
    const box = event.target;
    if (!isBox(box) || event.inputType === "insertLineBreak") return;
    hideNote();
    if (typing && typing.box === box) return;
    hold(box);
    typing = { box, text: held.text };
    box.style.fontStyle = "italic";
  }, true);
  for (const kind of ["input", "change"]) {
    window.addEventListener(kind, (event) => {
      if (!isBox(event.target) || passes) return;
      event.stopImmediatePropagation();
      if (kind === "change") commit(event.target);
    }, true);
  }
  window.addEventListener("focusin", (event) => {
    if (isBox(event.target)) hold(event.target);
  }, true);
  window.addEventListener("focusout", (event) => {
    if (!isBox(event.target)) return;
    commit(event.target);
    release();
  }, true);
  window.addEventListener("keydown", (event) => {
    const box = event.target;
    if (!isBox(box) || passes) return;
    if (event.key === "Enter" || event.key === "Escape") {
      if (typing && event.key === "Enter") commit(box);
      if (typing && event.key === "Escape") box.value = end().text;
      release();
    } else if (["ArrowUp", "ArrowDown"].includes(event.key)) {
      if (typing === null) release();  // they change the number by a step, which is to be seen
    } else if (event.key !== "Tab") hold(box);
  }, true);

  // A click on a lane or a plot goes to the time at which the rover is there.
  const scrubber = () => Array.from(document.querySelectorAll("input")).find((box) => {
    let part = box;
    for (let k = 0; k < 8 && part; k += 1, part = part.parentElement)
      if (isBox(box) && part.textContent.startsWith("Time [s]")) return true;
    return false;
  });
  window.addEventListener("click", (event) => {
    const area = event.target.closest("#lanes svg, .u-over");
    const lanes = document.getElementById("lanes");
    const box = scrubber();
    if (!area || !lanes || !box) return;
    const { left, width } = area.getBoundingClientRect();
    const times = lanes.dataset.times.split(" ");
    const share = Math.min(Math.max((event.clientX - left) / width, 0), 1);
    release();
    typing = { box, text: box.value };
    native.set.call(box, times[Math.round(share * (times.length - 1))]);
    commit(box, false);
  });

  // Without the program the page still looks as it did.
  const lost = document.createElement("div");
  lost.id = "lost";
  lost.setAttribute("role", "alert");
  lost.textContent = "No connection to the program: what is shown is old. " +
    "The page goes on by itself when the program runs again.";
  lost.style.cssText = "display:none;position:fixed;top:80px;left:50%;" +
    "transform:translateX(-50%);z-index:1000;background:#b3261e;color:#fff;" +
    "font-size:16px;padding:.6em 1em;border-radius:.5em";
  document.body.append(lost);
  let connected = false;
  setInterval(() => {
    const now = document.querySelector(".tabler-icon-cloud-check") !== null;
    connected = connected || now;
    const waits = !now && document.querySelector(".mantine-Loader-root") !== null;
    lost.style.display = connected && waits ? "block" : "none";
  }, 500);

  // Space and arrows belong to the drive, not to the camera nor to a button pressed before.
  const KEYS = ["Space", "ArrowLeft", "ArrowRight", "Home"];
  document.body.addEventListener("keydown", (event) => {
    const at = event.target;
    const slides = at.closest('[role="slider"]');
    const byKeys = at !== document.body && at.matches(":focus-visible");
    if (KEYS.includes(event.code) && (slides || byKeys)) event.stopPropagation();
  });
  document.documentElement.addEventListener("keydown", (event) => {
    if (KEYS.includes(event.code)) event.stopPropagation();
  });
  window.addEventListener("pointerup", () => setTimeout(() => {
    const at = document.activeElement;
    if (at && at.matches('button, [role="tab"], [type="checkbox"]')) at.blur();
  }), true);
})();
"""
"""JavaScript; running it again changes nothing."""
