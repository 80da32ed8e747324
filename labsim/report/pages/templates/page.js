"use strict";
(function () {
  const specs = JSON.parse(document.getElementById("figures").textContent);
  const root = document.documentElement;

  const touch = window.matchMedia("(pointer: coarse)").matches;
  const colour = (name) => getComputedStyle(root).getPropertyValue("--" + name).trim();

  function paint(trace) {
    const role = trace.meta;
    if (role === "band" || role === "noise") {
      trace.fillcolor = "rgba(" + colour("band") + "," + (role === "band" ? 0.2 : 0.25) + ")";
    } else if (role) {
      const own = colour(role);
      if (trace.type === "bar") trace.marker = Object.assign({}, trace.marker, { color: own });
      else {
        trace.line = Object.assign({}, trace.line, { color: own });
        trace.marker = Object.assign({}, trace.marker, { color: own });
        if (trace.error_y) trace.error_y = Object.assign({}, trace.error_y, { color: own });
      }
    }
    return trace;
  }

  function dress(layout) {
    const ink = colour("ink"), soft = colour("soft"), line = colour("line");
    layout.paper_bgcolor = layout.plot_bgcolor = "rgba(0,0,0,0)";
    layout.font = { family: "system-ui, sans-serif", size: 12, color: ink };
    layout.hoverlabel = { bgcolor: colour("card"), bordercolor: line, font: { color: ink } };
    for (const key of Object.keys(layout)) {
      if (/^[xy]axis\d*$/.test(key)) {
        Object.assign(layout[key], { gridcolor: line, linecolor: soft, tickcolor: soft, zerolinecolor: soft });
      }
    }
    (layout.shapes || []).forEach((shape) => { shape.line = Object.assign({}, shape.line, { color: soft }); });
    if (touch) layout.dragmode = false;
    return layout;
  }

  const copy = (value) => JSON.parse(JSON.stringify(value));

  function draw(node) {
    const spec = specs[node.dataset.figure];
    if (!spec || node.dataset.state) return Promise.resolve();
    node.dataset.state = "drawing";
    return Plotly.newPlot(node, copy(spec.data).map(paint), dress(copy(spec.layout)), {
      responsive: true, displaylogo: false, scrollZoom: false,
      modeBarButtonsToRemove: ["lasso2d", "select2d", "autoScale2d"],
    }).then(() => { node.dataset.state = "drawn"; });
  }

  const nodes = Array.from(document.querySelectorAll(".plot"));
  const idle = window.requestIdleCallback || ((work) => setTimeout(work, 30));

  function start() {
    if (typeof Plotly === "undefined") return;
    root.classList.add("js");
    const queue = nodes.slice();
    const seen = new IntersectionObserver((entries) => {
      entries.forEach((entry) => { if (entry.isIntersecting) { seen.unobserve(entry.target); draw(entry.target); } });
    }, { rootMargin: "400px" });
    nodes.forEach((node) => seen.observe(node));
    function next() {
      const node = queue.shift();
      if (node) draw(node).then(() => idle(next, { timeout: 500 }));
      else root.dataset.figures = "drawn";
    }
    idle(next, { timeout: 500 });
  }

  // the words are there to be read before the library, which takes a second to compile, is started
  window.addEventListener("load", () => requestAnimationFrame(() => setTimeout(() => {
    const script = document.createElement("script");
    script.textContent = document.getElementById("library").textContent;
    document.body.append(script);
    start();
  })));

  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => {
    nodes.filter((node) => node.dataset.state === "drawn").forEach((node) => {
      const spec = specs[node.dataset.figure];
      Plotly.react(node, copy(spec.data).map(paint), dress(copy(spec.layout)));
    });
  });
  // what is folded away would be missing on paper
  window.addEventListener("beforeprint", () => document.querySelectorAll("details").forEach((each) => { each.open = true; }));
})();
