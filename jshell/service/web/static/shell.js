// The shell as the simulator sees it: its outline while the sliders move, its modes in motion, the film of a run.
(() => {
  "use strict";
  const calm = window.matchMedia("(prefers-reduced-motion: reduce)").matches;
  const SWING = 0.15, PERIOD = 1.4; // largest displacement drawn [R0]; seconds of the slowest mode's period
  const LATER = 3000; // milliseconds until a question that was not answered is asked again
  const BUSY = [429, 503]; // answers that say so
  const number = (x, digits = 4) => (x === null || x === undefined ? "–" : Number(x.toPrecision(digits)).toString().replace("-", "−"));

  // a closed curve: the half from pole to pole, and its mirror image; the buckling pole is to the right
  function outline(x, r) {
    const points = x.map((at, k) => [at, r[k]]);
    const whole = points.concat(points.slice(1, -1).reverse().map(([at, off]) => [at, -off]));
    return "M" + whole.map(([at, off]) => `${at.toFixed(4)} ${(-off).toFixed(4)}`).join("L") + "Z";
  }
  function put(svg, x, r, thickness) {
    const wall = svg.querySelector(".wall");
    const there = x.every((at) => at !== null);
    wall.setAttribute("d", there ? outline(x, r) : "");
    wall.setAttribute("stroke-width", thickness);
  }

  function page(card) {
    const form = card.closest("form"), svg = card.querySelector("svg"), words = card.querySelector("#shell-words");
    const rows = card.querySelector("tbody"), later = card.querySelector("#shell-exact"), button = card.querySelector("#play");
    let found = null, exact = null, asking = false, again = false, quiet = 0, started = 0, playing = false;

    const chosen = () => Number(card.querySelector("input[name=shown]:checked").value);
    const asked = () => {
      const fields = new FormData(form);
      fields.delete("shown");
      return new URLSearchParams(fields);
    };
    function paint(now) {
      if (!found) return;
      const mode = found.modes[chosen()];
      let x = found.x, r = found.r;
      if (mode && mode.outcome === "ok" && mode.way[0][0] !== null && x[0] !== null) {
        const phase = playing ? ((now - started) / 1000 / PERIOD) * 2 * Math.PI * (mode.omega / found.modes[0].omega) : 0;
        const c = SWING * Math.cos(phase), s = SWING * Math.sin(phase), [dx, dr, ix, ir] = mode.way;
        x = x.map((at, k) => at + c * dx[k] - s * ix[k]);
        r = r.map((off, k) => off + c * dr[k] - s * ir[k]);
      }
      put(svg, x, r, found.thickness);
    }
    function frame(now) {
      paint(now);
      if (playing) requestAnimationFrame(frame);
    }
    function play(on) {
      playing = on;
      button.textContent = on ? "Stop" : "Move";
      button.setAttribute("aria-pressed", String(on));
      started = performance.now();
      requestAnimationFrame(frame);
    }
    function report() {
      const load = found.short.load;
      const where = load ? ` P̂ₑₓₜ is ${number(asked().get("Pext_hat") / load, 3)} of the load at which the short model's sphere buckles.` : "";
      words.textContent = found.outcome === "ok"
        ? `V/V₀ = ${number(found.volume_ratio)}, pressure inside ${number(found.pressure)}, gap between the poles ${number(found.gap, 3)} R₀, lowest stiffness ${number(found.stability, 3)} E d.${where}`
        : `${found.outcome}: ${found.advice}.${where}`;
      rows.replaceChildren(...found.modes.map((mode, k) => {
        const row = document.createElement("tr"), head = document.createElement("th");
        head.scope = "row";
        head.textContent = String(k + 1);
        const short = k < 2 ? `${number(found.short.omega[k])}, ${number(found.short.tau)}` : "–";
        const full = exact && exact.modes[k] ? `${number(exact.modes[k].omega)}, ${number(exact.modes[k].tau)}` : k < 2 ? "…" : "–";
        row.append(head, ...["0", number(mode.omega), number(mode.tau), short, full].map((text) => {
          const cell = document.createElement("td");
          cell.className = "number";
          cell.textContent = text;
          return cell;
        }));
        return row;
      }));
      if (!exact) later.textContent = "In a layer to second order; the exact liquid, and whether the shape is round, follow.";
      else if (exact.verdict) {
        const around = exact.around.map((row) => row.growth !== null
          ? `m = ${row.azimuth} grows at rate ${number(row.growth, 3)}` : `m = ${row.azimuth}: ω ${number(row.omega)}, τ ${number(row.tau)}`);
        later.textContent = `Symmetry: ${exact.verdict} (orders 1 to 16). Slowest vibrations out of round, which V and S do not see: ${around.join("; ")}.`;
      }
      else later.textContent = "Whether the shape is round is not asked here.";
    }
    async function get(what, query) {
      const answer = await fetch(`${card.dataset.src}/${what}?${query}`, { headers: { accept: "application/json" } });
      if (answer.ok) return answer.json();
      return BUSY.includes(answer.status) ? undefined : null;
    }
    // one question at a time; what moved meanwhile is asked next
    async function ask() {
      if (asking) { again = true; return; }
      asking = true;
      exact = null;
      clearTimeout(quiet);
      const query = asked();
      const got = await get("shape", query).catch(() => undefined);
      asking = false;
      if (got) {
        found = got;
        card.dataset.drawn = query.toString();
        report();
        if (!playing) paint(0);
      }
      if (again) { again = false; ask(); }
      else if (got === undefined) quiet = setTimeout(ask, LATER); // busy, or just started and compiling
      else quiet = setTimeout(async () => {
        const full = await get("exact", query).catch(() => undefined);
        if (query.toString() !== asked().toString()) return;
        if (full) { exact = full; report(); }
        else if (full === undefined) quiet = setTimeout(ask, LATER);
      }, 500);
    }
    form.addEventListener("input", ask);
    // what is shown moves nothing of the model
    card.addEventListener("input", (event) => { event.stopPropagation(); started = performance.now(); paint(started); });
    card.addEventListener("change", (event) => event.stopPropagation());
    button.addEventListener("click", () => play(!playing));
    ask();
    if (!calm) play(true);
  }

  async function film(box) {
    if (box.dataset.loaded) return;
    box.dataset.loaded = "yes";
    const answer = await fetch(box.dataset.src).catch(() => null);
    if (!answer || !answer.ok) return;
    const run = await answer.json(), svg = box.querySelector("svg"), slider = box.querySelector("input"), button = box.querySelector("button"), said = box.querySelector(".number");
    let playing = 0;
    slider.max = String(run.t.length - 1);
    const show = () => {
      const k = Number(slider.value);
      put(svg, run.x[k], run.r[k], run.thickness);
      const text = `t = ${run.t[k].toFixed(2)}, V/V₀ = ${(run.V[k] / 4.18879).toFixed(3)}, P̂ₑₓₜ = ${run.P_ext[k].toFixed(3)}`;
      said.textContent = text;
      slider.setAttribute("aria-valuetext", text);
    };
    const stop = () => { clearInterval(playing); playing = 0; button.textContent = "Play"; button.setAttribute("aria-pressed", "false"); };
    button.addEventListener("click", () => {
      if (playing) { stop(); return; }
      if (slider.value === slider.max) slider.value = "0";
      button.textContent = "Stop";
      button.setAttribute("aria-pressed", "true");
      playing = setInterval(() => { slider.value = String(Number(slider.value) + 1); show(); if (slider.value === slider.max) stop(); }, 50);
    });
    slider.addEventListener("input", () => { stop(); show(); });
    show();
  }

  const begin = () => {
    const card = document.getElementById("shell"), box = document.getElementById("frames");
    if (card && !card.dataset.begun) { card.dataset.begun = "yes"; page(card); }
    if (box) film(box);
  };
  document.addEventListener("htmx:after:swap", begin);
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", begin);
  else begin();
})();
