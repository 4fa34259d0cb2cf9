// The page: shows frames, sends what hands do. Everything that is computed is computed by the server.
const $ = (id) => document.getElementById(id);
const panes = ["volume", "axial", "coronal", "sagittal"];
const pictures = {}; // of each pane: a bitmap
// What is shown: a scan while it is opened, then frames, which can be worked on.
let shown = null, figures = null, drives = false, mayDrive = false, socket = null, lock = null, press = null, wanted = null, pointed = false, early = 0;

const send = (request) => {
  if (socket?.readyState === WebSocket.OPEN) socket.send(JSON.stringify(request));
};
const tool = () => document.querySelector("input[name=tool]:checked").value;

// ---------------------------------------------------------------- the connection
function connect() {
  const token = location.hash.slice(1);
  socket = new WebSocket(`ws://${location.host}/socket`);
  socket.binaryType = "arraybuffer";
  socket.onopen = () => socket.send(JSON.stringify({ token }));
  socket.onmessage = ({ data }) => (typeof data === "string" ? heard(JSON.parse(data)) : received(data));
  socket.onclose = () => { status("The connection is gone: is ivd serve still running? Reload the page to try again."); };
}

function heard(word) {
  switch (word.kind) {
    case "hello":
      mayDrive = word.may_drive;
      if (mayDrive) { send({ do: "take" }); resized(); }
      break;
    case "note": {
      const item = document.createElement("li");
      item.textContent = word.text;
      $("notes").append(item);
      if (!figures) status(word.text);
      break;
    }
    case "wheel":
      drives = word.drives;
      $("driving").textContent = drives ? "you drive" : mayDrive ? (word.free ? "free" : "somebody else drives") : "you watch";
      $("take").disabled = drives || !mayDrive;
      $("hand").disabled = !drives;
      if (drives) resized();
      break;
    default: complain(word.text);
  }
}

async function received(data) {
  const length = new DataView(data).getUint32(0, true);
  const head = JSON.parse(new TextDecoder().decode(new Uint8Array(data, 4, length)));
  let at = 4 + length;
  if (head.kind === "file") {
    const link = document.createElement("a");
    link.href = URL.createObjectURL(new Blob([new Uint8Array(data, at, head.bytes)]));
    link.download = head.name;
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 10000);
    return;
  }
  const made = head.pictures.map((picture) => {
    const bytes = new Uint8Array(data, at, picture.bytes);
    at += picture.bytes;
    return createImageBitmap(new Blob([bytes], { type: "image/png" })).then((bitmap) => ({ ...picture, bitmap }));
  });
  // Scans come before the first frame.
  const number = head.number ?? (early += 1e-6);
  for (const picture of await Promise.all(made)) {
    const before = pictures[picture.pane];
    // Bitmaps are made side by side: an older one may come last.
    if (before && before.frame > number) { picture.bitmap.close(); continue; }
    before?.bitmap.close();
    pictures[picture.pane] = { ...picture, frame: number };
  }
  if (head.kind === "scan") {
    if (!figures && number > (shown?.number ?? 0)) shown = { ...head.figures, handles: [], pins: [], number };
    draw();
    return;
  }
  if (!figures || number >= figures.number) shown = figures = { ...head.figures, number };
  $("save").querySelector("[value=labels]").disabled = figures.shown_by !== "labels";
  document.body.dataset.frame = figures.number;
  draw();
  tell();
}

// ---------------------------------------------------------------- what is said
const status = (text) => { $("status").textContent = text; };
let complaint = 0, refused = false;
// `instead`: by which map it might be followed; that offer stays until it is taken, or something is followed.
function complain(text, instead) {
  const offered = [...$("map").options].find((one) => one.value === instead);
  $("why").textContent = text;
  $("instead").hidden = !offered;
  if (offered) Object.assign($("instead"), { value: instead, textContent: `Follow ${offered.text}` });
  $("problem").hidden = false;
  clearTimeout(complaint);
  if (!offered) complaint = setTimeout(() => { $("problem").hidden = true; }, 8000);
}
const few = (x, digits = 2) => (x == null ? "–" : Number(x).toFixed(digits));
const milli = (s) => `${Math.round(1000 * s)} ms`;

function tell() {
  const f = figures, [solve, map, warp] = f.times;
  const h = f.hovered;
  const parts = [h ? `${few(h.value)} at ${h.place.map((c) => few(c, 1)).join(", ")} mm` : null, `largest motion ${few(f.largest_mm)} mm`, `every voxel keeps at least ${few(Math.floor(1000 * f.min_det_j) / 10, 1)} % of its volume`, `${f.vertices} vertices at level ${f.level}`,
    f.cut_off_mm > 0.05 ? `cut off at the scan's edge: the surface goes ${few(f.cut_off_mm, 1)} mm beyond` : null,
    `lattice ${milli(solve)}, map ${milli(map)}, voxels ${milli(warp)}, picture ${milli(f.draw_s)}`];
  status(parts.filter(Boolean).join(" · "));
  // What was refused is past once something is followed.
  if (!f.refused && refused) $("problem").hidden = true;
  refused = Boolean(f.refused);
  if (f.refused) complain(`${f.refused.ahead_mm > 0 ? `The hand is ${few(f.refused.ahead_mm, 1)} mm ahead: ` : ""}${f.refused.why}`, f.refused.instead !== f.map && f.refused.instead);
  $("problem").title = f.refused?.exactly ?? "";
  $("undo").disabled = !f.undo; $("undo").title = f.undo ? `Undo: ${f.undo}` : "";
  $("redo").disabled = !f.redo; $("redo").title = f.redo ? `Redo: ${f.redo}` : "";
  for (const key of ["radius", "stiffness", "level", "map"]) {
    if (document.activeElement !== $(key)) $(key).value = key === "radius" ? Number(f[key].toPrecision(4)) : f[key];
  }
  if (document.activeElement !== $("cut")) $("cut").value = f.cut ?? "";
  $("depth").disabled = !f.depth;
  if (document.activeElement !== $("depth")) $("depth").value = f.depth ?? "";
  if (document.activeElement !== $("compare")) $("compare").value = f.compare.shows;
  listHandles();
}

// The slices meet at a handle.
function goTo(id) {
  const one = figures?.handles.find((handle) => handle.id === id);
  if (!one) return;
  now({ do: "cross", pane: "axial", at: one.at[1] });
  now({ do: "cross", pane: "coronal", at: one.at[2] });
}

function listHandles() {
  const body = $("handles"), there = new Set(figures.handles.map((one) => `handle-${one.id}`));
  for (const row of [...body.children]) if (!there.has(row.id)) row.remove();
  for (const one of figures.handles) {
    let row = $(`handle-${one.id}`);
    if (!row) {
      row = document.createElement("tr");
      row.id = `handle-${one.id}`;
      const number = document.createElement("td");
      const go = Object.assign(document.createElement("button"), { textContent: one.id, title: "Slices go there" });
      go.setAttribute("aria-label", `Go to handle ${one.id}`);
      go.addEventListener("click", () => goTo(one.id));
      number.append(go);
      row.append(number);
      for (const axis of ["x", "y", "z"]) {
        const input = Object.assign(document.createElement("input"), { type: "number", step: "any" });
        input.setAttribute("aria-label", `Handle ${one.id}: ${axis}, ${one.with ? "mN" : "mm from rest"}`);
        input.addEventListener("change", () => {
          // What it shows from here on is what is.
          input.blur();
          const told = [...row.querySelectorAll("input")].map((field) => Number(field.value));
          send(row.dataset.does === "pull" ? { do: "pull", handle: one.id, with: told } : { do: "move", handle: one.id, by: told });
        });
        const cell = document.createElement("td");
        cell.append(input);
        row.append(cell);
      }
      const remove = Object.assign(document.createElement("button"), { textContent: "×" });
      remove.setAttribute("aria-label", `Remove handle ${one.id}`);
      remove.addEventListener("click", () => send({ do: "remove", handle: one.id }));
      const cell = document.createElement("td");
      cell.append(remove);
      row.append(cell);
      body.append(row);
    }
    row.dataset.does = one.with ? "pull" : "move";
    row.className = figures.held === one.id ? "held" : "";
    row.querySelectorAll("input").forEach((field, a) => {
      if (document.activeElement !== field) field.value = Number((one.with ?? one.by)[a].toFixed(3));
    });
  }
  listParts();
  const pins = JSON.stringify(figures.pins.map((pin) => [pin.id, pin.rest, pin.radius]));
  // Made anew only where they change: what has the keyboard's focus keeps it.
  if ($("pins").dataset.pins === pins) return;
  $("pins").dataset.pins = pins;
  $("pins").replaceChildren(...figures.pins.map((pin) => {
    const item = document.createElement("li");
    const release = Object.assign(document.createElement("button"), { textContent: "×" });
    release.setAttribute("aria-label", `Release pin ${pin.id}`);
    release.addEventListener("click", () => send({ do: "release", fix: pin.id }));
    item.append(`pin ${pin.id}: ${few(pin.radius, 1)} mm about ${pin.rest.map((c) => few(c, 1)).join(", ")} `, release);
    return item;
  }));
}

// The cut, other steps in space, planes and boxes that clip: what each is, and how to be rid of it.
function listParts() {
  const cut = figures.incision;
  const all = figures.space.map((id) => id === cut?.id
    ? { text: `cut of ${few(2 * cut.radius, 1)} mm, its lips ${few(cut.open, 1)} mm apart`, name: "Close the cut", request: { do: "close", space: id } }
    : { text: `step in space ${id}`, name: `Remove step ${id}`, request: { do: "close", space: id } });
  for (const { id, part } of figures.clips) {
    const what = part.box ? "box" : "plane";
    all.push({ text: `${what} ${id} that clips`, name: `Take ${what} ${id} away`, request: { do: "unclip", clip: id } });
  }
  for (const one of figures.rulers) {
    all.push({ text: `ruler ${one.id}: ${measured(one).join(", ")}, ${one.now.map((at) => at.map((c) => few(c, 1)).join(", ")).join(" – ")} mm`, name: `Remove ruler ${one.id}`, request: { do: "unmeasure", ruler: one.id } });
  }
  const parts = JSON.stringify(all);
  if ($("parts").dataset.parts === parts) return;
  $("parts").dataset.parts = parts;
  $("parts").replaceChildren(...all.map(({ text, name, request }) => {
    const item = document.createElement("li");
    const remove = Object.assign(document.createElement("button"), { textContent: "×", title: name });
    remove.setAttribute("aria-label", name);
    remove.addEventListener("click", () => send(request));
    item.append(`${text} `, remove);
    return item;
  }));
}

// ---------------------------------------------------------------- pictures
// Where the picture lies in a canvas: x, y, width, height, in pixels of the canvas.
function room(name, canvas) {
  if (name === "volume" || !shown) {
    const [w, h] = shown?.size ?? [1, 1];
    return fitted(canvas, w / h);
  }
  const slice = shown.slices.find((one) => one.pane === name);
  return fitted(canvas, slice.extent_mm[0] / slice.extent_mm[1]);
}
function fitted(canvas, ratio) {
  const width = Math.min(canvas.width, canvas.height * ratio), height = width / ratio;
  return [(canvas.width - width) / 2, (canvas.height - height) / 2, width, height];
}
// As sharp as the screen, but not beyond what is drawn.
function sized(canvas) {
  const scale = Math.min(devicePixelRatio || 1, 2);
  const [w, h] = [canvas.clientWidth, canvas.clientHeight].map((n) => Math.max(1, Math.round(n * scale)));
  if (canvas.width !== w || canvas.height !== h) { canvas.width = w; canvas.height = h; }
}

function draw() {
  panes.forEach((name, number) => {
    const canvas = $(name), context = canvas.getContext("2d"), picture = pictures[name];
    sized(canvas);
    context.fillStyle = "#000";
    context.fillRect(0, 0, canvas.width, canvas.height);
    if (!picture || !shown) return;
    const [x, y, w, h] = room(name, canvas);
    context.imageSmoothingEnabled = true;
    context.imageSmoothingQuality = "high";
    context.drawImage(picture.bitmap, x, y, w, h);
    const place = (at) => at && [x + at[0] * w, y + at[1] * h];
    const mm = name === "volume" ? shown.width_mm : shown.slices[number - 1].extent_mm[0];
    over(context, name, number, place, w / mm, canvas);
  });
}

function over(context, name, number, place, scale, canvas) {
  const unit = canvas.width / canvas.clientWidth || 1;
  context.lineWidth = unit;
  context.font = `${12 * unit}px system-ui, sans-serif`;
  const cross = place(shown.cross_at[number]);
  if (cross && name !== "volume") {
    context.strokeStyle = "#5fd0a0aa";
    context.beginPath();
    context.moveTo(0, cross[1]); context.lineTo(canvas.width, cross[1]);
    context.moveTo(cross[0], 0); context.lineTo(cross[0], canvas.height);
    context.stroke();
  }
  const ring = (at, radius, colour, width = 1) => {
    context.strokeStyle = colour; context.lineWidth = width * unit;
    context.beginPath(); context.arc(at[0], at[1], Math.max(radius, 1), 0, 7); context.stroke();
  };
  // What doesn't lie in a slice, or is hidden in the volume, is faint there.
  const near = (spot) => { context.globalAlpha = spot.beside[number] ? 0.4 : 1; };
  // What a slice doesn't reach, and what lies further behind, isn't shown.
  for (const pin of shown.pins) {
    const at = pin.seen[number] ? place(pin.at[number]) : null;
    near(pin);
    if (at) { ring(at, 5 * unit, "#6cb6ff", 2); ring(at, pin.radius * scale, "#6cb6ff55"); }
  }
  for (const one of shown.handles) {
    const at = one.seen[number] || shown.held === one.id ? place(one.at[number]) : null;
    if (!at) continue;
    near(one);
    const held = shown.held === one.id || (pointed && shown.hovered?.handle === one.id);
    ring(at, 6 * unit, held ? "#ffd479" : "#ffb454", held ? 3 : 2);
    if (held) ring(at, one.radius * scale, "#ffb45488");
    context.fillStyle = "#ffb454";
    context.fillText(one.id, at[0] + 8 * unit, at[1] - 8 * unit);
  }
  context.globalAlpha = 1;
  // The vertex that a new handle would take, which may lie away from the pointer.
  const hovered = pointed ? shown.hovered : null;
  const vertex = hovered && hovered.handle == null && shown.held == null && tool() === "handle" ? place(hovered.vertex_at[number]) : null;
  if (vertex) {
    const at = hovered.pane === name ? place(hovered.at[number]) : null;
    if (at) { context.strokeStyle = "#ffffff55"; context.lineWidth = unit; context.beginPath(); context.moveTo(...at); context.lineTo(...vertex); context.stroke(); }
    ring(vertex, 3 * unit, "#fff"); ring(vertex, shown.radius * scale, "#ffffff55");
  }
  // The mouth of the cut while another may be drawn; the line that is drawn, with its length.
  const drawn = ["incise", "measure"].includes(press?.does) && press.name === name ? [press.first, press.at] : null;
  const mouth = drawn ?? (number && tool() === "incise" ? shown.incision?.at[number] : null);
  if (mouth) {
    const [from, to] = mouth.map(place);
    context.strokeStyle = context.fillStyle = "#f5f5f5"; context.lineWidth = 2 * unit;
    context.setLineDash(drawn ? [] : [5 * unit, 4 * unit]);
    context.beginPath(); context.moveTo(...from); context.lineTo(...to); context.stroke();
    context.setLineDash([]);
    // Between two places of the volume a ruler goes into depth, too.
    if (drawn && (number || press.does === "incise")) context.fillText(`${few(Math.hypot(to[0] - from[0], to[1] - from[1]) / scale, 0)} mm`, to[0] + 10 * unit, to[1] - 8 * unit);
  }
  rulers(context, number, place, unit);
  states(context, place, unit, canvas);
  context.fillStyle = "#dde";
  const letters = name === "volume" ? shown.letters : shown.slices[number - 1].letters;
  if (letters) {
    const [left, right, top, bottom] = letters;
    context.textBaseline = "middle";
    context.fillText(left, 4 * unit, canvas.height / 2);
    context.fillText(right, canvas.width - 14 * unit, canvas.height / 2);
    context.fillText(top, canvas.width / 2, 10 * unit);
    context.fillText(bottom, canvas.width / 2, canvas.height - 10 * unit);
    context.textBaseline = "alphabetic";
  }
  if (name !== "volume") {
    const slice = shown.slices[number - 1];
    context.fillText(`${slice.slice + 1} / ${slice.slices}${slice.oblique ? ` · oblique by ${Math.round(slice.oblique)}°` : ""}${slice.clipped ? " · clipped" : ""}`, 6 * unit, canvas.height - 8 * unit);
  }
  // A bar of a round length.
  const most = (0.25 * canvas.width) / scale, power = 10 ** Math.floor(Math.log10(most));
  const length = [5, 2, 1].map((n) => n * power).find((n) => n <= most) ?? power;
  const end = canvas.width - 10 * unit, line = canvas.height - 10 * unit;
  context.fillRect(end - length * scale, line, length * scale, 2 * unit);
  const label = `${Number(length.toPrecision(1))} mm`;
  context.fillText(label, end - context.measureText(label).width, line - 4 * unit);
}

// The lengths of a ruler and its angle, as they are and where they differ as they were at rest.
function measured(one) {
  const told = (now, rest, unit) => {
    const [a, b] = [now, rest].map((n) => few(n, 1) + unit);
    return figures.compare.shows === "rest" ? b : a === b ? a : `${a} (at rest ${b})`;
  };
  const all = one.mm.map((length, leg) => told(length, one.rest_mm[leg], " mm"));
  return one.degrees == null ? all : [...all, told(one.degrees, one.rest_degrees, "°")];
}
function rulers(context, number, place, unit) {
  context.strokeStyle = context.fillStyle = "#bef06e";
  for (const one of shown.rulers ?? []) {
    const ends = one.at.map((at) => place(at[number]));
    if (!ends.every(Boolean)) continue;
    // What doesn't lie in a slice, or is hidden in the volume, is faint there, without its numbers.
    const faint = one.beside[number];
    context.globalAlpha = faint ? 0.3 : 1;
    context.lineWidth = 1.5 * unit;
    context.beginPath(); ends.forEach((end, i) => (i ? context.lineTo(...end) : context.moveTo(...end))); context.stroke();
    if (faint) continue;
    const told = measured(one);
    for (let leg = 0; leg < one.mm.length; leg++) {
      const [a, b] = [ends[leg], ends[leg + 1]];
      context.fillText(told[leg], (a[0] + b[0]) / 2 + 6 * unit, (a[1] + b[1]) / 2 - 4 * unit);
    }
    if (told[2]) context.fillText(told[2], ends[1][0] + 8 * unit, ends[1][1] + 16 * unit);
  }
  context.globalAlpha = 1;
}
// Says where the body is shown at rest, and draws the line that divides both.
function states(context, place, unit, canvas) {
  const compare = shown.compare;
  context.fillStyle = context.strokeStyle = "#f0a0dc";
  if (compare?.shows === "rest") context.fillText("at rest", 6 * unit, 34 * unit);
  if (compare?.shows !== "both") return;
  const [top, foot] = [place([compare.at, 0]), place([compare.at, 1])];
  context.lineWidth = 2 * unit;
  context.beginPath(); context.moveTo(...top); context.lineTo(...foot); context.stroke();
  const low = Math.min(foot[1], canvas.height) - 24 * unit;
  context.fillText("at rest", foot[0] - context.measureText("at rest").width - 8 * unit, low);
  context.fillText("deformed", foot[0] + 8 * unit, low);
}
// The line is taken hold of from a few pixels away.
function atLine(at, name, canvas) {
  const [, , width] = room(name, canvas), unit = canvas.width / canvas.clientWidth || 1;
  return figures?.compare.shows === "both" && Math.abs(at[0] - figures.compare.at) * width <= 6 * unit;
}
function compare(shows) {
  if (figures) now({ do: "compare", shows: figures.compare.shows === shows ? "now" : shows, at: figures.compare.at });
}

let resizing = 0;
function resized() {
  draw();
  clearTimeout(resizing);
  resizing = setTimeout(() => {
    const { width, height } = $("volume");
    // A picture of half a million pixels is drawn soon enough; more are left to the screen.
    const scale = Math.min(1, Math.sqrt(512 * 512 / (width * height)));
    const size = [width, height].map((n) => Math.min(2048, Math.max(32, Math.round(n * scale))));
    if (drives) send({ do: "resize", size });
  }, 150);
}
addEventListener("resize", resized);

// ---------------------------------------------------------------- hands
// The place of a pointer as shares of the picture, the same pane's however far the pointer goes.
function share(event, name) {
  const canvas = $(name), box = canvas.getBoundingClientRect(), [x, y, w, h] = room(name, canvas);
  const scale = canvas.width / box.width;
  return [((event.clientX - box.left) * scale - x) / w, ((event.clientY - box.top) * scale - y) / h];
}
// The same place, no further than requests may name.
function named(at) { return at.map((c) => Math.min(2, Math.max(-1, c))); }
// What is wanted by the next picture of the screen; of many moves the last.
function flush() {
  const all = wanted ?? [];
  wanted = null;
  all.forEach(send);
}
// What ends something doesn't wait: a page that isn't seen has no next picture.
function now(request) { flush(); send(request); }
function soon(request, merge) {
  if (!wanted) requestAnimationFrame(flush);
  wanted ??= [];
  const last = wanted.at(-1);
  if (last && last.do === request.do && merge) merge(last, request); else wanted.push(request);
}
const sum = (last, next) => { last.by = last.by.map((c, a) => c + next.by[a]); };
const newest = (last, next) => Object.assign(last, next);

for (const name of panes) {
  const canvas = $(name);
  canvas.addEventListener("contextmenu", (event) => event.preventDefault());
  canvas.addEventListener("pointerdown", (event) => {
    if (!drives || !shown) { if (mayDrive && !drives) send({ do: "take" }); return; }
    if (press) return;
    canvas.focus();
    canvas.setPointerCapture(event.pointerId);
    const at = share(event, name);
    let does = event.button === 1 || (event.button === 0 && event.shiftKey) ? "pan" : event.button === 2 ? "zoom" : tool();
    if (does === "turn" && name !== "volume") does = "cross";
    if (event.button === 0 && !event.shiftKey && atLine(at, name, canvas)) does = "divide";
    // Until it can be moved it can be looked at.
    if (!figures && !["turn", "pan", "zoom", "cross"].includes(does)) return;
    press = { name, does, at, first: at, pointer: event.pointerId };
    if (does === "handle") now({ do: "grab", pane: name, at });
    if (does === "pin") now({ do: "pin", pane: name, at });
    if (does === "cross") now({ do: "cross", pane: name, at });
  });
  canvas.addEventListener("pointerenter", () => { pointed = true; });
  canvas.addEventListener("pointerleave", () => { pointed = false; draw(); });
  canvas.addEventListener("pointermove", (event) => {
    if (!drives || !shown || (press && press.pointer !== event.pointerId)) return;
    const at = share(event, name);
    if (!press) {
      if (at.every((c) => c >= 0 && c <= 1)) soon({ do: "hover", pane: name, at }, newest);
      return;
    }
    const by = at.map((c, a) => c - press.at[a]);
    press.at = at;
    const within = named(at);
    switch (press.does) {
      case "turn": return soon({ do: "orbit", by }, sum);
      case "pan": return name === "volume" && soon({ do: "pan", by }, sum);
      case "zoom": return name === "volume" && soon({ do: "zoom", factor: Math.exp(-3 * by[1]), at: press.first });
      case "cross": return soon({ do: "cross", pane: name, at: within }, newest);
      case "window": return soon({ do: name === "volume" ? "transfer" : "window", by }, sum);
      case "divide": return soon({ do: "compare", shows: "both", at: Math.min(1, Math.max(0, at[0])) }, newest);
      case "handle": return soon({ do: "drag", to: within, lock }, newest);
      case "measure":
      case "incise": return draw();
    }
  });
  const released = (event) => {
    if (press && press.pointer !== event.pointerId) return;
    if (press?.does === "handle") {
      now({ do: "drop" });
      // Seen from outside alone it would not be seen in any slice.
      if (name === "volume" && figures.held != null) goTo(figures.held);
    }
    if (press?.does === "incise") {
      const [from, to] = [press.first, press.at].map(named);
      now({ do: "stroke", pane: name, from, to });
    }
    if (press?.does === "measure") {
      const [from, to] = [press.first, press.at].map(named);
      now({ do: "measure", pane: name, from, to });
    }
    press = null; lock = null;
    draw();
  };
  canvas.addEventListener("pointerup", released);
  canvas.addEventListener("pointercancel", () => { if (press?.does === "handle") now({ do: "abandon" }); press = null; lock = null; draw(); });
  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    if (!drives || !shown) return;
    const steps = Math.sign(event.deltaY);
    const at = share(event, name);
    if (press?.does === "handle" || (tool() === "handle" && shown.hovered?.handle != null)) return soon({ do: "wheel", steps: -steps });
    if (name === "volume") return soon({ do: "zoom", factor: 1.15 ** -steps, at });
    soon({ do: "slice", pane: name, steps: -steps });
  }, { passive: false });
  canvas.addEventListener("keydown", (event) => {
    const ways = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, -1], ArrowDown: [0, 1] }[event.key];
    if (!ways) return;
    event.preventDefault();
    if (name === "volume") soon({ do: "orbit", by: ways.map((c) => c / 36) }, sum);
    else soon({ do: "slice", pane: name, steps: ways[0] - ways[1] });
  });
}

addEventListener("keydown", (event) => {
  const typing = /INPUT|SELECT/.test(document.activeElement?.tagName ?? "") && document.activeElement.type !== "radio";
  if (event.key === "Escape") {
    if (press?.does === "handle") { wanted = wanted?.filter((one) => one.do !== "drag") ?? null; now({ do: "abandon" }); }
    else if (!press && drives && !typing && $("keys").hidden) now({ do: "stop" });
    press = null;
    draw();
    if (!$("keys").hidden) $("help").click();
    return;
  }
  const key = event.key.toLowerCase();
  if ((event.ctrlKey || event.metaKey) && (key === "z" || key === "y")) {
    if (typing) return;
    event.preventDefault();
    now({ do: event.shiftKey || key === "y" ? "redo" : "undo" });
    return;
  }
  if (typing || event.ctrlKey || event.metaKey || event.altKey) return;
  if (press?.does === "handle" && "xyzn".includes(key)) {
    if (event.repeat) return;
    lock = lock === key ? null : key;
    if (press.at[0] === press.first[0] && press.at[1] === press.first[1]) return;
    return soon({ do: "drag", to: named(press.at), lock }, newest);
  }
  const tools = { t: "turn", h: "handle", p: "pin", i: "incise", m: "measure", b: "window" };
  if (tools[key]) document.querySelector(`input[name=tool][value=${tools[key]}]`).checked = true;
  const sides = { 1: "front", 3: "left", 7: "top" };
  if (sides[key]) now({ do: "look", side: sides[key] });
  if (key === "0") now({ do: "reset_view" });
  if (key === "o") compare("rest");
  if (key === "w") compare("both");
  if (event.key === "?") $("help").click();
  draw();
});

// ---------------------------------------------------------------- buttons and fields
const clicks = { stop: { do: "stop" }, undo: { do: "undo" }, redo: { do: "redo" }, reset: { do: "reset" }, home: { do: "reset_view" }, colours: { do: "reset_colours" },
  take: { do: "take" }, hand: { do: "hand_over" } };
for (const [id, request] of Object.entries(clicks)) $(id).addEventListener("click", () => send(request));
$("help").addEventListener("click", () => {
  $("keys").hidden = !$("keys").hidden;
  $("help").setAttribute("aria-expanded", String(!$("keys").hidden));
});
$("tools").addEventListener("change", draw);
const number = (id, request) => $(id).addEventListener("change", () => {
  $(id).blur();
  const value = Number($(id).value);
  if ($(id).value !== "" && Number.isFinite(value)) send(request(value));
});
number("radius", (radius) => ({ do: "radius", handle: figures?.held ?? null, radius }));
number("stiffness", (stiffness) => ({ do: "stiffness", stiffness }));
number("level", (level) => ({ do: "level", level: Math.min(255, Math.max(0, Math.round(level))) }));
$("depth").addEventListener("change", () => send({ do: "depth", weight: $("depth").value }));
$("compare").addEventListener("change", () => send({ do: "compare", shows: $("compare").value, at: figures?.compare.at ?? 0.5 }));
$("cut").addEventListener("change", () => send({ do: "cut", along: $("cut").value || null }));
$("map").addEventListener("change", () => send({ do: "map", map: $("map").value }));
$("instead").addEventListener("click", () => { $("problem").hidden = true; send({ do: "map", map: $("instead").value }); });
const chosen = (id, request) => $(id).addEventListener("change", () => {
  if ($(id).value) send(request($(id).value));
  $(id).value = "";
});
chosen("side", (side) => ({ do: "look", side }));
chosen("save", (what) => ({ do: "save", what }));
$("new").addEventListener("submit", (event) => {
  event.preventDefault();
  const place = $("place").value.split(",").map(Number);
  if (place.length !== 3 || !place.every(Number.isFinite)) return complain("A place is three numbers, x, y, z, in mm.");
  send({ do: "add", place, by: [0, 0, 0] });
});

connect();
