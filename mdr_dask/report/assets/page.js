"use strict";
// The page: figures with their controls. A figure is drawn when the reader scrolls to it.
(() => {
  const { element } = report;
  const CONFIG = { displayModeBar: false, responsive: true, doubleClick: "reset" };
  const SIZE = { width: 720, height: 460 }; // of one panel in a downloaded figure, in pixels
  const MOST_ROWS = 500; // of a table on the page; the downloaded file has all rows
  const MOST_CHOICES = 60;
  const LAST = ["x", "x_low", "x_high", "y", "y_low", "y_high", "value", "value_low", "value_high"];
  const figures = [];
  const seen = new IntersectionObserver((entries) => entries.forEach((entry) => entry.isIntersecting && entry.target.figure.come()), { rootMargin: "400px" });

  class Figure {
    constructor(host) {
      this.state = { hidden: new Set(), only: new Map(), log: { x: null, y: null }, errors: true };
      this.host = element("section", { class: "figure" });
      this.host.figure = this;
      host.append(this.host);
      figures.push(this);
    }

    // Set the data of the figure. The choices of the reader stay in force.
    set(spec) {
      this.spec = spec;
      spec.varied = Object.keys(spec.parameters).filter((name) => this.values(name).length > 1);
      const open = this.host.querySelector("details")?.open;
      const focus = this.host.contains(document.activeElement) ? document.activeElement.dataset.field : null;
      const plots = this.plots?.length === spec.panels.length ? this.plots : null;
      this.plots = plots || spec.panels.map(() => element("div", { class: "panel", role: "img" }));
      this.plots.forEach((plot, k) => plot.setAttribute("aria-label", this.description(k)));
      const notes = [...spec.fixed, ...(spec.left_out ? [`not drawn: ${spec.left_out}`] : [])];
      this.host.setAttribute("aria-label", spec.spoken);
      this.host.replaceChildren(
        element("h4", {}, report.labelled(spec.title)),
        ...(spec.summary ? [element("p", { class: "note" }, `${spec.name}: ${spec.summary}`)] : []),
        ...notes.map((line) => element("p", { class: "note" }, report.labelled(line))),
        this.curves(), this.look(), element("div", { class: "panels" }, ...this.plots), this.table(open));
      if (focus) this.host.querySelector(`[data-field="${CSS.escape(focus)}"]`)?.focus();
      if (this.here) this.draw();
      else seen.observe(this.host);
    }

    values(name) {
      return [...new Set(this.spec.traces.flatMap((trace) => (name in trace.of ? trace.of[name] : [])))];
    }

    description(k) {
      const panel = this.spec.panels[k];
      const traces = this.spec.traces.filter((trace) => trace.panel === k);
      const count = traces.reduce((sum, trace) => sum + trace.x.length, 0);
      const keys = [...new Set(traces.map((trace) => report.key(trace, this.spec)))];
      return `${this.spec.spoken}. ${panel.y.spoken || "y"} against ${panel.x.spoken || "x"}: ${count} points, ${keys.slice(0, 8).join("; ")}. The numbers are in the table below.`;
    }

    come() {
      seen.unobserve(this.host);
      this.here = true;
      this.draw();
    }

    draw() {
      const palette = report.palette();
      this.plots.forEach((plot, k) => {
        const { data, layout } = report.panel(this.spec, k, this.state, palette);
        Plotly.react(plot, data, layout, CONFIG);
      });
    }

    // Return the legend, with check boxes that show or hide curves.
    curves() {
      const keys = new Map();
      for (const trace of this.spec.traces) {
        const key = report.key(trace, this.spec);
        if (!keys.has(key) || (keys.get(key).kind === "band" && trace.kind !== "band")) keys.set(key, trace);
      }
      const boxes = [...keys].map(([key, trace]) => {
        const change = (event) => {
          if (event.target.checked) this.state.hidden.delete(key);
          else this.state.hidden.add(key);
          this.draw();
        };
        const box = element("input", { type: "checkbox", checked: !this.state.hidden.has(key), onchange: change, "data-field": `curve ${key}` });
        return element("label", {}, box, swatch(trace), element("span", {}, report.labelled(trace.curve || report.escaped(key))));
      });
      return element("fieldset", { class: "controls curves" }, element("legend", {}, "Curves"), ...boxes);
    }

    look() {
      const box = (text, checked, change) => element("label", {}, element("input", { type: "checkbox", checked, "data-field": text,
        onchange: (event) => { change(event.target.checked); this.draw(); } }), text);
      const parts = ["x", "y"].map((name) => box(`log ${name}`, this.state.log[name] ?? this.spec.panels.every((panel) => panel[name].log), (on) => (this.state.log[name] = on)));
      if (this.spec.traces.some((trace) => trace.y_low || trace.x_low)) parts.push(box("errors", this.state.errors, (on) => (this.state.errors = on)));
      for (const name of this.spec.varied) {
        const values = this.values(name);
        if (values.length > MOST_CHOICES) continue;
        const change = (event) => {
          if (event.target.value) this.state.only.set(name, event.target.value);
          else this.state.only.delete(name);
          this.draw();
        };
        const select = element("select", { onchange: change, "data-field": `only ${name}` }, element("option", { value: "" }, "all"));
        for (const value of values) select.append(element("option", { value: String(value), selected: this.state.only.get(name) === String(value) }, report.number(value)));
        const { label, unit } = this.spec.parameters[name];
        parts.push(element("label", {}, `${label}${unit ? ` [${unit}]` : ""} `, select));
      }
      const button = (text, press) => element("button", { type: "button", onclick: press, "data-field": text, "aria-label": `${text}: ${this.spec.spoken}` }, text);
      parts.push(button("Zoom in", () => this.zoom(0.5)), button("Zoom out", () => this.zoom(2)), button("Whole", () => this.whole()));
      parts.push(button("SVG", () => this.picture("svg")), button("PNG", () => this.picture("png")), button("CSV", () => report.saved(`${this.spec.name}.csv`, this.csv(), "text/csv")));
      return element("div", { class: "controls look" }, ...parts);
    }

    zoom(factor) {
      this.come();
      for (const plot of this.plots) {
        const ends = (axis) => {
          const [low, high] = axis.range;
          const [centre, half] = [(low + high) / 2, ((high - low) / 2) * factor];
          return [centre - half, centre + half];
        };
        const { xaxis, yaxis } = plot._fullLayout;
        Plotly.relayout(plot, { "xaxis.range": ends(xaxis), "yaxis.range": ends(yaxis) });
      }
    }

    whole() {
      this.come();
      this.plots.forEach((plot, k) => {
        const panel = this.spec.panels[k];
        Plotly.relayout(plot, { "xaxis.autorange": panel.x.reversed ? "reversed" : true, "yaxis.autorange": panel.y.reversed ? "reversed" : true });
      });
    }

    // Return all panels as one SVG picture on white, in rows of at most three panels.
    async svg() {
      const count = this.plots.length;
      const columns = Math.min(count, count === 4 ? 2 : 3);
      const [width, height] = [SIZE.width * columns, SIZE.height * Math.ceil(count / columns) + 30];
      const panels = [];
      for (let k = 0; k < count; k++) {
        const { data, layout } = report.panel(this.spec, k, this.state, report.light);
        const ranges = {};
        for (const name of ["xaxis", "yaxis"]) if (this.here) ranges[name] = { ...layout[name], range: this.plots[k]._fullLayout[name].range, autorange: false };
        const address = await Plotly.toImage({ data, layout: { ...layout, ...ranges, ...SIZE } }, { format: "svg", ...SIZE });
        const inner = decodeURIComponent(address.slice(address.indexOf(",") + 1));
        panels.push(inner.replace("<svg ", `<svg x="${SIZE.width * (k % columns)}" y="${30 + SIZE.height * Math.floor(k / columns)}" `));
      }
      const title = `<text x="${width / 2}" y="20" text-anchor="middle" font-family="sans-serif" font-size="15">${report.escaped(this.spec.spoken)}</text>`;
      return { width, height, text: `<svg xmlns="http://www.w3.org/2000/svg" xmlns:xlink="http://www.w3.org/1999/xlink" width="${width}" height="${height}" viewBox="0 0 ${width} ${height}"><rect width="100%" height="100%" fill="#fff"/>${title}${panels.join("")}</svg>` };
    }

    async picture(form) {
      const { width, height, text } = await this.svg();
      if (form === "svg") return report.saved(`${this.spec.name}.svg`, text, "image/svg+xml");
      const image = new Image();
      image.src = URL.createObjectURL(new Blob([text], { type: "image/svg+xml" }));
      await image.decode();
      const canvas = element("canvas", { width: 2 * width, height: 2 * height });
      canvas.getContext("2d").drawImage(image, 0, 0, 2 * width, 2 * height);
      URL.revokeObjectURL(image.src);
      return canvas.toBlob((blob) => report.saved(`${this.spec.name}.png`, blob));
    }

    columns() {
      const last = LAST.filter((name) => this.spec.traces.some((trace) => trace[name]));
      return ["panel", "curve", "what", ...this.spec.varied, ...last];
    }

    *rows() {
      for (const trace of this.spec.traces)
        for (let k = 0; k < trace.x.length; k++)
          yield this.columns().map((name) => {
            if (name === "panel") return trace.panel + 1;
            if (name === "curve") return trace.spoken;
            if (name === "what") return trace.what;
            const column = LAST.includes(name) ? trace[name] : trace.of[name];
            return (Array.isArray(column) ? column[k] : column) ?? "";
          });
    }

    csv() {
      const quoted = (cell) => (/[",\n]/.test(cell) ? `"${String(cell).replaceAll('"', '""')}"` : cell);
      const lines = this.spec.head.map((line) => `# ${line}`);
      lines.push(this.columns().join(","));
      for (const row of this.rows()) lines.push(row.map(quoted).join(","));
      return lines.join("\n") + "\n";
    }

    table(open) {
      const count = this.spec.traces.reduce((sum, trace) => sum + trace.x.length, 0);
      const details = element("details", { open }, element("summary", { "data-field": "data" }, `Data: ${count} points`));
      const fill = () => {
        if (!details.open || details.children.length > 1) return;
        const body = element("tbody");
        let left = count;
        for (const row of this.rows()) {
          if (count - left === MOST_ROWS) break;
          body.append(element("tr", {}, ...row.map((cell) => element("td", {}, report.number(cell)))));
          left--;
        }
        const head = element("thead", {}, element("tr", {}, ...this.columns().map((name) => element("th", { scope: "col" }, name))));
        details.append(element("div", { class: "wide", tabindex: 0, role: "region", "aria-label": `Data of ${this.spec.spoken}` }, element("table", {}, head, body)));
        if (left) details.append(element("p", { class: "note" }, `${left} more rows: the CSV file has all`));
      };
      details.addEventListener("toggle", fill);
      if (open) fill();
      return details;
    }
  }

  const swatch = (trace) => {
    const name = "http://www.w3.org/2000/svg";
    const made = document.createElementNS(name, "svg");
    for (const [key, value] of Object.entries({ width: 26, height: 12, viewBox: "0 0 26 12", "aria-hidden": "true" })) made.setAttribute(key, value);
    const colour = report.legible(trace.colour || "#0072B2", report.palette());
    const part = (tag, attributes) => {
      const child = document.createElementNS(name, tag);
      for (const [key, value] of Object.entries(attributes)) child.setAttribute(key, value);
      made.append(child);
    };
    const dash = { "--": "6 3", ":": "2 3", "-.": "7 3 2 3" }[trace.line];
    if (trace.kind === "band") part("rect", { width: 26, height: 12, fill: colour, "fill-opacity": 0.4 });
    if (trace.line) part("line", { x1: 0, x2: 26, y1: 6, y2: 6, stroke: colour, "stroke-width": 2, ...(dash ? { "stroke-dasharray": dash } : {}) });
    if (trace.marker || ["dots", "map"].includes(trace.kind)) part(trace.marker === "s" ? "rect" : "circle", trace.marker === "s" ? { x: 9, y: 2, width: 8, height: 8, fill: colour } : { cx: 13, cy: 6, r: 4, fill: colour });
    return made;
  };

  const read = (page) => JSON.parse(page.getElementById("data").textContent);
  const own = new Map();
  const choosers = new Map();
  let studies = [];

  const all = (key) => studies.flatMap((study) => study.cases.map((series) => ({ ...series, id: `${study.key} ${series.name}`, url: study.url, own: study.key === key,
    label: [studies.length > 1 ? study.title : "", series.name].filter(Boolean).join(" ") || study.title })));

  const show = (data) => {
    studies = data;
    for (const study of studies) {
      const host = document.querySelector(`[data-figures="${study.key}"]`);
      for (const spec of study.figures) {
        const name = `${study.key} ${spec.name}`;
        if (!own.has(name)) own.set(name, new Figure(host));
        own.get(name).set(spec);
      }
      const choose = document.querySelector(`[data-choose="${study.key}"]`);
      if (!study.cases.length) {
        choose.replaceChildren(element("p", {}, "No output of this study has one number for each case, along an axis."));
        continue;
      }
      if (!choosers.has(study.key)) {
        choose.replaceChildren();
        choosers.set(study.key, report.chooser(choose, () => all(study.key), study.title, Figure));
      }
      choosers.get(study.key).show();
    }
  };

  const redraw = () => figures.forEach((figure) => {
    figure.host.querySelector(".curves")?.replaceWith(figure.curves());
    if (figure.here) figure.draw();
  });
  report.dark.addEventListener("change", redraw);
  addEventListener("beforeprint", () => {
    report.printing = true;
    for (const figure of figures) {
      figure.host.querySelector(".curves")?.replaceWith(figure.curves());
      figure.come();
      for (const plot of figure.plots) Plotly.relayout(plot, figure.plots.length > 1 ? { width: 330, height: 260 } : { width: 660, height: 380 });
    }
  });
  addEventListener("afterprint", () => {
    report.printing = false;
    redraw();
    for (const plot of figures.flatMap((figure) => figure.plots)) Plotly.relayout(plot, { autosize: true, width: null, height: null });
  });

  show(read(document));
  report.figures = figures;
})();
