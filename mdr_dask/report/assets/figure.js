"use strict";
// Convert the data of a figure to the data and layout that Plotly draws.
(() => {
  const MARKERS = { o: "circle", s: "square", "^": "triangle-up", v: "triangle-down", D: "diamond", d: "diamond", x: "x", "+": "cross", "|": "line-ns-open",
    ".": "circle", "*": "star", p: "pentagon", h: "hexagon" };
  const LINES = { "-": "solid", "--": "dash", ":": "dot", "-.": "dashdot" };
  const TICKS = [1, 2, 5];

  // Return the name by which a curve is shown or hidden. A band has the name of its law.
  report.key = (trace, spec) => {
    if (trace.spoken) return trace.spoken;
    const law = spec.traces.find((other) => other.what === trace.what && other.spoken && other.kind === "law");
    return law ? law.spoken : trace.what;
  };

  const at = (column, k) => (Array.isArray(column) ? column[k] : column);

  // Return the indices of the points of a trace that have the parameter values chosen by the reader.
  const chosen = (trace, state) => {
    const kept = [];
    const asked = [...state.only].filter(([name]) => name in trace.of);
    for (let k = 0; k < trace.x.length; k++) if (asked.every(([name, value]) => String(at(trace.of[name], k)) === value)) kept.push(k);
    return kept;
  };

  const interval = (trace, name, k) => {
    const [low, high] = [trace[name + "_low"]?.[k], trace[name + "_high"]?.[k]];
    return typeof low === "number" && typeof high === "number" ? ` [${report.number(low)}, ${report.number(high)}]` : "";
  };

  report.pointText = (trace, spec, k) => {
    const panel = spec.panels[trace.panel];
    const lines = [`<b>${trace.curve || report.escaped(trace.what)}</b>`];
    const names = { x: panel.x.label || "x", y: panel.y.label || "y", value: spec.scales[trace.scale]?.label || "value" };
    for (const [name, label] of Object.entries(names))
      if (trace[name]?.[k] !== undefined) lines.push(`${label}: ${report.number(trace[name][k])}${interval(trace, name, k)}`);
    for (const name of spec.varied)
      if (name in trace.of) {
        const { label, unit } = spec.parameters[name];
        lines.push(report.escaped(`${label} = ${report.number(at(trace.of[name], k))} ${unit}`.trim()));
      }
    return lines.join("<br>");
  };

  const lengths = (trace, name, kept) => {
    const [low, high] = [trace[name + "_low"], trace[name + "_high"]];
    if (!low || !high || !kept.some((k) => typeof low[k] === "number")) return undefined;
    const part = (end) => kept.map((k) => (typeof end[k] === "number" ? Math.abs(end[k] - trace[name][k]) : 0));
    return { type: "data", symmetric: false, array: part(high), arrayminus: part(low), thickness: 1, width: 2 };
  };

  // Points without a value interrupt a line.
  const withGaps = (trace, kept, texts) => {
    const points = kept.map((k, place) => ({ x: trace.x[k], y: trace.y[k], text: texts[place] }));
    for (const x of trace.gaps || []) points.push({ x, y: null, text: "" });
    if (trace.gaps?.length) points.sort((one, other) => one.x - other.x);
    return { x: points.map((p) => p.x), y: points.map((p) => p.y), text: points.map((p) => p.text) };
  };

  const area = (trace, kept, colour) => {
    const known = kept.filter((k) => typeof trace.y_low[k] === "number" && typeof trace.y_high[k] === "number");
    const back = [...known].reverse();
    return { type: "scatter", mode: "lines", x: [...known, ...back].map((k) => trace.x[k]), y: [...known.map((k) => trace.y_low[k]), ...back.map((k) => trace.y_high[k])],
      fill: "toself", fillcolor: colour + "40", line: { width: 0 }, hoverinfo: "skip" };
  };

  const drawn = {
    curve(trace, spec, state, palette, kept) {
      const colour = report.legible(trace.colour, palette);
      const joined = Boolean(trace.line) && kept.length + (trace.gaps?.length || 0) > 1;
      const found = [];
      const texts = kept.map((k) => report.pointText(trace, spec, k));
      const one = { type: "scatter", mode: joined ? (trace.marker ? "lines+markers" : "lines") : "markers", ...withGaps(trace, kept, texts), hoverinfo: "text",
        line: { color: colour, dash: LINES[trace.line] || "solid", width: 1.7 }, marker: { color: colour, symbol: MARKERS[trace.marker] || "circle", size: 6 } };
      const bars = state.errors && lengths(trace, "y", kept);
      if (bars && joined) found.push(area(trace, kept, colour));
      else if (bars) one.error_y = { ...bars, color: colour };
      const across = state.errors && lengths(trace, "x", kept);
      if (across) one.error_x = { ...across, color: colour };
      return [...found, one];
    },
    law(...all) {
      return drawn.curve(...all);
    },
    band(trace, spec, state, palette, kept) {
      return state.errors ? [area(trace, kept, report.legible(trace.colour, palette))] : [];
    },
    dots(trace, spec, state, palette, kept) {
      const scale = spec.scales[trace.scale];
      const number = (value) => (scale.log ? Math.log10(value) : value);
      const bars = state.errors && trace.y_low && lengths(trace, "y", kept);
      return [{ type: "scatter", mode: "markers", x: kept.map((k) => trace.x[k]), y: kept.map((k) => trace.y[k]), text: kept.map((k) => report.pointText(trace, spec, k)),
        hoverinfo: "text", ...(bars ? { error_y: { ...bars, color: palette.line } } : {}),
        marker: { size: 7, color: kept.map((k) => number(trace.value[k])), ...coloured(scale, palette), line: { width: 0.5, color: palette.line } } }];
    },
    map(trace, spec, state, palette, kept) {
      const scale = spec.scales[trace.scale];
      const [columns, rows] = [trace.x, trace.y].map((values) => [...new Set(values)].sort((one, other) => one - other));
      const blank = () => rows.map(() => columns.map(() => null));
      const [z, text] = [blank(), blank()];
      for (const k of kept) {
        const [row, column] = [rows.indexOf(trace.y[k]), columns.indexOf(trace.x[k])];
        z[row][column] = scale.log ? Math.log10(trace.value[k]) : trace.value[k];
        text[row][column] = report.pointText(trace, spec, k);
      }
      const { colorscale, cmin, cmax, colorbar, showscale } = coloured(scale, palette);
      return [{ type: "heatmap", x: trace.x_edges, y: trace.y_edges, z, text, hoverinfo: "text", colorscale, zmin: cmin, zmax: cmax, colorbar, showscale, hoverongaps: false }];
    },
    absent(trace, spec, state, palette, kept) {
      return [{ type: "scatter", mode: "markers", x: kept.map((k) => trace.x[k]), y: kept.map(() => 0.02), yaxis: "y2", hoverinfo: "text",
        text: kept.map((k) => report.pointText(trace, spec, k)),
        marker: { color: report.legible(trace.colour, palette), symbol: MARKERS[trace.marker] || "x", size: 8 } }];
    },
  };

  const coloured = (scale, palette) => {
    const number = (value) => (scale.log ? Math.log10(value) : value);
    const colorscale = scale.colours.map((colour, k) => [k / (scale.colours.length - 1), colour]);
    const [cmin, cmax] = [number(scale.low), number(scale.high)];
    const bar = { title: { text: scale.label || "", side: "right", font: { color: palette.ink } }, tickfont: { color: palette.ink }, thickness: 12, outlinewidth: 0 };
    if (scale.log) {
      const ticks = [];
      const steps = cmax - cmin > 4 ? [1] : TICKS;
      for (let power = Math.floor(cmin); power <= cmax; power++) for (const step of steps) ticks.push(step * 10 ** power);
      const inside = ticks.filter((tick) => tick >= 0.999 * scale.low && tick <= 1.001 * scale.high);
      Object.assign(bar, { tickvals: inside.map(Math.log10), ticktext: inside.map(report.number) });
    }
    return { colorscale, cmin, cmax, colorbar: bar, showscale: true };
  };

  const axis = (how, log, palette) => ({
    title: { text: how.label, standoff: 8 }, type: log ? "log" : "linear", gridcolor: palette.grid, linecolor: palette.line, zerolinecolor: palette.line,
    zeroline: false, ticks: "outside", tickcolor: palette.line, showline: true, mirror: true, automargin: true, exponentformat: "power",
    ...(log ? { nticks: 4, minor: { ticks: "outside", ticklen: 3, tickcolor: palette.line } } : {}),
    ...(how.ticks ? { tickvals: how.ticks.map(([place]) => place), ticktext: how.ticks.map(([, text]) => text) } : {}),
    ...(how.reversed ? { autorange: "reversed" } : {}),
  });

  // Return data and layout of one panel for Plotly.
  report.panel = (spec, number, state, palette) => {
    const panel = spec.panels[number];
    const data = [];
    for (const trace of spec.traces) {
      if (trace.panel !== number || state.hidden.has(report.key(trace, spec))) continue;
      const kept = chosen(trace, state);
      if (kept.length) data.push(...drawn[trace.kind](trace, spec, state, palette, kept));
    }
    spec.scales.forEach((scale, k) => {
      const own = spec.traces.some((trace) => trace.scale === k);
      if (!own && scale.panels.at(-1) === number)
        data.push({ type: "scatter", mode: "markers", x: [null], y: [null], hoverinfo: "skip", marker: { color: [number], ...coloured(scale, palette) } });
    });
    const [x, y] = ["x", "y"].map((name) => axis(panel[name], state.log[name] ?? panel[name].log, palette));
    const layout = { paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: "rgba(0,0,0,0)", font: { color: palette.ink, family: "system-ui, sans-serif", size: 12 },
      title: panel.title ? { text: panel.title, font: { size: 13 }, x: 0.5 } : undefined, margin: { l: 60, r: 15, t: panel.title ? 40 : 15, b: 50 }, showlegend: false,
      hovermode: "closest", hoverlabel: { align: "left", bgcolor: palette.paper, bordercolor: palette.ink, font: { color: palette.ink } }, uirevision: JSON.stringify(state.log),
      xaxis: x, yaxis: y, yaxis2: { overlaying: "y", range: [0, 1], visible: false, fixedrange: true } };
    return { data, layout };
  };
})();
