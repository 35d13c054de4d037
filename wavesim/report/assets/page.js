"use strict";
// Draws the plots of a run from the data in its page, in the units that the reader chooses.
(async () => {
  const packed = [];
  const data = JSON.parse(document.getElementById("data").textContent, (_, value) => {
    if (value && value.bytes) packed.push(value);
    return value;
  });
  const RED = "#c8102e", INK = "#16202a", BLUE = "#2f6f9f", GREY = "#8a97a3", SLATE = "#5d6b78", PINK = "rgba(200,16,46,0.16)", GAP = "rgba(120,135,150,0.22)";
  // Seen on white and on the darkest of a spectrum.
  const COLOURS = ["#2a8fd6", "#e0263c", "#2fa84a", "#a678d8", "#d98a1f", "#16a5b8"];
  const SECTORS = { longitudinal: "longitudinal", transverse2: "transverse x₂", transverse3: "transverse x₃",
    inplane: "in-plane shear" };
  const symbol = name => data.symbols[name] || name;

  // A packed array, deflated: the low bytes of all differences along the rows, then the high ones.
  async function inflated(one) {
    const bytes = Uint8Array.from(atob(one.data), c => c.charCodeAt(0));
    const stream = new Blob([bytes]).stream().pipeThrough(new DecompressionStream("deflate"));
    one.planes = new Uint8Array(await new Response(stream).arrayBuffer());
    delete one.data;
  }
  // As rows of numbers; what is at the low end of a level is nothing to be seen.
  function unpacked(one, empty) {
    const [rows, columns] = one.shape.length > 1 ? one.shape : [1, one.shape[0]];
    const found = [], size = rows * columns;
    for (let i = 0; i < rows; i++) {
      const row = new Array(columns);
      let n = 0;
      for (let j = 0; j < columns; j++) {
        const at = i * columns + j;
        n = one.bytes === 1 ? n + one.planes[at] & 255 : (n + one.planes[at] + (one.planes[size + at] << 8)) << 16 >> 16;
        row[j] = empty && n === 0 ? null : one.low + one.step * n;
      }
      found.push(row);
    }
    return one.shape.length > 1 ? found : found[0];
  }

  // Units: what one SI unit is in those shown, and their name.
  const chosen = { frequency: "si", length: "si" };
  const { length: l, time: T } = data.units;
  const UNITS = {
    frequency: { by: "frequency", si: [1e-3, "kHz"], bar: [2 * Math.PI * T, "ω̄"] },
    time: { by: "frequency", si: [1e6, "µs"], bar: [1 / T, `t/${data.time_unit}`] },
    length: { by: "length", si: [1e3, "mm"], bar: [1 / l, "l"] },
    wavenumber: { by: "length", si: [1e-3, "rad/mm"], bar: [l / 2 / Math.PI, "k̄ = k l/2π"] },
    decay: { by: "length", si: [1e-3, "dB/mm"], bar: [l, "dB per l"] },
  };
  const unit = kind => UNITS[kind][chosen[UNITS[kind].by]];
  const to = (kind, values) => { const f = unit(kind)[0]; return values.map(v => v === null ? null : v * f); };
  const TITLES = { frequency: "ω/2π", time: "t", length: "x", wavenumber: "k", decay: "attenuation" };
  const title = kind => {
    const name = unit(kind)[1];
    if (name === "ω̄" || name.startsWith("k̄") || name.startsWith("t/")) return name;
    return `${TITLES[kind]} (${name})`;
  };
  const short = kind => unit(kind)[1].split(" =")[0].replace(/^t\/.*/, "units of time");

  const axis = (kind, more) => ({ title: { text: title(kind), standoff: 8 }, zeroline: false, ...more });
  const plain = (text, more) => ({ title: { text, standoff: 8 }, zeroline: false, ...more });
  const narrow = () => window.innerWidth < 640;
  const layout = more => ({
    margin: { l: 62, r: narrow() ? 12 : 24, t: 26, b: 48 }, font: { family: "system-ui, sans-serif", size: 12, color: INK },
    paper_bgcolor: "#fff", plot_bgcolor: "#fff", hovermode: "closest", hoverlabel: { namelength: -1, bgcolor: INK, font: { color: "#fff" } }, dragmode: narrow() ? false : "zoom",
    legend: { orientation: "h", x: 0, font: { size: 11 }, ...(narrow() ? { y: -0.25, yanchor: "top" } : { y: 1.02, yanchor: "bottom" }) }, shapes: [], annotations: [],
    ...more,
  });
  const config = { responsive: true, displaylogo: false, modeBarButtonsToRemove: ["select2d", "lasso2d"] };
  // Matplotlib's magma from light to dark, as in the figures.
  const MAGMA = { colorscale: ["#fcfdbf", "#fecf92", "#fe9f6d", "#f7705c", "#de4968", "#b5367a", "#8c2981", "#641a80", "#3b0f70", "#140e36", "#000004"].map((colour, n) => [n / 10, colour]) };
  // The legend under the axes, where names stand above them.
  const below = made => ({ ...made, legend: { ...made.legend, y: narrow() ? -0.25 : -0.16, yanchor: "top" } });
  const bar = text => ({ title: { text, side: "right" }, thickness: 12, len: 0.9, outlinewidth: 0 });

  // Of a long list so many, evenly.
  const MOST = 24;
  const some = (list, most) => list.length <= most ? list : Array.from({ length: most }, (_, i) => list[Math.round(i * (list.length - 1) / (most - 1))]);

  // Gaps as bands with their names, along x or y.
  function gaps(made, sector, along) {
    for (const gap of data.gaps[sector] || []) {
      const [low, high] = to("frequency", [gap.lower, gap.upper]);
      const box = { type: "rect", layer: "below", fillcolor: GAP, line: { width: 0 } };
      made.shapes.push(along === "x" ? { ...box, x0: low, x1: high, y0: 0, y1: 1, yref: "paper" }
        : { ...box, y0: low, y1: high, x0: 0, x1: 1, xref: "paper" });
      const mark = { text: gap.name, showarrow: false, font: { size: 11 }, bgcolor: "rgba(255,255,255,0.8)" };
      made.annotations.push(along === "x" ? { ...mark, x: (low + high) / 2, y: 1, yref: "paper", yanchor: "top" }
        : { ...mark, y: (low + high) / 2, x: 0.01, xref: "paper", xanchor: "left" });
    }
  }
  // Receivers and interfaces as lines at their places along x; names as far as there is room, above
  // one another where they are close.
  function places(made) {
    const line = (x, dash, colour) => made.shapes.push({ type: "line", x0: x, x1: x, y0: 0, y1: 1, yref: "paper",
      line: { width: 1, dash, color: colour } });
    for (const x of to("length", some(data.interfaces, 200))) line(x, "solid", GREY);
    const wide = (host.clientWidth - 160) / data.length, ends = [-Infinity, -Infinity, -Infinity];
    let rows = 0;
    for (const receiver of some([...data.receivers].sort((a, b) => a.position - b.position), MOST)) {
      const [x] = to("length", [receiver.position]);
      line(x, "dot", BLUE);
      const middle = receiver.position * wide, half = 3.1 * receiver.name.length + 3;
      const row = ends.findIndex(end => middle - half > end);
      if (row < 0) continue;
      ends[row] = middle + half;
      rows = Math.max(rows, row);
      made.annotations.push({ x, y: 1, yref: "paper", yanchor: "bottom", yshift: 12 * row, text: receiver.name, showarrow: false,
        font: { size: 10, color: BLUE } });
    }
    made.margin.t = 22 + 12 * rows;
  }

  const plots = [];
  const state = { sector: null, field: null, frame: 0 };
  const host = document.getElementById("plots");
  function place(id, heading, kinds, draw, low) {
    const section = document.createElement("section");
    section.innerHTML = `<h2></h2><p class="note caption"></p><div class="plot${low ? " low" : ""}" id="${id}"></div>`;
    section.querySelector("h2").textContent = heading;
    host.append(section);
    plots.push({ id, heading, kinds, draw, section, low });
    return section;
  }
  const at = (part, sector) => (part && (part[sector] || null));
  // What the pointer tells; beside it stands the name of the curve.
  const hover = (x, y) => `${x}<br>${y}`;
  // An entry of the legend for what is drawn otherwise, or by many curves.
  const entry = (name, more) => ({ x: [null], y: [null], name, mode: "lines", hoverinfo: "skip", ...more });

  function spectrum(sector) {
    const own = at(data.spectrum, sector);
    if (!own) return null;
    const highest = own.frequency.at(-1), lowest = Math.min(...own.branches.flatMap(b => b.line));
    const made = layout({
      xaxis: axis("wavenumber", { range: to("wavenumber", [0, own.line_k.at(-1)]) }),
      yaxis: axis("frequency", { range: to("frequency", [0.75 * lowest, highest]) }),
    });
    gaps(made, sector, "y");
    const where = hover(`k %{x:.4g} ${short("wavenumber")}`, `%{y:.5g} ${short("frequency")}`);
    const traces = [{ type: "heatmap", x: to("wavenumber", own.k), y: to("frequency", own.frequency), z: own.rows ||= unpacked(own.power, true),
      ...MAGMA, zmin: -80, zmax: 0, colorbar: bar("power (dB)"), name: "spectrum", showlegend: false,
      hovertemplate: `${where}<br>%{z:.1f} dB<extra></extra>` },
      entry("exact", { line: { color: INK, width: 1.4, dash: "5px,5px" } }),
      entry("measured", { mode: "markers", marker: { size: 6, color: "white", line: { color: INK, width: 1.5 } } })];
    const ends = [];
    const right = to("wavenumber", own.line_k).at(-1);
    own.branches.forEach((branch, n) => {
      const colour = COLOURS[n % COLOURS.length];
      const line = to("frequency", branch.line);
      traces.push({ x: to("wavenumber", own.line_k), y: line, mode: "lines", name: branch.name,
        legendgroup: branch.name, line: { color: colour, width: 1.4, dash: "5px,5px" },
        hovertemplate: `${where}<extra>${branch.name}, exact</extra>` });
      traces.push({ x: to("wavenumber", branch.k), y: to("frequency", branch.frequency), mode: "markers", name: `${branch.name}, measured`,
        legendgroup: branch.name, showlegend: false, customdata: branch.exact.map((e, i) => 100 * (branch.frequency[i] / e - 1)),
        marker: { size: 6, color: "white", line: { color: colour, width: 1.5 } },
        hovertemplate: `${where}<br>%{customdata:.2g} % off<extra>${branch.name}, measured</extra>` });
      ends.push([line.at(-1), branch.name]);
    });
    // Branches that end as one share a place for their names.
    const [low, high] = made.yaxis.range, shared = [];
    for (const [y, name] of ends.sort((a, b) => a[0] - b[0])) {
      const last = shared.at(-1);
      if (last && y - last.y < 0.045 * (high - low)) last.names.push(name);
      else shared.push({ y, names: [name] });
    }
    for (const { y, names } of shared) made.annotations.push({ x: right, y, text: names.join(", "), showarrow: false, xanchor: "right", yanchor: "bottom",
      yshift: 3, font: { size: 11 }, bgcolor: "rgba(255,255,255,0.8)", borderpad: 1 });
    return [traces, made];
  }

  function attenuation(sector) {
    const own = at(data.attenuation, sector);
    if (!own) return null;
    const top = Math.max(...to("decay", own.exact).filter(v => v !== null)) * 1.3;
    const made = layout({ xaxis: axis("frequency"), yaxis: axis("decay", { range: [-0.03 * top, top] }) });
    gaps(made, sector, "x");
    const where = hover(`%{x:.5g} ${short("frequency")}`, `%{y:.5g} ${short("decay")}`);
    return [[
      { x: to("frequency", own.line_frequency), y: to("decay", own.line_real), mode: "lines", name: "steady wave (real ω): exact",
        line: { color: RED, width: 2 }, hovertemplate: where },
      { x: to("frequency", own.line_frequency), y: to("decay", own.line_exact), mode: "lines", name: "record (ω + iσ): exact",
        line: { color: GREY, width: 1.4 }, hovertemplate: where },
      { x: to("frequency", own.frequency), y: to("decay", own.measured), mode: "markers", name: "record (ω + iσ): simulated",
        marker: { size: 6, color: "white", line: { color: SLATE, width: 1.4 } }, hovertemplate: where },
    ], made];
  }

  function transmission(sector) {
    const own = at(data.transmission, sector);
    if (!own) return null;
    const made = layout({ xaxis: axis("frequency"), yaxis: plain(narrow() ? "T, R (dB)" : "amplitude over incident (dB)", { range: [-100, 8] }) });
    gaps(made, sector, "x");
    for (const band of own.bands) {
      const [low, high] = to("frequency", [band.lower, band.upper]);
      const box = { type: "rect", layer: "below", fillcolor: PINK, line: { width: 0 }, x0: low, x1: high };
      const [most, least] = band.limits;
      if (most !== null) made.shapes.push({ ...box, y0: most, y1: 20 });
      if (least !== null) made.shapes.push({ ...box, y0: -400, y1: least });
      if (most === null && least === null) made.shapes.push({ ...box, y0: 0, y1: 1, yref: "paper" });
    }
    const where = hover(`%{x:.5g} ${short("frequency")}`, "%{y:.5g} dB");
    const steady = [], record = [];
    for (const [name, colour, mark, dash] of [["T", RED, "circle", "solid"], ["R", BLUE, "square", "dash"]]) {
      const one = own[name];
      if (one.real) steady.push({ x: to("frequency", one.real_frequency), y: one.real, mode: "lines", name: `${name}, steady wave (real ω): exact`,
        line: { color: colour, width: name === "T" ? 2 : 1.4, dash }, hovertemplate: where });
      record.push({ x: to("frequency", own.line_frequency), y: one.line, mode: "lines", name: `${name}, record (ω + iσ): exact`,
        line: { color: GREY, width: 1.3, dash }, hovertemplate: where });
      record.push({ x: to("frequency", own.frequency), y: one.measured, mode: "markers", name: `${name}, record (ω + iσ): simulated`, customdata: one.exact,
        marker: { size: 6, symbol: mark, color: "white", line: { color: SLATE, width: 1.3 } },
        hovertemplate: `${where}<br>exact %{customdata:.5g} dB` });
    }
    const ranked = (list, from) => list.map((trace, n) => ({ ...trace, legendrank: from + n }));
    if (own.bands.length) steady.push(entry("where T of a steady wave must not be", { mode: "markers", marker: { symbol: "square", size: 14, color: PINK } }));
    return [[...ranked(record, 10), ...ranked(steady, 1)], made];
  }

  function bloch(sector) {
    const own = at(data.bloch, sector);
    if (!own) return null;
    const made = layout({ xaxis: axis("frequency"), yaxis: plain("Re qL/π, Im qL") });
    const where = hover(`%{x:.5g} ${short("frequency")}`, "%{y:.5g}");
    const pair = (name, key, colour) => [
      { x: to("frequency", own.line_frequency), y: own["line_" + key], mode: "lines", name: `${name} exact`,
        line: { color: INK, width: 1.3, dash: key === "phase" ? "solid" : "dash" }, hovertemplate: where },
      { x: to("frequency", own.frequency), y: own[key], mode: "markers", name: `${name} simulated`,
        marker: { size: 6, color: "white", line: { color: colour, width: 1.4 } }, hovertemplate: where }];
    return [[...pair("Re qL/π", "phase", RED), ...pair("Im qL", "decay", BLUE)], made];
  }

  function ringing(sector) {
    const own = at(data.eigenfrequencies, sector);
    if (!own) return null;
    const made = layout({ xaxis: axis("frequency"), yaxis: plain("receivers together (dB)", { range: [-110, 10] }) });
    const where = hover(`%{x:.8g} ${short("frequency")}`, "%{y:.1f} dB");
    return [[
      { x: to("frequency", own.frequency), y: own.level, mode: "lines", name: "spectrum", line: { color: GREY, width: 1 }, hovertemplate: where },
      { x: to("frequency", own.exact), y: own.exact.map(() => 4), mode: "markers", name: "exact eigenfrequency",
        marker: { symbol: "line-ns", size: 9, line: { color: INK, width: 1.4 } }, hovertemplate: where },
      { x: to("frequency", own.measured), y: own.height, mode: "markers", name: "simulated",
        marker: { size: 6, color: "white", line: { color: RED, width: 1.4 } }, hovertemplate: where },
    ], made];
  }

  // Of the pulse test of a sector some quantities against frequency.
  function betweenReceivers(sector, title, kind, shown) {
    const [name, own] = Object.entries(data.pulse || {}).find(([, one]) => one.sector === sector) || [];
    if (!own || !shown.some(([key]) => own.measured[key].some(v => v !== null))) return null;
    const made = layout({ xaxis: axis("frequency"), yaxis: plain(title, { rangemode: "tozero" }) });
    gaps(made, sector, "x");
    const f = to("frequency", own.frequency), where = hover(`%{x:.5g} ${short("frequency")}`, `%{y:.5g} ${kind}`);
    return [shown.flatMap(([key, label, colour, dash, mark]) => [
      { x: f, y: own.exact[key], mode: "lines", name: `${label}, exact signals`, line: { color: INK, width: 1.2, dash }, hovertemplate: where },
      { x: f, y: own.measured[key], mode: "markers", name: `${label}, simulated`,
        marker: { size: 6, symbol: mark, color: "white", line: { color: colour, width: 1.4 } }, hovertemplate: where },
    ]), made, symbol(name)];
  }
  const velocities = sector => betweenReceivers(sector, "velocity (m/s)", "m/s",
    [["phase_velocity", "phase velocity", RED, "solid", "circle"], ["group_velocity", "group velocity", BLUE, "dash", "triangle-up"]]);
  const quality = sector => betweenReceivers(sector, "Q", "", [["quality", "Q", "#2e7d32", "solid", "circle"]]);

  const frameTime = () => data.snapshots.t[state.frame];
  function spacetime(sector) {
    const own = at(data.spacetime, sector);
    if (!own) return null;
    const z = own.rows ||= unpacked(own, true);
    const steps = (count, begin, end) => Array.from({ length: count }, (_, i) => begin + (i + 0.5) * (end - begin) / count);
    const made = layout({
      xaxis: axis("length", { range: to("length", [0, data.length]) }),
      yaxis: axis("time", { range: to("time", [0, data.duration]) }),
    });
    places(made);
    const [now] = to("time", [frameTime()]);
    made.shapes.push({ type: "line", x0: 0, x1: 1, xref: "paper", y0: now, y1: now, name: "now", line: { color: BLUE, width: 1.5 } });
    const sources = data.sources.filter(s => s.sectors.includes(sector) && s.time !== null);
    const round = (data.round[sector] || []).map(([x, t]) => [to("length", x), to("time", t)]);
    const dashes = (name, line) => round.map(([x, y]) => ({ x, y, mode: "lines", name, showlegend: false, line,
      hovertemplate: "from here on waves overlap that have<br>gone round the bar<extra></extra>" }));
    if (round.length) {
      const [x, t] = round.reduce((a, b) => b[0][0] < a[0][0] ? b : a);
      made.annotations.push({ x: (x[0] + x[1]) / 2, y: (t[0] + t[1]) / 2, text: "gone round the bar", showarrow: false, xanchor: "left", xshift: 8,
        font: { size: 10, color: "white" }, bgcolor: "rgba(60,40,80,0.75)" });
    }
    return [[
      { type: "heatmap", x: to("length", steps(z[0].length, 0, own.x_end)), y: to("time", steps(z.length, own.t_begin, own.t_end)), z, ...MAGMA,
        zmin: -60, zmax: 0, colorbar: bar("amplitude (dB)"), name: "amplitude", showlegend: false,
        hovertemplate: `x %{x:.4g} ${short("length")}<br>t %{y:.4g} ${short("time")}<br>%{z:.1f} dB<extra></extra>` },
      { x: to("length", sources.map(s => s.position)), y: to("time", sources.map(s => s.time)), mode: "markers", name: "source", text: sources.map(s => symbol(s.field)),
        marker: { symbol: "triangle-down", size: 10, color: "white", line: { color: INK, width: 1.4 } },
        hovertemplate: "source on %{text}<extra></extra>" },
      ...dashes("gone round the bar", { color: "rgba(0,0,0,0.5)", width: 3 }), ...dashes("gone round the bar, dashes", { color: "white", width: 1.4, dash: "dash" }),
      entry("moment of the field below", { line: { color: BLUE, width: 1.5 } }),
      ...(data.receivers.length ? [entry("receiver", { line: { color: BLUE, width: 1, dash: "dot" } })] : []),
      ...(data.interfaces.length ? [entry("interface", { line: { color: GREY, width: 1 } })] : []),
    ], below(made)];
  }

  function snapshot() {
    const own = data.snapshots.fields[state.field];
    const rows = own.rows ||= unpacked(own);
    const top = own.top ||= Math.max(...rows.map(row => row.reduce((m, v) => Math.max(m, Math.abs(v)), 0))) || 1;
    const y = rows[state.frame];
    const largest = Math.max(...y.map(Math.abs)) || top;
    const reach = document.getElementById("grow").checked ? largest : top;
    const made = layout({ xaxis: axis("length", { range: to("length", [0, data.length]) }), yaxis: plain(`${symbol(state.field)} (${own.unit})`, { range: [-1.08 * reach, 1.08 * reach], exponentformat: "power" }) });
    places(made);
    return [[{ x: to("length", own.x), y, mode: "lines", line: { color: RED, width: 1.4 }, name: symbol(state.field),
      hovertemplate: `x %{x:.5g} ${short("length")}<br>%{y:.4g} ${own.unit}<extra></extra>` }], made, symbol(state.field)];
  }

  function signals() {
    const many = some(data.signals.receivers, MOST);
    document.getElementById("signals").style.height = `${Math.max(22, 6 + 1.6 * many.length)}rem`;
    const t = to("time", data.signals.t), own = data.signals.sections[state.field];
    const made = layout({ xaxis: axis("time", { range: to("time", [0, own.end]) }), yaxis: plain("", { tickvals: many.map((_, n) => n),
      ticktext: many.map(r => `${r.name}, ${+to("length", [r.position])[0].toPrecision(4)} ${short("length")}`), automargin: true }) });
    const traces = [];
    const of = receiver => receiver.fields[state.field];
    many.forEach((receiver, n) => {
      const one = of(receiver), colour = COLOURS[n % COLOURS.length];
      const show = values => values.map(v => n + 0.45 * v / one.scale);
      const where = `t %{x:.5g} ${short("time")}<br>%{customdata:.4g} ${own.unit}`;
      const exact = ((data.exact_signals || {})[receiver.name] || {})[state.field];
      if (exact) {
        const values = exact.row ||= unpacked(exact);
        traces.push({ x: t, y: show(values), customdata: values, mode: "lines", name: "exact", legendgroup: "exact", showlegend: n === 0,
          line: { color: GREY, width: 3 }, hovertemplate: `${where}<extra>${receiver.name}, exact</extra>` });
      }
      const values = one.row ||= unpacked(one);
      traces.push({ x: t, y: show(values), customdata: values, mode: "lines", name: receiver.name, showlegend: false, line: { color: colour, width: 1.3 },
        hovertemplate: `${where}<extra>${receiver.name}, simulated</extra>` });
    });
    const arrived = [...many.entries()].filter(([, r]) => of(r).arrival !== null);
    if (arrived.length) traces.push({ x: to("time", arrived.map(([, r]) => of(r).arrival)), y: arrived.map(([n]) => n), text: arrived.map(([, r]) => r.name),
      mode: "markers", name: "first 5 % of its peak", marker: { symbol: "line-ns", size: 16, line: { color: RED, width: 2 } },
      hovertemplate: `arrives at %{x:.5g} ${short("time")}<extra>%{text}</extra>` });
    const peaks = data.signals.receivers.map(r => of(r).peak), [low, high] = [Math.min(...peaks), Math.max(...peaks)].map(v => v.toPrecision(3));
    const scale = +high === 0 ? "nothing reaches them" : own.alike ? `all on one scale, peak ${high} ${own.unit}` : `each to its own peak, ${low} to ${high} ${own.unit}`;
    const [end, all] = to("time", [own.end, data.duration]).map(v => v.toPrecision(3));
    const cut = own.end < 0.999 * data.duration ? `; the first ${end} of ${all} ${short("time")}: a double click shows the rest` : "";
    return [traces, made, symbol(state.field), `${scale[0].toUpperCase()}${scale.slice(1)}${cut}.`];
  }

  function build() {
    const sector = document.getElementById("sector");
    for (const name of data.sectors) sector.add(new Option(SECTORS[name] || name, name));
    state.sector = data.sectors[0];
    if (data.sectors.length < 2) sector.parentElement.style.display = "none";
    state.field = data.fields[state.sector][0];
    state.frame = data.snapshots.first;
    if (data.spectrum) place("spectrum", "Dispersion: what travels, and what does not", ["wavenumber", "frequency"], () => spectrum(state.sector));
    if (data.attenuation && Object.keys(data.attenuation).length) place("attenuation", "Attenuation", ["frequency", "decay"], () => attenuation(state.sector));
    if (data.transmission) place("transmission", "Transmission and reflection", ["frequency", null], () => transmission(state.sector));
    if (data.bloch) place("bloch", "Bloch wave of the repeated stretch", ["frequency", null], () => bloch(state.sector), true);
    if (data.eigenfrequencies) place("eigenfrequencies", "Eigenfrequencies", ["frequency", null], () => ringing(state.sector));
    if (data.pulse) place("velocities", "Velocities between receivers", ["frequency", null], () => velocities(state.sector));
    if (data.pulse) place("quality", "Q between receivers", ["frequency", null], () => quality(state.sector), true);
    place("spacetime", "Amplitude in the bar over time", ["length", "time"], () => spacetime(state.sector));
    const section = place("snapshot", "The field in the bar", ["length", null], snapshot, true);
    const slider = document.createElement("div");
    slider.className = "slider";
    slider.innerHTML = `<label>field <select id="field"></select></label><label for="frame">time</label>
      <input type="range" id="frame" min="0" max="${data.snapshots.t.length - 1}" value="${state.frame}" step="1">
      <output id="now" for="frame"></output><button type="button" id="play">play</button>
      <label><input type="checkbox" id="grow"> scale to this moment</label>`;
    section.querySelector("h2").after(slider);
    fields();
    const count = data.signals.receivers.length;
    const heading = count > MOST ? `Receivers, ${MOST} of ${count}` : "Receivers";
    if (count) place("signals", heading, ["time", null], signals);
  }

  // The fields of the waves that are chosen, the first of which is shown.
  function fields() {
    const own = data.fields[state.sector], select = document.getElementById("field");
    state.field = own[0];
    select.replaceChildren(...own.map(name => new Option(symbol(name), name)));
    select.value = state.field;
  }

  const unitOf = (kind, which) => kind ? UNITS[kind][which[UNITS[kind].by]][0] : 1;
  // Draws one plot; where the reader has zoomed, what is shown stays, whatever the units.
  function draw(plot, before) {
    const made = plot.draw();
    plot.section.hidden = !made;
    if (!made) return;
    const div = document.getElementById(plot.id), [traces, shape, what, told] = made;
    plot.section.querySelector("h2").textContent = what ? `${plot.heading}: ${what}` : plot.heading;
    plot.section.querySelector(".caption").textContent = told || "";
    const old = div.layout;
    // On a narrow screen the legend stands below, a row for nearly each name: it takes no room from the plot.
    const named_ = traces.filter(trace => trace.showlegend !== false).length;
    if (narrow() && plot.id !== "signals") div.style.height = `${(plot.low ? 17 : 21) + 1.15 * Math.max(0, named_ - 2)}rem`;
    if (old && before) ["xaxis", "yaxis"].forEach((name, i) => {
      if (plot.zoomed && old[name]) {
        const ratio = unitOf(plot.kinds[i], chosen) / unitOf(plot.kinds[i], before);
        shape[name] = { ...shape[name], range: old[name].range.map(v => v * ratio) };
      }
    });
    const hidden = {};
    for (const trace of div.data || []) if (trace.visible === "legendonly") hidden[trace.name] = true;
    for (const trace of traces) if (hidden[trace.name]) trace.visible = "legendonly";
    Plotly.react(div, traces, shape, config);
    if (!old) div.on("plotly_relayout", change => {
      if (Object.keys(change).some(key => key.includes(".range["))) plot.zoomed = true;
      if (Object.keys(change).some(key => key.includes("autorange"))) plot.zoomed = false;
    });
  }
  const named = (...ids) => plots.filter(plot => ids.includes(plot.id));

  // Tables: each number that has a unit in the one chosen; its digits are those of the summary.
  function tables() {
    for (const cell of document.querySelectorAll("#answers td[data-kind]")) {
      const kind = cell.dataset.kind;
      if (UNITS[kind]) cell.textContent = +(cell.dataset.value * unit(kind)[0]).toPrecision(cell.dataset.digits) + (cell.dataset.bound || "");
    }
    for (const cell of document.querySelectorAll("#answers .unit[data-kind]")) {
      if (!UNITS[cell.dataset.kind]) continue;
      const before = cell.textContent, name = cell.textContent = unit(cell.dataset.kind)[1].split(" =")[0];
      const column = cell.parentElement.cellIndex + 1;
      for (const one of cell.closest("table").querySelectorAll(`tbody td:nth-child(${column})`))
        one.dataset.label = one.dataset.label.slice(0, -before.length) + name;
    }
  }
  function clock() {
    document.getElementById("now").textContent = `${+to("time", [frameTime()])[0].toPrecision(4)} ${short("time")}`;
  }

  await Promise.all(packed.map(inflated));
  build();
  clock();
  // One after the other, so that what stands first can be read before the rest is drawn.
  const waiting = [...plots];
  const next = () => { const plot = waiting.shift(); if (plot) { draw(plot); setTimeout(next, 0); } else document.body.dataset.drawn = "all"; };
  next();

  document.getElementById("controls").addEventListener("change", event => {
    const before = { ...chosen };
    if (event.target.id === "sector") {
      state.sector = event.target.value;
      for (const plot of plots) plot.zoomed = false;
      fields();
    } else chosen[event.target.name] = event.target.value;
    tables();
    clock();
    for (const plot of plots) draw(plot, before);
  });
  document.getElementById("controls").addEventListener("submit", event => event.preventDefault());
  const frame = document.getElementById("frame");
  function moveTo(n) {
    state.frame = n;
    frame.value = n;
    clock();
    for (const plot of named("snapshot")) draw(plot, chosen);
    const div = document.getElementById("spacetime");
    const at_ = (div.layout ? div.layout.shapes : []).findIndex(s => s.name === "now");
    const [now] = to("time", [frameTime()]);
    if (at_ >= 0) Plotly.relayout(div, { [`shapes[${at_}].y0`]: now, [`shapes[${at_}].y1`]: now });
  }
  frame.addEventListener("input", () => moveTo(+frame.value));
  document.getElementById("field").addEventListener("change", event => {
    state.field = event.target.value;
    for (const plot of named("snapshot", "signals")) draw(plot, chosen);
  });
  document.getElementById("grow").addEventListener("change", () => named("snapshot").forEach(plot => draw(plot, chosen)));
  let playing = 0;
  document.getElementById("play").addEventListener("click", event => {
    if (playing) { clearInterval(playing); playing = 0; event.target.textContent = "play"; return; }
    event.target.textContent = "stop";
    playing = setInterval(() => moveTo((state.frame + 1) % data.snapshots.t.length), 120);
  });
  // On paper everything is open.
  let opened = [];
  window.addEventListener("beforeprint", () => {
    opened = [...document.querySelectorAll("details:not([open])")];
    for (const one of opened) one.open = true;
    for (const plot of plots) { const div = document.getElementById(plot.id); if (div.data) Plotly.relayout(div, { width: 680 }); }
  });
  window.addEventListener("afterprint", () => {
    for (const one of opened) one.open = false;
    for (const plot of plots) { const div = document.getElementById(plot.id); if (div.data) Plotly.relayout(div, { width: null, autosize: true }); }
  });
})();
