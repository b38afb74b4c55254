// What the page does beyond forms and links: it draws curves, moves sliders, copies text. All of it may be missing.
(() => {
  "use strict";
  const root = document.documentElement;
  root.classList.add("js");

  // the window that is fitted: the form's two fields, which a drag across a curve fills
  const ends = () => ["start", "stop"].map((name) => document.querySelector(`#fit input[name=${name}]`));
  function choose(low, high) {
    const fields = ends();
    [low, high].forEach((at, k) => { fields[k].value = at === null ? "" : String(Number(at.toPrecision(5))); });
    fields[1].dispatchEvent(new Event("change", { bubbles: true }));
  }
  function leftOut(u) {
    const [low, high] = ends().map((field, k) => {
      const at = parseFloat(field.value.replace(",", "."));
      return Number.isFinite(at) ? u.valToPos(at, "x", true) : k ? u.bbox.left + u.bbox.width : u.bbox.left;
    });
    u.ctx.save();
    u.ctx.globalAlpha = 0.6;
    u.ctx.fillStyle = getComputedStyle(root).getPropertyValue("--line").trim();
    const right = u.bbox.left + u.bbox.width;
    const fill = (a, b) => { if (b > a) u.ctx.fillRect(a, u.bbox.top, b - a, u.bbox.height); };
    fill(u.bbox.left, Math.min(low, right));
    fill(Math.max(high, u.bbox.left), right);
    u.ctx.restore();
  }

  function options(plot, width, chooses, title) {
    const shade = (name) => getComputedStyle(root).getPropertyValue(name).trim();
    const axis = { stroke: shade("--soft"), font: "12px system-ui, sans-serif", labelFont: "12px system-ui, sans-serif" };
    const grid = { stroke: shade("--line"), width: 1 };
    const ticks = { stroke: shade("--line"), width: 1, size: 4 };
    const color = (line) => (line.color === "#000000" ? shade("--ink") : line.color); // black on a dark page is none
    const series = plot.lines.map((line) => ({
      label: line.label,
      stroke: color(line),
      pxAlign: 0,
      width: line.dots ? 0 : line.width,
      dash: line.dash.length ? line.dash : undefined,
      paths: line.dots ? () => null : undefined,
      points: line.dots ? { show: true, size: 4, fill: color(line), stroke: color(line), width: 0 } : { show: false },
    }));
    const mark = (u) => {
      if (plot.mark === null) return;
      const at = u.valToPos(plot.mark, "x", true);
      if (at < u.bbox.left || at > u.bbox.left + u.bbox.width) return;
      u.ctx.save();
      u.ctx.strokeStyle = shade("--ink");
      u.ctx.setLineDash([4, 4]);
      u.ctx.beginPath();
      u.ctx.moveTo(at, u.bbox.top);
      u.ctx.lineTo(at, u.bbox.top + u.bbox.height);
      u.ctx.stroke();
      u.ctx.restore();
    };
    const said = plot.y === title && plot.y.match(/\S+ \[[^\]]*\]$/); // the words stand above, and do not fit beside a low plot
    return {
      width,
      height: plot.height,
      cursor: { drag: { x: true, y: false, setScale: !chooses }, bind: chooses ? { dblclick: () => () => { choose(null, null); return null; } } : {} },
      legend: { show: false },
      scales: { x: { time: false } },
      axes: [
        { ...axis, grid, ticks, label: plot.x, labelSize: 22, size: 32, space: 60 },
        { ...axis, grid, ticks, label: said ? said[0] : plot.y, labelSize: 20, size: 58, space: 34 },
      ],
      series: [{ label: plot.x }, ...series],
      hooks: {
        draw: [mark],
        drawClear: chooses ? [leftOut] : [],
        setSelect: chooses ? [(u) => {
          if (u.select.width < 3) return;
          choose(u.posToVal(u.select.left, "x"), u.posToVal(u.select.left + u.select.width, "x"));
          u.setSelect({ left: 0, top: 0, width: 0, height: 0 }, false);
          u.redraw();
        }] : [],
      },
    };
  }

  function draw(figure) {
    const canvas = figure.querySelector(".canvas");
    const source = figure.querySelector("script[type='application/json']");
    if (!canvas || !source || !window.uPlot) return;
    const width = Math.floor(canvas.clientWidth);
    if (canvas.firstChild) figure.dataset.drawn = "yes"; // a swap takes the mark away, not the curves
    if (width < 50 || (canvas.firstChild && figure.drawn === source.textContent && figure.width === width)) return;
    const plot = JSON.parse(source.textContent);
    if (figure.chart) figure.chart.destroy();
    canvas.replaceChildren();
    figure.chart = new window.uPlot(options(plot, width, "window" in figure.dataset, figure.querySelector("figcaption").textContent), plot.data, canvas);
    figure.drawn = source.textContent;
    figure.width = width;
    figure.dataset.drawn = "yes";
  }
  const drawAll = () => document.querySelectorAll("figure[data-plot]").forEach(draw);

  // sliders and their numbers say the same
  document.addEventListener("input", (event) => {
    const it = event.target;
    if (it.dataset && it.dataset.for) document.getElementById(it.dataset.for).value = it.value;
    else if (it.id) {
      const slider = document.querySelector(`input[data-for="${CSS.escape(it.id)}"]`);
      if (slider) slider.value = it.value;
    }
  });

  // a recording that is dropped or chosen goes up at once
  document.querySelectorAll("form[data-upload]").forEach((form) => {
    const zone = form.querySelector(".drop"), input = form.querySelector("input[type=file]"), said = form.querySelector("[data-said]");
    const send = () => {
      if (!input.files.length) return;
      said.textContent = `Reading ${input.files.length === 1 ? input.files[0].name : input.files.length + " files"} …`;
      form.requestSubmit();
    };
    input.addEventListener("change", send);
    for (const kind of ["dragenter", "dragover"]) zone.addEventListener(kind, (e) => { e.preventDefault(); zone.classList.add("over"); });
    for (const kind of ["dragleave", "drop"]) zone.addEventListener(kind, () => zone.classList.remove("over"));
    zone.addEventListener("drop", (e) => { e.preventDefault(); input.files = e.dataTransfer.files; send(); });
  });

  // what holds the shell is boxed in the frame, or in numbers: both say the same
  const box = () => ["top", "bottom", "left", "right"].map((name) => document.querySelector(`[data-holder] [name=${name}]`));
  const boxed = () => {
    const rect = document.querySelector("[data-frame] .holder"), fields = box();
    if (!rect || !fields[0]) return;
    const [top, bottom, left, right] = fields.map((field) => parseFloat(field.value));
    const good = bottom >= top && right >= left;
    const at = good ? { x: left - 0.5, y: top - 0.5, width: right - left + 1, height: bottom - top + 1 } : { width: 0, height: 0 };
    for (const [name, value] of Object.entries(at)) rect.setAttribute(name, value);
  };
  document.addEventListener("input", boxed);
  document.addEventListener("pointerdown", (event) => {
    const frame = event.target.closest("[data-frame]");
    if (!frame) return;
    event.preventDefault();
    const view = frame.viewBox.baseVal;
    const pixel = (e) => {
      const at = new DOMPoint(e.clientX, e.clientY).matrixTransform(frame.getScreenCTM().inverse());
      const within = (x, most) => Math.min(Math.max(Math.round(x), 0), most - 1);
      return [within(at.x, view.width), within(at.y, view.height)];
    };
    const from = pixel(event);
    const drag = (e) => {
      const to = pixel(e);
      const ends = [Math.min(from[1], to[1]), Math.max(from[1], to[1]), Math.min(from[0], to[0]), Math.max(from[0], to[0])];
      box().forEach((field, k) => { field.value = ends[k]; });
      boxed();
    };
    const end = () => { removeEventListener("pointermove", drag); removeEventListener("pointerup", end); };
    addEventListener("pointermove", drag);
    addEventListener("pointerup", end);
  });

  document.addEventListener("click", (event) => {
    const button = event.target.closest("[data-copy]");
    if (!button) return;
    const text = document.getElementById(button.dataset.copy).textContent;
    const words = button.textContent;
    const done = (ok) => {
      button.textContent = ok ? "Copied" : "Press Ctrl+C";
      setTimeout(() => { button.textContent = words; }, 2000);
    };
    if (navigator.clipboard && window.isSecureContext) navigator.clipboard.writeText(text).then(() => done(true), () => done(false));
    else {
      getSelection().selectAllChildren(document.getElementById(button.dataset.copy));
      done(document.execCommand("copy"));
    }
  });

  // the button that leaves this page must not be taken for a change of the sliders
  document.addEventListener("htmx:before:request", (event) => {
    const from = document.activeElement;
    const source = event.detail && event.detail.ctx && event.detail.ctx.sourceElement;
    if (from && from.hasAttribute("data-plain") && source && source.contains(from)) event.preventDefault();
  });

  let waiting = 0;
  window.addEventListener("resize", () => { clearTimeout(waiting); waiting = setTimeout(drawAll, 80); });
  document.addEventListener("htmx:after:swap", () => { drawAll(); boxed(); });
  document.addEventListener("toggle", drawAll, true);
  const begin = () => { drawAll(); boxed(); };
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", begin);
  else begin();
})();
