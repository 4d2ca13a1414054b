"use strict";
// Make a figure that the reader chose, of any output against any axis, from the means of all cases.
(() => {
  const COLOURS = ["#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000"];
  const VIRIDIS = ["#440154", "#481a6c", "#472f7d", "#414487", "#39568c", "#31688e", "#2a788e", "#23888e", "#1f988b", "#22a884", "#35b779", "#54c568", "#7ad151",
    "#a5db36", "#d2e21b", "#fde725"];
  const KINDS = { value: "mean with its interval", lines: "error from the scatter of realisations", grid: "error of the grid" };
  const MARKERS = ["o", "s", "^", "D"];
  const LINES = ["-", "--", ":", "-."];

  const unique = (values) => [...new Set(values)].filter((value) => value !== null).sort((one, other) => (typeof one === "number" ? one - other : String(one) < String(other) ? -1 : 1));
  const geometric = (values) => {
    const known = values.filter((value) => typeof value === "number");
    return known.length > 0 && known.length === values.length && Math.min(...known) > 0 && Math.max(...known) > 10 * Math.min(...known);
  };
  const middle = (values) => values[Math.floor(values.length / 2)];

  // Return what the reader can choose for some series. Earlier choices are kept if they still exist.
  report.choices = (all, asked) => {
    const outputs = {};
    for (const series of all) Object.assign(outputs, series.outputs);
    const output = asked.output in outputs ? asked.output : Object.keys(outputs)[0];
    const holding = all.filter((series) => output in series.outputs);
    const series = holding.filter((one) => (asked.series ? asked.series.has(one.id) : one.own));
    const used = series.length ? series : holding.slice(0, 1);
    const axes = {};
    for (const one of used) Object.assign(axes, one.axes);
    const names = Object.keys(axes);
    const longest = [...names].sort((one, other) => steps(used, other).length - steps(used, one).length);
    const over = asked.over in axes ? asked.over : longest[0];
    const others = names.filter((name) => name !== over);
    const by = asked.by === "" || others.includes(asked.by) ? asked.by : (others.find((name) => steps(used, name).length <= COLOURS.length) ?? others[0] ?? "");
    const kinds = Object.keys(KINDS).filter((kind) => used.some((one) => kind in one.values[output]));
    const kind = kinds.includes(asked.kind) ? asked.kind : "value";
    const held = {};
    for (const name of others)
      if (name !== by && !used.some((one) => one.axes[name]?.dim === one.axes[over]?.dim)) {
        const values = steps(used, name);
        held[name] = asked.held?.[name] === "" || values.map(String).includes(asked.held?.[name]) ? asked.held[name] : String(middle(values));
      }
    return { output, kind, over, by, held, series: new Set(used.map((one) => one.id)), outputs, holding, axes, kinds, used };
  };
  const steps = (series, name) => unique(series.flatMap((one) => one.at[name] || []));

  const matching = (one, held) => {
    const kept = [];
    const asked = Object.entries(held).filter(([name, value]) => value !== "" && name in one.at);
    for (let k = 0; k < one.states.length; k++) if (asked.every(([name, value]) => String(one.at[name][k]) === value)) kept.push(k);
    return kept;
  };

  const trace = (one, choice, kept, label, look) => {
    const columns = one.values[choice.output];
    const shown = kept.filter((k) => typeof columns[choice.kind]?.[k] === "number" && one.at[choice.over][k] !== null);
    const shared = Object.values(one.axes).filter((axis) => axis.dim === one.axes[choice.over].dim).length > 1;
    const open = Object.entries(choice.held).some(([name, value]) => value === "" && name in one.at);
    const pick = (column) => shown.map((k) => column[k]);
    const order = [...shown].sort((a, b) => one.at[choice.over][a] - one.at[choice.over][b]);
    const sorted = (column) => order.map((k) => column[k]);
    const by = choice.by && one.at[choice.by];
    const base = { panel: 0, what: "data", curve: report.escaped(label), spoken: label, of: { status: sorted(one.states) } };
    for (const name of Object.keys(one.at)) base.of[name] = sorted(one.at[name]);
    const y = { x: sorted(one.at[choice.over]), y: sorted(columns[choice.kind]) };
    if (choice.kind === "value" && columns.low) Object.assign(y, { y_low: sorted(columns.low), y_high: sorted(columns.high) });
    if (look.dots) return { ...base, ...y, kind: "dots", scale: 0, value: sorted(by) };
    return { ...base, ...y, kind: "curve", ...look, line: shared || open || pick(columns[choice.kind]).length < 2 ? "" : look.line };
  };

  // Return the figure of a choice, in the same form as the figures that Python prepared.
  report.chosenFigure = (choice, title) => {
    const { output, over, by } = choice;
    const used = choice.used.filter((one) => over in one.axes);
    const values = by ? steps(used, by) : [];
    const together = used.some((one) => by && one.axes[by]?.dim === one.axes[over]?.dim);
    const many = values.length > COLOURS.length;
    const numeric = values.every((value) => typeof value === "number");
    const log = geometric(values);
    const place = (value) => (log ? Math.log(value / values[0]) / Math.log(values.at(-1) / values[0]) : (value - values[0]) / (values.at(-1) - values[0] || 1));
    const traces = [];
    used.forEach((one, number) => {
      const kept = matching(one, choice.held);
      const prefix = used.length > 1 ? one.label : "";
      if (!by || !(by in one.at)) {
        traces.push(trace(one, choice, kept, prefix || title, { colour: COLOURS[number % COLOURS.length], line: "-", marker: MARKERS[number % 4] }));
        return;
      }
      if (together && numeric && many) {
        traces.push(trace(one, choice, kept, prefix || title, { dots: true }));
        return;
      }
      values.forEach((value, k) => {
        const colour = many && numeric ? report.shade(VIRIDIS, place(value)) : COLOURS[k % COLOURS.length];
        const label = [prefix, `${one.axes[by].spoken} = ${report.number(value)}`].filter(Boolean).join(", ");
        const cases = kept.filter((j) => one.at[by][j] === value);
        if (cases.length) traces.push(trace(one, choice, cases, label, { colour, line: LINES[number % 4], marker: MARKERS[number % 4] }));
      });
    });
    const named = used[0].outputs[output];
    const kind = choice.kind === "value" ? "" : `${KINDS[choice.kind]} of `;
    const x = traces.flatMap((one) => one.x);
    const y = traces.flatMap((one) => one.y);
    const scale = { label: by && used[0].axes[by]?.label, spoken: by, low: values[0], high: values.at(-1), log, colours: VIRIDIS, panels: [0] };
    const held = Object.entries(choice.held).map(([name, value]) => `${choice.axes[name].spoken} ${value === "" ? "all" : "= " + report.number(isNaN(value) ? value : Number(value))}`);
    const reduced = [...new Set(used.flatMap((one) => one.reduced))];
    const parameters = { status: { label: "status", unit: "" } };
    for (const [name, how] of Object.entries(choice.axes)) parameters[name] = { label: name.replaceAll("_", " "), unit: how.unit };
    return { name: `${output}-against-${over}`, summary: "", title: `${kind}${named.label}`, spoken: `${kind}${named.spoken}`,
      fixed: [...(held.length ? [report.escaped(held.join(", "))] : []), ...(choice.kind === "value" && used.some((one) => one.values[output].low) ? ["bars and bands: 95 % intervals"] : [])],
      left_out: report.escaped(reduced.join("; ")), head: [`output: ${output}, ${KINDS[choice.kind]}`, `store: ${used.map((one) => one.url).join(", ")}`, `held fixed: ${held.join(", ") || "nothing"}`],
      panels: [{ title: "", x: { label: choice.axes[over].label, spoken: choice.axes[over].spoken, log: geometric(x) }, y: { label: kind + named.label, spoken: kind + named.spoken, log: geometric(y) } }],
      traces, scales: by && numeric && many ? [scale] : [], parameters };
  };

  // Show the input fields for a choice above the figure of this choice.
  report.chooser = (host, all, title, Figure) => {
    const { element } = report;
    const fields = element("div", { class: "controls choose" });
    const place = element("div");
    host.append(fields, place);
    let asked = {};
    const figure = new Figure(place);
    const field = (name, options, value, change) => {
      const select = element("select", { onchange: (event) => change(event.target.value), "data-field": name });
      for (const [key, text] of options) select.append(element("option", { value: key, selected: key === value }, text));
      return element("label", {}, `${name} `, select);
    };
    const show = () => {
      const choice = report.choices(all(), asked);
      const now = document.activeElement?.dataset?.field;
      const set = (part) => (value) => {
        asked = { ...choice, ...asked, ...part(value) };
        show();
      };
      const axes = Object.entries(choice.axes).map(([key, how]) => [key, how.spoken]);
      const others = axes.filter(([key]) => key !== choice.over);
      const parts = [
        field("Output", Object.entries(choice.outputs).map(([key, how]) => [key, how.spoken]), choice.output, set((output) => ({ output }))),
        field("Show", choice.kinds.map((kind) => [kind, KINDS[kind]]), choice.kind, set((kind) => ({ kind }))),
        field("Against", axes, choice.over, set((over) => ({ over, by: undefined }))),
        field("Colours", [["", "none"], ...others], choice.by, set((by) => ({ by }))),
      ];
      for (const [name, value] of Object.entries(choice.held))
        parts.push(field(choice.axes[name].spoken, [...steps(choice.used, name).map((one) => [String(one), report.number(one)]), ["", "all"]], value,
          set((one) => ({ held: { ...choice.held, [name]: one } }))));
      if (choice.holding.length > 1) {
        const boxes = choice.holding.map((one) => {
          const change = (event) => {
            const series = new Set(choice.series);
            if (event.target.checked) series.add(one.id);
            else if (series.size > 1) series.delete(one.id);
            asked = { ...choice, ...asked, series };
            show();
          };
          return element("label", {}, element("input", { type: "checkbox", checked: choice.series.has(one.id), onchange: change, "data-field": one.id }), one.label);
        });
        parts.push(element("fieldset", { class: "controls" }, element("legend", {}, "Series"), ...boxes));
      }
      fields.replaceChildren(...parts);
      if (now) fields.querySelector(`[data-field="${CSS.escape(now)}"]`)?.focus();
      figure.set(report.chosenFigure(choice, title));
    };
    return { show, figure };
  };
})();
