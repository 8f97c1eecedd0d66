// SPDX-License-Identifier: Apache-2.0
// What the page does in each browser: it sends words to the program, and tells when that is gone.
// words.py puts it into the page. Running it again changes nothing.
(() => {
  if (window.roverPlanner) return;
  window.roverPlanner = true;

  // Sends words through the hidden text box of words.py; the count makes them differ.
  const PREFIX = "rover_planner:";
  let count = 0;
  const say = (words) => {
    const box = Array.from(document.querySelectorAll("input"))
      .find((one) => one.value.startsWith(PREFIX));
    if (!box) return;
    count += 1;
    const text = Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, "value");
    text.set.call(box, `${PREFIX} ${Date.now()}.${count} ${words}`);
    box.dispatchEvent(new Event("input", { bubbles: true }));
  };

  if (location.search) say(`open ${location.search}`);

  // A row says its words; a click on a lane or a plot says at which share of the path it was.
  document.addEventListener("click", (event) => {
    const row = event.target.closest("[data-say]");
    if (row) say(row.dataset.say);
    const lane = event.target.closest("[data-along], .u-over");
    if (lane) {
      const { left, width } = lane.getBoundingClientRect();
      say(`seek ${(event.clientX - left) / width}`);
    }
  });

  // Space and arrows belong to the drive, not to the camera nor to a button pressed before.
  // Whoever comes to a button by the tab key means the button.
  const KEYS = ["Space", "ArrowLeft", "ArrowRight", "Home"];
  let byPointer = false;
  window.addEventListener("pointerdown", () => { byPointer = true; }, true);
  window.addEventListener("keydown", (event) => {
    if (event.code === "Tab") byPointer = false;
  }, true);
  document.body.addEventListener("keydown", (event) => {
    const at = event.target;
    const row = at.closest("tr[tabindex]");
    if (row && ["Enter", "Space"].includes(event.code)) {
      event.preventDefault();
      row.click();
    }
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.code];
    if (row && step) {
      const rows = Array.from(document.querySelectorAll("tr[tabindex]"));
      (rows[rows.indexOf(row) + step] || row).focus();
      event.preventDefault();
    }
    if (!KEYS.includes(event.code)) return;
    const byKeys = !byPointer && at !== document.body && at.matches(":focus-visible");
    if (byKeys || at.matches('[role="slider"]')) event.stopPropagation();
    else if (at.matches('button, [role="tab"]')) at.blur();
  });
  document.documentElement.addEventListener("keydown", (event) => {
    if (KEYS.includes(event.code)) event.stopPropagation();
  });
  window.addEventListener("pointerup", () => setTimeout(() => {
    const at = document.activeElement;
    if (at && at.matches('button, [role="tab"], [type="checkbox"]')) at.blur();
  }), true);

  // Whoever has read the hint has read it for ever.
  if (localStorage.getItem("rover_planner-hint") === "off")
    document.documentElement.dataset.hint = "off";

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
  setInterval(async () => {
    const answers = await fetch("/alive", { cache: "no-store" }).then(() => true, () => false);
    lost.style.display = answers ? "none" : "block";
  }, 2000);
})();
