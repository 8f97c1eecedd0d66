// SPDX-License-Identifier: Apache-2.0
// Draws what the program tells, part by part, and asks what a person wants.
// A part is drawn anew when it comes; nothing here knows more than `state` has.

const state = {};
const chosen = { tab: "Drive", lane: "", link: "", program: "", moved: null };
const at = (id) => document.getElementById(id);
const SHAPES = ["svg", "path"]; // elements of a drawing
const COLOURS = { rear: "#0072b2", middle: "#d55e00", front: "#00795a" };
const PRESS = 5000; // [ms] for which a press lasts at most
const ROOMY = 900; // [px] of height from which the board begins with all its numbers
const SETTLE = 500; // [ms] after which a box shows the program's value, also if its own was refused
const CLASSES = [[0.5, "little", "to 50 %"], [0.8, "half", "to 80 %"], [1, "near", "to 100 %"],
  [Infinity, "broken", "broken"], [null, "unasked", "not asked"]];
const kindOf = (use) => CLASSES.find(([most]) => (use === null ? most === null : use <= most))[1];
const percent = (use) => (use < 99 ? `${Math.round(100 * use)} %` : "fails");

// Children that there are: false, null and "" stand for none.
const present = (children) => children.flat().filter(Boolean);
const fill = (id, ...children) => at(id).replaceChildren(...present(children));

// An element with its attributes and children; what begins with "on" listens.
function make(tag, attributes = {}, ...children) {
  const element = SHAPES.includes(tag) ? document.createElementNS("http://www.w3.org/2000/svg", tag) : document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
    else if ((value ?? false) !== false) element.setAttribute(name, value === true ? "" : value);
  }
  element.append(...present(children));
  return element;
}

const button = (words, question, attributes = {}) =>
  make("button", { "data-ask": JSON.stringify(question), ...attributes }, words);
const cells = (tag, values) => values.map((value) => make(tag, {}, value));
const table = (heads, rows, attributes = {}) =>
  make("table", attributes, heads.length && make("tr", {}, cells("th", heads)), rows);
const key = (look, words) => make("span", { class: "key" }, make("i", look), words);

// ---- The channel.

let socket = null;
let pressed = 0; // timer of a press, in which nothing is drawn: drawn anew, it would lose the click
let waits = false; // true until the picture of FIRST
const FIRST = ["subject", "verdict"]; // what a person waits for; a picture of it comes before all else
const waiting = new Set(); // names of the parts that are not drawn yet

function ask(question) {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(question));
}

function connect() {
  socket = new WebSocket(`ws://${location.host}/channel`);
  socket.onmessage = (event) => take(JSON.parse(event.data));
  socket.onopen = () => take({ lost: false });
  socket.onclose = () => { take({ lost: true }); setTimeout(connect, 1000); };
}

function take(parts) {
  Object.assign(state, parts);
  for (const name of Object.keys(parts)) waiting.add(name);
  if (FIRST.some((name) => name in parts)) {
    draw(FIRST);
    if (!waits) requestAnimationFrame(() => setTimeout(() => { waits = false; draw(); }));
    waits = true;
  } else if (!waits) draw();
}

function draw(names = [...waiting]) {
  for (const name of pressed ? [] : names) if (waiting.delete(name)) DRAW[name]?.(state[name]);
}

// A program that was started again knows nothing of what was changed: take that up.
function greet(program) {
  const before = chosen.program;
  chosen.program = program;
  if (before && before !== program) {
    if (chosen.link) ask({ ask: "open", query: chosen.link });
    take({ restarted: chosen.link ? "what you had changed is taken up" : "it shows what it was started with" });
  } else if (!before && location.search) {
    ask({ ask: "open", query: location.search });
    history.replaceState(null, "", location.pathname);
  }
}

// ---- What is drawn for each part.

const DRAW = {
  subject: drawSubject, errors: drawErrors, lost: drawErrors, restarted: drawErrors,
  scene: drawScene, verdict: drawVerdict, advice: drawAdvice,
  paths: drawPaths, sliders: drawSliders, values: drawValues, changes: drawChanges,
  limits: drawLimits, uses: drawUses, board: drawBoard, drive: drawDrive,
  legend: drawLegend, chosen: drawChosen, topics: drawTopics, learned: drawLearned,
  program: greet, file: saveFile, link: drawShare, current: (link) => { chosen.link = link; }, written: drawShare,
};

function drawSubject(facts) {
  document.title = `${facts.rover} on ${facts.map}`;
  fill("subject", Object.entries(facts).filter(([, value]) => value)
    .map(([name, value]) => make("div", {}, make("span", {}, `${name} `), make("b", {}, value))));
}

function drawErrors() {
  const lines = (state.errors || []).map(([what, why]) => `${what}: ${why}`);
  document.querySelector("main").toggleAttribute("data-old", Boolean(state.lost));
  if (state.lost) lines.unshift("No connection to the program: what is shown is old. The page goes on by itself when the program runs again.");
  if (state.restarted) lines.push(`The program was started again; ${state.restarted}.`);
  fill("errors", cells("div", lines));
}

// Under another name of this machine the scene has a process of its own: its pictures delay no number.
const ALIASES = { "127.0.0.1": "localhost", localhost: "127.0.0.1" };
function drawScene(scene) {
  const address = `http://${ALIASES[location.hostname] || location.hostname}:${scene.port}`;
  if (!at("scene").srcdoc && at("scene").src !== `${address}/`) at("scene").src = address;
}

function drawVerdict(one) {
  const box = at("verdict");
  box.dataset.passes = one.passes;
  box.toggleAttribute("data-old", Boolean(one.old));
  const open = box.querySelector("details")?.open;
  const policies = (one.policies || []).map((policy) =>
    make("div", { "data-passes": String(policy.passes), "data-old": policy.old, title: policy.reason },
      policy.title, make("br"), make("b", {}, policy.word)));
  fill("verdict",
    make("div", {}, make("span", { class: "word" }, one.word), " ", make("small", {}, one.about)),
    one.headline && make("div", { id: "headline" }, make("b", {}, one.headline), one.where && `, ${one.where}`),
    one.chance && make("small", { id: "chance" }, one.chance),
    one.old && make("div", { class: "notice", id: "old" }, `old: ${one.old}`),
    one.refusal && make("div", { class: "notice", id: "refusal" }, `refused: ${one.refusal}`),
    make("div", { class: "row" }, (one.offers || []).map((offer) => button(offer.words, offer.ask, { class: "main" })),
      one.fails && button("Go to the failure", { ask: "failure" }),
      one.judging && make("small", { id: "judging" }, one.judging),
      one.judging && !one.stopped && button("Cancel", { ask: "cancel" }),
      one.stopped && button("Judge again", { ask: "judge" })),
    make("div", { class: "policies" }, policies),
    one.details?.length && make("details", { open: open || document.body.className === "sent" },
      make("summary", {}, "the whole reason"), cells("div", one.details)),
  );
}

// What would make the path pass: pointed at, a remedy shows its path; clicked, it is judged.
function drawAdvice(advice) {
  const { words, rows } = advice || { rows: [] };
  const point = (words) => () => ask({ ask: "ghost", words });
  fill("advice", advice && make("small", {}, `${words} `),
    advice?.seeking && button("Stop", { ask: "cancel" }),
    advice?.can_ask && button("What would help?", { ask: "advise" }),
    make("ol", {}, rows.map((row) => make("li", !row.taken ? { class: "quiet" } : {
      tabindex: 0, onpointerenter: point(row.words), onpointerleave: point(null), onkeydown: pressRow,
      onclick: () => ask({ ask: "remedy", words: row.words }),
    }, row.words, make("small", {}, ` (${row.costs})`)))));
}

function drawPaths({ rows, shown }) {
  const focus = document.activeElement?.dataset?.row;
  const bodies = rows.map((row, index) => make("tbody", {
    "data-passes": String(row.passes), "data-old": Boolean(row.waits), "data-shown": index === shown,
    onclick: () => ask({ ask: "show", index }),
  },
  make("tr", { tabindex: 0, "data-row": index, "aria-selected": String(index === shown), onkeydown: pressRow },
    make("td", {}, make("b", {}, row.number)),
    make("td", {}, make("b", { class: "mark" }, row.word), row.waits && ` (${row.waits})`),
    make("td", {}, row.length), make("td", {}, row.energy), make("td", {}, row.use, make("br"), row.limit)),
  make("tr", {}, make("td"), make("td", { colspan: 4, class: "quiet" }, row.reason))));
  fill("paths", table(["", "verdict", "length [m]", "energy [J]", "most used"], bodies, { role: "grid" }));
  if (focus !== undefined) at("paths").querySelector(`[data-row="${focus}"]`)?.focus();
}

function pressRow(event) {
  const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
  if (["Enter", " "].includes(event.key)) event.currentTarget.click();
  else if (step) at("paths").querySelector(`[data-row="${Number(event.currentTarget.dataset.row) + step}"]`)?.focus();
  else return;
  event.preventDefault();
  event.stopPropagation();
}

// ---- The rover.

function drawSliders(parts) {
  fill("sliders", parts.map((part, k) => make("details", { open: k < 2 },
    make("summary", {}, make("b", {}, part.title)),
    part.sliders.map(([label, low, high, step, loaded]) => {
      const send = ({ target: { value, min, max } }) => value && ask({ ask: "value", label, value: Math.min(Math.max(value, min), max) });
      const move = () => { chosen.moved = label; };
      const settle = () => setTimeout(() => {
        if (chosen.moved === label) chosen.moved = null;
        drawValues(state.values);
      }, SETTLE);
      const ends = { min: low, max: high, step: "any", "aria-label": label };
      return make("div", { class: "slider", "data-label": label, "data-loaded": loaded },
        make("label", {}, label),
        make("input", { type: "range", ...ends, step, oninput: (event) => { move(); send(event); }, onchange: settle }),
        make("input", { type: "number", ...ends, oninput: move, onchange: (event) => { send(event); settle(); } }));
    }))));
  if (state.values) drawValues(state.values);
}

function drawValues(values) {
  for (const row of at("sliders").querySelectorAll(".slider")) {
    const now = values[row.dataset.label] ?? 0;
    row.toggleAttribute("data-changed", Math.abs(now - row.dataset.loaded) > 1e-9);
    if (chosen.moved === row.dataset.label) continue;
    for (const input of row.querySelectorAll("input")) {
      [input.min, input.max] = [Math.min(input.min, now), Math.max(input.max, now)];
      input.value = String(Number(now.toPrecision(6)));
    }
  }
}

function drawChanges({ kept, rover, drive }) {
  const rows = [...rover, ...drive].map(([name, was, now]) => make("tr", {}, cells("td", [name, was, make("b", {}, now)])));
  const differs = rows.length ? table(["", kept ? "reference" : "loaded", "now"], rows)
    : make("div", { class: "quiet" }, `nothing differs from the rover as ${kept ? "kept" : "loaded"}`);
  fill("changes",
    make("div", { class: "row" },
      button("Undo", { ask: "undo" }), button("Reset", { ask: "reset" }),
      button("Keep as reference", { ask: "keep" }), kept && button("Compare with loaded", { ask: "drop" }),
      select("preset", (state.chosen?.presets || []).map((name) => [name, name]), state.chosen?.preset, (name) => ({ ask: "preset", name })),
      make("label", {}, "Load a file ", make("input", { type: "file", accept: ".yaml,.yml", style: "width:9em",
        onchange: async ({ target: { files: [file] } }) => file && ask({ ask: "upload", name: file.name, text: await file.text() }) })),
      button("Save as rover file", { ask: "save rover" })),
    differs);
}

function select(label, options, now, question) {
  const known = options.some(([value]) => value === now) ? options : [...options, [now, now]];
  const box = make("select", { "aria-label": label, onchange: (event) => ask(question(event.target.value)) },
    known.map(([value, words]) => make("option", { value }, words)));
  box.value = now;
  return box;
}

function drawChosen(now) {
  const colour = (changes) => ({ ask: "colour", layer: now.layer, heading: now.heading, along: now.along, ...changes });
  const row = (label, box) => make("div", { class: "row" }, make("label", {}, label), box);
  const check = (label, on, question) => row(label, make("input", { type: "checkbox", "aria-label": label, checked: on, onchange: (event) => ask(question(event.target.checked)) }));
  const choose = (label, options, chosen, question) => row(label, select(label, options, chosen, question));
  fill("chosen",
    now.policies && [
      choose("A click sets", [["goal", "goal"], ["start", "start"]], now.sets, (sets) => ({ ask: "click", sets })),
      choose("Torques", now.policies, now.policy, (name) => ({ ask: "policy", name })),
      choose("Soil", [["", "none (Coulomb)"], ...now.soils.map((name) => [name, name])], now.soil, (name) => ({ ask: "soil", name }))],
    choose("Colour by", now.layers.map((name) => [name, name]), now.layer, (layer) => colour({ layer })),
    now.predicted.includes(now.layer) && [
      row("Heading [deg]", make("input", { type: "number", min: -180, max: 180, step: 5, value: now.heading, "aria-label": "Heading [deg]", onchange: (event) => ask(colour({ heading: Number(event.target.value) })) })),
      check("Heading along the path", now.along, (along) => colour({ along }))],
    check("Forces", now.forces, (shown) => ({ ask: "forces", shown })));
  if (now.speeds) fill("speed", select("Speed", now.speeds.map((one) => [one, `${one} x`]), now.speed, (times) => ({ ask: "speed", times: Number(times) })));
  drawShare();
  if (state.changes) drawChanges(state.changes);
  if (!now.policies) openTab(chosen.tab);
}

// ---- Limits: lanes, curves, and their uses at the time that is shown.

const share = (distance) => `${100 * Math.min(distance / (state.limits.end || 1), 1)}%`;

function goTo(event) {
  const { left, width } = event.currentTarget.getBoundingClientRect();
  ask({ ask: "place", distance: state.limits.end * (event.clientX - left) / width });
}

function drawLimits({ end, lanes, code, compared }) {
  if (!lanes.some((lane) => lane.code === chosen.lane) || code) chosen.lane = code || "friction";
  const strip = (curve, title, extra = "") => [...listRuns(curve)].map(([left, right, kind, most]) => make("i", {
    class: `${kind} ${extra}`, title: `${title} ${most === null ? "does not count or is not known" : percent(most)}; at ${left.toFixed(2)} m`,
    style: end ? `left:min(${share(left)}, 100% - 5px);width:calc(${share(right)} - ${share(left)})` : "left:0;width:100%",
  }));
  const rows = lanes.map((lane) => make("div", { class: "lane", "data-code": lane.code, onclick: () => { chosen.lane = lane.code; drawCurves(); drawUses(); } },
    make("div", {}, lane.title),
    make("div", { class: `strip ${compared ? "compared" : ""}`, onclick: goTo },
      strip(lane.now, lane.title), lane.before && strip(lane.before, `reference: ${lane.title}`, "before"), make("div", { class: "cursor" })),
    make("div", {}), make("div", { class: "worst" })));
  fill("limits",
    make("h2", {}, "Use of the limits ", make("small", {}, end ? `over ${end.toFixed(2)} m${compared ? "; below: the reference" : ""}` : "at the first pose")),
    rows, make("div", {}, CLASSES.map(([, kind, words]) => key({ class: kind }, words))));
  drawUses();
  drawCurves();
}

// The stretches of a curve of one class: begin, end, class and largest use.
function* listRuns({ x, y: [y] }) {
  for (let first = 0, k = 1; k <= x.length; k += 1) {
    const kind = kindOf(y[first]);
    if (k < x.length && kindOf(y[k]) === kind) continue;
    const [left, right] = [first, k].map((at) => (at === 0 ? x[0] : at === x.length ? x.at(-1) : (x[at - 1] + x[at]) / 2));
    yield [left, right, kind, kind === "unasked" ? null : Math.max(...y.slice(first, k))];
    first = k;
  }
}

function drawUses() {
  at("limits").querySelectorAll(".lane").forEach((row, k) => {
    const use = state.uses?.[k];
    if (!use) return;
    row.toggleAttribute("data-broken", use.broken);
    row.toggleAttribute("data-chosen", row.dataset.code === chosen.lane);
    row.children[2].textContent = use.now;
    row.children[3].textContent = [`worst ${use.worst}`, use.value, use.link].filter(Boolean).join(", ");
  });
}

function drawCurves() {
  const lane = state.limits?.lanes.find((one) => one.code === chosen.lane);
  if (!lane) return;
  fill("curves",
    make("h2", {}, lane.code === "chance" ? "chance of failure" : `${lane.title}, use of the limit`), plot(lane.wheels || lane.now, percent, 1.0, lane.before),
    make("h2", {}, "wheel loads"), plot(state.limits.loads, (value) => `${value.toFixed(0)} N`, null, null),
    make("div", {}, Object.entries(COLOURS).map(([name, colour]) => key({ style: `background:${colour}` }, name)),
      make("small", {}, "right: line, left: dashes")));
  moveCursor();
}

function plot(curve, write, limit, old) {
  const known = [...curve.y.flat(), ...(old ? old.y.flat() : [])].filter((value) => value !== null);
  const top = Math.min(Math.max(limit ? 1.2 : 0, ...known, 1e-9), limit ? 3 : Infinity);
  const down = (value) => 100 * (1 - Math.min(value, top) / (1.04 * top)); // a line at the top is seen
  const box = make("svg", { viewBox: "0 0 1000 100", preserveAspectRatio: "none" });
  const end = state.limits.end || 1;
  const line = (x, y, attributes) => {
    const pen = (k) => ((y[k - 1] ?? null) === null ? "M" : "L");
    const step = (distance, k) => `${pen(k)}${(1000 * distance / end).toFixed(1)} ${down(y[k]).toFixed(2)}`;
    const path = x.map((distance, k) => (y[k] === null ? "" : step(distance, k))).join("");
    box.append(make("path", { d: x.length === 1 ? `${path}h1000` : path || "M0 0", fill: "none", "vector-effect": "non-scaling-stroke", "stroke-width": 1.6, ...attributes }));
  };
  if (old) line(old.x, old.y[0], { stroke: "#888", "stroke-width": 4, opacity: 0.6 });
  curve.y.forEach((y, k) => {
    const wheel = ["rear", "middle", "front"][k % 3];
    line(curve.x, y, curve.y.length === 6 ? { stroke: COLOURS[wheel], "stroke-dasharray": k > 2 && "5 3" } : { stroke: "#222" });
  });
  if (limit) line([0, end], [limit, limit], { stroke: "#c24f00", "stroke-dasharray": "2 3" });
  return make("div", { class: "plot", onclick: goTo }, box,
    [0, top, limit].filter((value) => value !== null).map((value) => make("span", { class: "tick", style: `top:${down(value)}%` }, write(value))),
    make("span", { class: "end" }, `${(state.limits.end || 0).toFixed(2)} m`), make("div", { class: "cursor" }));
}

function moveCursor() {
  if (!state.drive || !state.limits) return;
  for (const cursor of document.querySelectorAll(".cursor")) cursor.style.left = share(state.drive.distance);
}

// ---- The drive.

function drawBoard(board) {
  if (!board) return fill("board", make("div", { class: "quiet" }, "the rover is not known yet"));
  const bar = ([title, use, words]) => make("div", {}, make("small", {}, `${title} `), make("b", {}, words),
    make("span", { class: "use" },
      make("i", { class: kindOf(use), style: `width:${100 * Math.min((use ?? 1.5) / 1.5, 1)}%` }),
      make("i", { class: "limit" })));
  const wheels = [5, 2, 4, 1, 3, 0].map((k) => board.wheels[k]).map((wheel) =>
    make("div", { class: "wheel", "data-fails": wheel.fails },
      make("div", {}, make("div", { class: "tyre", style: `background:${wheel.colour};transform:rotate(${-(wheel.turn || 0)}deg)` }), make("small", {}, wheel.load)),
      make("div", {}, make("div", {}, wheel.name, wheel.slip && make("small", {}, `, ${wheel.slip}`)), wheel.bars.map(bar))));
  fill("board",
    make("div", { class: "quiet" }, "from above, the front at the top; bars: use of the limit, which is the line"),
    make("div", { class: "wheels" }, wheels),
    make("div", { class: "numbers" }, Object.entries(board.numbers).map(([name, value]) => make("div", {}, make("span", {}, name), make("b", {}, value)))),
    make("details", { open: document.body.className === "sent" || (at("board").querySelector("details")?.open ?? innerHeight > ROOMY) },
      make("summary", {}, "all numbers of the wheels"),
      table(["", ...board.wheels.map((wheel) => wheel.name)],
        board.table.map(([title, values]) => make("tr", {}, make("th", {}, title), cells("td", values))), { id: "wheels" })));
}

function drawDrive(drive) {
  const isLive = drive.duration === null;
  at("drive").toggleAttribute("data-live", isLive);
  at("plays").textContent = isLive ? drive.words : `${drive.time.toFixed(1)} s, ${drive.words}`;
  if (isLive) return;
  at("time").max = drive.duration;
  if (!at("time").matches(":active")) at("time").value = drive.time;
  at("fails").hidden = drive.fails === null;
  at("fails").style.left = `${100 * (drive.fails || 0) / (drive.duration || 1)}%`;
  at("play").textContent = drive.plays ? "Pause" : "Play";
  moveCursor();
}

function drawLegend({ title, gradient, ends, keys, notes }) {
  fill("legend", make("b", {}, title),
    gradient.length && make("div", { class: "bar", style: `background:linear-gradient(90deg,${gradient})` }),
    gradient.length && make("div", { class: "ends" }, cells("span", ends)),
    keys.map(([colour, words]) => make("div", {}, key(colour === "hatched" ? { class: "hatched" } : { style: `background:${colour}` }, words))),
    cells("div", notes));
}

function drawLearned(lines) {
  fill("learned", lines.length && make("h2", {}, "learned of the ground"), cells("div", lines));
}

function drawTopics(topics) {
  const rows = topics.map(({ topic, age, stale }) =>
    make("tr", { "data-old": stale }, cells("td", [topic, `${stale ? "stale, " : ""}${age}`])));
  fill("topics", make("h2", {}, "age of the last message"), table([], rows));
}

// ---- Share.

function drawShare() {
  const { written, link } = state;
  const address = link ? `${location.origin}${location.pathname}?${link}` : "";
  fill("share", written ? [
    make("h2", {}, "How it was made"), make("div", {}, `${written.versions}; written ${written.written}`),
    written.link && make("div", {}, "the same on a page of the same map: ", make("a", { href: written.link }, written.link)),
    make("details", {}, make("summary", {}, "rover file"), make("pre", {}, written.rover)),
  ] : [
    make("p", {}, "One HTML file with the scene, the failing pose, all numbers and versions. It opens in any browser, without this program."),
    button("Save as HTML file", { ask: "save page", base: location.origin }),
    make("p", {}, "A link to this page that holds rover, changed values, ends, path, time and colours."),
    button("Link to what is shown", { ask: "link" }),
    link && make("div", { class: "row" }, make("button", { onclick: () => navigator.clipboard.writeText(address) }, "Copy"), make("a", { id: "link", href: address }, address)),
  ]);
}

function saveFile({ name, text }) {
  const address = URL.createObjectURL(new Blob([text]));
  make("a", { href: address, download: name }).click();
  URL.revokeObjectURL(address);
}

// ---- Tabs and keys.

function openTab(name) {
  chosen.tab = name;
  const plans = !state.chosen || state.chosen.policies; // else it follows a rover, which has its own program
  const panels = [...at("panels").children].filter((panel) => plans || ["Drive", "Ground"].includes(panel.dataset.tab));
  for (const panel of at("panels").children) panel.toggleAttribute("data-open", panel.dataset.tab === name);
  fill("tabs", panels.map((panel) => make("button", {
    role: "tab", "aria-selected": String(panel.dataset.tab === name), onclick: () => openTab(panel.dataset.tab) }, panel.dataset.tab)));
}

// Space and arrows belong to the drive, unless a control was reached by the keyboard.
document.addEventListener("keydown", (event) => {
  const target = event.target, question = state.scene?.keys[event.code?.toLowerCase()];
  const typed = target.matches("input, select, summary") || target.matches("button:focus-visible");
  if (!question || typed || event.ctrlKey || event.altKey) return;
  event.preventDefault();
  target.blur();
  ask(question);
});
function release() {
  clearTimeout(pressed);
  pressed = 0;
  draw();
}
document.addEventListener("pointerdown", (event) => {
  if (event.target.closest("button, [tabindex], tbody")) pressed = setTimeout(release, PRESS);
});
for (const end of ["pointerup", "pointercancel"]) document.addEventListener(end, () => setTimeout(release));
document.addEventListener("click", (event) => {
  const pushed = event.target.closest("button");
  if (pushed?.dataset.ask) ask(JSON.parse(pushed.dataset.ask));
  if (event.detail > 0) pushed?.blur(); // pressed with the pointer
});
at("time").addEventListener("input", () => ask({ ask: "seek", time: Number(at("time").value) }));

openTab(chosen.tab);
const told = at("told");
if (told) {
  document.body.className = "sent";
  take(JSON.parse(told.textContent));
} else connect();
