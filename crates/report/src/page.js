// Plots the figures of the page with Plotly: the path of the tool in space, and charts whose zoom, runs and cursor are linked.
"use strict";
(() => {
  const DASHES = ["solid", "8px,4px", "2px,3px", "8px,3px,2px,3px", "18px,5px", "12px,3px,2px,3px,2px,3px"];
  const MARKERS = ["circle", "square", "x", "cross"];
  const MANY = 300;
  const PANEL = 150, PANEL_ALONE = 300, GAP = 18, PRINTED_WIDTH = 690;
  const VIEWS = {
    "3D": { x: 1.1, y: -1.5, z: 1.1 },
    Top: { x: 0, y: -0.001, z: 2.2 },
    Front: { x: 0, y: -2.2, z: 0 },
    Side: { x: 2.2, y: 0, z: 0 },
  };
  const CONFIG = { responsive: true, displaylogo: false, displayModeBar: innerWidth > 760 ? "hover" : false, modeBarButtonsToRemove: ["lasso2d", "select2d", "autoScale2d"] };

  // Margin beside a plot, with room for the tool bar.
  const RIGHT = CONFIG.displayModeBar ? 36 : 14;

  const figures = [...document.querySelectorAll("figure")].map(element => {
    const data = JSON.parse(element.querySelector("script").textContent);
    return { element, data, plot: element.querySelector(".plot"), isDrawn: false };
  });
  const space = figures.find(figure => figure.data.form === "path");
  const overTime = figures.filter(figure => figure.data.form === "time");
  const hidden = new Set();
  const screen = { isPrinting: false, overPath: false, cursor: null };

  const color = name => getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  // Plotly takes texts as HTML.
  const plain = text => String(text).replace(/&/g, "&amp;").replace(/</g, "&lt;").replace(/>/g, "&gt;");
  const digits = (value, unit) => value === null || value === undefined ? "–" : `${Number(value.toPrecision(4))} ${unit}`;
  const range = values => values.reduce(([low, high], v) => v === null ? [low, high] : [Math.min(low, v), Math.max(high, v)],
    [Infinity, -Infinity]);
  // Cuts the text of a label before its unit, where the titles of panels stand above each other.
  const cut = label => {
    const [, text, unit = ""] = label.match(/^(.*?)( \([^()]*\))?$/s);
    return (text.length > 24 ? text.slice(0, 23) + "…" : text) + unit;
  };
  const isInside = (value, low, high) => low === null || low === undefined || (value >= low && value <= high);
  const isShown = run => run === null || run === undefined || !hidden.has(run);

  function base(margin) {
    const { width } = screen.isPrinting ? { width: PRINTED_WIDTH } : {};
    return {
      width, autosize: !width, margin, uirevision: "page", hovermode: "closest",
      paper_bgcolor: "rgba(0,0,0,0)", plot_bgcolor: color("area"),
      font: { family: getComputedStyle(document.body).fontFamily, size: 12, color: color("muted") },
      legend: { orientation: "h", x: 0, y: 1, yanchor: "bottom", font: { color: color("ink") } },
      modebar: { orientation: "v", bgcolor: color("page"), color: color("zero"), activecolor: color("ink") },
      hoverlabel: { bgcolor: color("page"), bordercolor: color("rule"), font: { color: color("ink") }, namelength: 40 },
    };
  }

  // Charts

  function pathPosition(run, time) {
    const { time: times, path } = space.data.runs.find(one => one.run === run) ?? space.data.runs[0];
    let [low, high] = [0, times.length - 1];
    while (high - low > 1) {
      const middle = (low + high) >> 1;
      if (times[middle] <= time) low = middle; else high = middle;
    }
    const step = times[high] - times[low];
    const part = step > 0 ? Math.min(Math.max((time - times[low]) / step, 0), 1) : 0;
    return path[low] + part * (path[high] - path[low]);
  }

  function chart(data) {
    const { panels, x } = data, isTime = data.form === "time";
    const isOverPath = isTime && screen.overPath;
    const at = (run, values) => isOverPath ? values.map(v => v === null ? null : pathPosition(run, v)) : values;
    const plotted = panels.length > 1 ? panels.length * (PANEL + GAP) - GAP : PANEL_ALONE;
    const layout = {
      ...base({ l: 66, r: RIGHT, t: 10, b: 46 }), height: plotted + 96, shapes: [], annotations: [],
      hovermode: data.form === "plain" ? "closest" : "x unified", hoversubplots: "axis",
      xaxis: axis(x, { anchor: panels.length > 1 ? `y${panels.length}` : "y", showspikes: true, spikemode: "across",
        spikethickness: 1, spikecolor: color("zero"), spikedash: "solid", hoverformat: ".5~g", ...inUnit(isOverPath ? "mm" : x.unit) }),
    };
    if (isOverPath) Object.assign(layout.xaxis, { title: { text: "Path position (mm)" }, autorange: true, range: undefined });
    // Time and path position have no zoom in common.
    if (isOverPath) layout.uirevision = "path";
    const traces = [], names = new Set();
    const legend = (name, look = "") => {
      const key = name + look;
      return { name: plain(name), legendgroup: key, showlegend: name !== "" && !names.has(key) && !!names.add(key) };
    };
    panels.forEach((panel, i) => {
      const id = i === 0 ? "" : String(i + 1);
      const top = 1 - i * (PANEL + GAP) / plotted, bottom = panels.length > 1 ? top - PANEL / plotted : 0;
      const values = range(panel.series.flatMap(series => series.y));
      layout[`yaxis${id}`] = axis(panel.y, { domain: [Math.max(bottom, 0), top], hoverformat: ".4~g" }, values);
      for (const series of panel.series) traces.push({ ...line(series, legend), x: at(series.run, series.x), yaxis: `y${id}`,
        ...(panels.length > 1 && { hovertemplate: `${plain(cut(panel.y.label))} %{y:.4~g}` }) });
      if (panel.series.every(series => series.y.every(v => v === null)))
        layout.annotations.push({ text: "no values", showarrow: false, xref: "paper", yref: "paper", x: 0.5, y: (top + bottom) / 2 });
      for (const band of panel.bands) for (const [y0, y1] of band.ends)
        layout.shapes.push({ ...shade(band), ...legend(band.label), xref: "paper", x0: 0, x1: 1, yref: `y${id}`, y0, y1 });
      for (const { at, label } of panel.lines) {
        // Beside the rising points of a friction law, both ends are free.
        const isUpper = panel.lines.every(other => other.at <= at), side = isUpper ? 0 : 1;
        layout.shapes.push({ ...guide(), xref: "paper", x0: 0, x1: 1, yref: `y${id}`, y0: at, y1: at });
        if (label) layout.annotations.push({ text: plain(label), showarrow: false, xref: "paper", x: side, xanchor: side ? "right" : "left", yref: `y${id}`,
          y: panel.y.log ? Math.log10(at) : at, yanchor: isUpper ? "bottom" : "top", bgcolor: color("area"), borderpad: 1, font: { color: color("ink") } });
      }
    });
    if (panels.length > 0 && data.bands.length > 0) {
      layout.yaxis99 = { domain: [0, 1], range: [0, 1], visible: false, fixedrange: true, overlaying: "y" };
      for (const band of data.bands) {
        const ends = band.ends.map(pair => at(null, pair));
        traces.push({ ...legend(band.label), x: ends.flatMap(([a, b]) => [a, a, b, b, null]), y: ends.flatMap(() => [0, 1, 1, 0, null]),
          yaxis: "y99", mode: "none", fill: "toself", fillcolor: color(band.class) + "30", hoverinfo: "skip" });
      }
    }
    for (const { at, label } of data.lines)
      layout.shapes.push({ ...guide(), yref: "paper", y0: 0, y1: 1, x0: at, x1: at, label: { text: plain(label),
        textposition: "end", textangle: 0, xanchor: "left", yanchor: "top", padding: 6, font: { color: color("ink") } } });
    if (isTime && screen.cursor) {
      const x = at(screen.cursor.run, [screen.cursor.time])[0];
      layout.shapes.push({ type: "line", yref: "paper", y0: 0, y1: 1, x0: x, x1: x, line: { color: color("ink"), width: 1.5, dash: "dot" } });
    }
    return { traces, layout };
  }

  // The box under the pointer has the unit, and of the ticks the last one at most.
  const inUnit = unit => unit ? { ticksuffix: ` ${unit}`, showticksuffix: "last" } : {};

  function axis(data, more, values) {
    const isStacked = more.domain?.[1] - more.domain?.[0] < 1, label = isStacked ? cut(data.label) : data.label;
    const result = { title: { text: plain(label), standoff: 8, font: { size: label.length > 22 && isStacked ? 10 : 12 } }, gridcolor: color("grid"), zerolinecolor: color("zero"),
      linecolor: color("rule"), showline: true, mirror: true, ticks: "outside", tickcolor: color("rule"), automargin: true,
      exponentformat: data.log ? "none" : "power", type: data.log ? "log" : "linear", rangemode: data.zero ? "tozero" : "normal", ...more };
    if (data.from !== null) result.range = [data.from, data.to].map(end => data.log ? Math.log10(end) : end);
    else if (values && !data.log && values[1] - values[0] < data.least) {
      const middle = (values[0] + values[1]) / 2 || 0;
      result.range = [middle - data.least / 2, middle + data.least / 2];
    }
    return result;
  }

  function line(series, legend) {
    const { kind, style, run, errors } = series, hue = kind === "commanded" ? color("setpoint") : color(`run-${style % 6 + 1}`);
    const trace = { type: "scatter", ...legend(series.label, kind + style), y: series.y, meta: run, visible: isShown(run) };
    if (kind === "points") {
      const few = series.y.length <= MANY;
      const marker = { color: hue, symbol: MARKERS[style % 4], size: few ? 8 : 4, opacity: few ? 1 : 0.6 };
      return { ...trace, mode: "markers", marker,
        error_y: errors.length ? { type: "data", array: errors, color: hue, thickness: 1.2, width: 3 } : undefined };
    }
    return { ...trace, mode: "lines", line: { color: hue, width: kind === "commanded" ? 4 : 1.6, simplify: true,
      dash: kind === "line" ? DASHES[style % 6] : "solid", shape: kind === "steps" ? "hv" : "linear" } };
  }

  const shade = band => ({ type: "rect", layer: "below", line: { width: 0 }, fillcolor: color(band.class) + "30" });
  const guide = () => ({ type: "line", line: { color: color("ink"), width: 1.2, dash: "7px,3px,2px,3px" } });

  // Circles: the deviation is magnified about the nominal radius.

  function circle(data) {
    const [panel] = data.panels, unit = panel.y.unit;
    const shown = panel.series.filter(series => isShown(series.run));
    const [low, high] = range([0, ...shown.flatMap(series => series.y)]);
    const step = roundStep((high - low || 1) / 4), first = Math.floor(low / step) * step, last = Math.ceil(high / step) * step;
    const radius = value => 0.3 + 0.7 * (value - first) / (last - first || 1);
    const point = (value, angle) => [radius(value) * Math.cos(angle), radius(value) * Math.sin(angle)];
    const layout = { ...base({ l: 20, r: RIGHT, t: 10, b: 20 }), height: 480, plot_bgcolor: "rgba(0,0,0,0)", shapes: [],
      annotations: [], xaxis: { visible: false, range: [-1.18, 1.18] }, yaxis: { visible: false, range: [-1.18, 1.18], scaleanchor: "x" } };
    // The curves are drawn over the scale.
    const scale = { type: "scatter", mode: "text", x: [], y: [], text: [], textposition: "top center", hoverinfo: "skip", showlegend: false };
    for (let k = 0; first + k * step <= last + step / 2; k++) {
      const value = first + k * step, r = radius(value), isNominal = Math.abs(value) < step / 2, [x, y] = point(value, 1.18);
      layout.shapes.push({ type: "circle", layer: "below", x0: -r, x1: r, y0: -r, y1: r,
        line: isNominal ? { color: color("ink"), width: 2 } : { color: color("rule"), width: 1 } });
      scale.x.push(x);
      scale.y.push(y);
      scale.text.push(`${Number(value.toPrecision(6))} ${unit}`.replace("-", "−"));
    }
    const [a, b] = data.axes.map(plain);
    [[`+${a}`, 1.1, 0], [`+${b}`, 0, 1.1], [`−${a}`, -1.1, 0], [`−${b}`, 0, -1.1]].forEach(([text, x, y]) =>
      layout.annotations.push({ text, x, y, showarrow: false, font: { color: color("ink"), size: 14 } }));
    const names = new Set();
    const legend = name => ({ name: plain(name), showlegend: !names.has(name) && !!names.add(name) });
    const traces = panel.series.map((series, i) => {
      const points = series.y.map((value, k) => value === null || series.x[k] === null ? [null, null] : point(value, series.x[k] * Math.PI / 180));
      const second = panel.series.findIndex(other => other.run === series.run) !== i;
      const trace = line(series, legend);
      if (second) trace.line.dash = "5px,3px";
      return { ...trace, x: points.map(p => p[0]), y: points.map(p => p[1]),
        text: series.y.map((value, k) => `${digits(value, unit)} at ${digits((series.x[k] ?? 0) % 360, "°")}`), hoverinfo: "text+name" };
    });
    return { traces: [scale, ...traces], layout };
  }

  function roundStep(value) {
    const power = 10 ** Math.floor(Math.log10(value));
    return power * [1, 2, 5, 10].find(factor => factor * power >= value * 0.999);
  }

  // Path in space

  const shownPoint = (one, i) => [0, 1, 2].map(axis => {
    const [r, d] = [one.reference[axis][i], one.deviation[axis][i]];
    return r === null || d === null ? null : r + space.magnification * d;
  });

  function hoverText(one, i) {
    const number = one.lines[i], text = number ? `line ${number}: ${plain(space.data.texts[number] ?? "")}<br>` : "";
    const feed = one.feed.length ? `<br>feed ${digits(one.feed[i] && Number(one.feed[i].toFixed(4)), "m/min")}${one.rapid[i] ? ", rapid traverse" : ""}` : "";
    const title = space.data.runs.length > 1 ? `${plain(one.title)}<br>` : "";
    return `${title}${text}${digits(one.time[i], "s")}, contour error ${digits(one.error[i], "µm")}${feed}`;
  }

  // Returns the points of the segments of a kind, separated by gaps.
  function segments(one, isOfKind, point) {
    const found = { x: [], y: [], z: [], text: [], color: [], index: [] };
    const add = (position, i) => {
      ["x", "y", "z"].forEach((name, axis) => found[name].push(position[axis]));
      found.text.push(i === null ? "" : hoverText(one, i));
      found.color.push(i === null ? 0 : Math.log10(Math.max(one.error[i] ?? 0, 1e-6)));
      found.index.push(i);
    };
    for (let i = 1; i < one.time.length; i++) {
      if (!isOfKind(i)) continue;
      if (found.index.at(-1) !== i - 1) { add([null, null, null], null); add(point(i - 1), i - 1); }
      add(point(i), i);
    }
    return found;
  }

  const isRapid = one => i => one.rapid.length > 0 && one.rapid[i] === 1;
  const isCut = one => i => !isRapid(one)(i);

  // Returns the ranges of the feed motions, or of all if there are none.
  function bounds() {
    const all = [];
    for (const kind of space.isWhole ? [() => () => true] : [isCut, () => () => true]) {
      for (const one of space.data.runs.filter(one => isShown(one.run))) {
        for (let i = 1; i < one.time.length; i++) if (kind(one)(i)) all.push(shownPoint(one, i), [0, 1, 2].map(a => one.reference[a][i]));
      }
      if (all.length) break;
    }
    const ranges = [0, 1, 2].map(a => range(all.map(point => point[a]))).map(([low, high]) => low <= high ? [low, high] : [-1, 1]);
    const longest = Math.max(...ranges.map(([low, high]) => high - low), 1e-3);
    return ranges.map(([low, high]) => {
      const room = Math.max(0.04 * longest, (0.16 * longest - (high - low)) / 2);
      return [low - room, high + room];
    });
  }

  function colorScale() {
    const errors = space.data.runs.flatMap(one => one.error.filter((e, i) => e > 0 && isCut(one)(i)));
    const [least, most] = range(errors.length ? errors : [0.1, 1]);
    const high = Math.log10(most), low = Math.max(Math.log10(least), high - 3, -3) - 1e-3;
    const ticks = [];
    for (let power = Math.floor(low); power <= high; power++)
      for (const factor of high - low > 2 ? [1] : [1, 2, 5]) ticks.push(Number((factor * 10 ** power).toPrecision(3)));
    const bar = isNarrow() ? { orientation: "h", y: hasSpace ? 0 : -0.2, yanchor: hasSpace ? "bottom" : "top", len: 0.9 } : { x: 0.92, len: 0.7 };
    return { cmin: Math.min(low, high - 0.3), cmax: high, colorscale: [[0, color("low")], [0.5, color("middle")], [1, color("high")]],
      colorbar: { title: { text: "error (µm)", side: isNarrow() ? "top" : "right" }, tickvals: ticks.map(Math.log10), ticktext: ticks.map(String), thickness: 12,
        outlinewidth: 0, ...bar } };
  }

  const isNarrow = () => space.plot.clientWidth < 500;

  // Returns the ticks of an axis of the path: few where it is short, but two at least; the last one has its name.
  function coordinates(name, [low, high], longest) {
    let step = roundStep((high - low) / Math.max(1, Math.round((isNarrow() ? 4 : 6) * (high - low) / longest)));
    const count = () => Math.floor(high / step) - Math.ceil(low / step) + 1, isShort = count() < 2;
    while (count() < 2) step = roundStep(step / 2.6);
    const tickvals = [];
    for (let k = Math.ceil(low / step); k * step <= high; k++) tickvals.push(Number((k * step).toPrecision(12)));
    // Of a short axis, the ends only: the numbers between them would overlap.
    if (isShort) tickvals.splice(1, tickvals.length - 2);
    return { tickvals, ticktext: tickvals.map((value, k) => (k === tickvals.length - 1 ? `${name} ` : "") + String(value).replace("-", "−")) };
  }

  // Returns the edge of the cube of the longest coordinate with which the path fills the plot in the chosen view.
  function edge(spans, longest, height) {
    const { x, y, z } = VIEWS[space.view], across = Math.hypot(x, y), all = Math.hypot(x, y, z), [a, b, c] = spans.map(span => span / longest);
    const width = (a * Math.abs(y) + b * Math.abs(x)) / across;
    const tall = (a * Math.abs(x) + b * Math.abs(y)) * Math.abs(z) / (across * all) + c * across / all;
    const unit = 0.47 * height;
    return Math.min(0.8 * space.plot.clientWidth / (width * unit), 0.7 * height / (tall * unit));
  }

  function path(data) {
    const scale = colorScale(), ranges = bounds(), spans = ranges.map(([low, high]) => high - low);
    const longest = Math.max(...spans), traces = [];
    for (const one of data.runs) {
      const visible = isShown(one.run), plotted = { type: "scatter3d", mode: "lines", meta: one.run, visible, hoverinfo: "text", showlegend: false };
      const point = i => shownPoint(one, i), onPath = i => [0, 1, 2].map(axis => one.reference[axis][i]);
      // Of a long program, the way to the first point of a cut has left out points of both.
      const isOnRapid = i => isRapid(one)(i) || isRapid(one)(i - 1), isOnCut = i => !isOnRapid(i);
      if (space.magnification > 1) traces.push({ ...plotted, ...segments(one, isOnCut, onPath), line: { color: color("zero"), width: 2 } });
      const isInBox = i => point(i).every((value, axis) => isInside(value, ...ranges[axis]));
      const isShownRapid = i => isOnRapid(i) && (space.isWhole || (isInBox(i - 1) && isInBox(i)));
      if (one.rapid.includes(1)) traces.push({ ...plotted, ...segments(one, isShownRapid, point), line: { color: color("muted"), width: 2, dash: "dash" } });
      const cuts = segments(one, isOnCut, point);
      traces.push({ ...plotted, ...cuts, line: { ...scale, color: cuts.color, width: 5, showscale: one === data.runs[0] } });
      const start = point(0);
      traces.push({ ...plotted, mode: "markers", x: [start[0]], y: [start[1]], z: [start[2]], text: ["start"],
        marker: { size: 5, symbol: "circle-open", color: color("ink") } });
    }
    const annotations = [];
    if (screen.cursor) {
      const { run, index } = screen.cursor, one = data.runs.find(one => one.run === run), [x, y, z] = shownPoint(one, index);
      traces.push({ type: "scatter3d", mode: "markers", x: [x], y: [y], z: [z], text: [hoverText(one, index)], hoverinfo: "text",
        showlegend: false, marker: { size: 8, color: color("ink"), symbol: "diamond-open" } });
      annotations.push({ x, y, z, text: one.lines[index] ? `line ${one.lines[index]}` : digits(one.time[index], "s"), ax: 30, ay: -40,
        arrowcolor: color("ink"), font: { color: color("ink"), size: 13 }, bgcolor: color("page"), bordercolor: color("rule") });
    }
    const away = ["Side", "Front", "Top"].indexOf(space.view);
    const sceneAxis = (name, i) => ({ title: { text: "" }, range: ranges[i], gridcolor: color("rule"), zeroline: false, showspikes: false,
      showbackground: false, color: color("muted"), tickfont: { size: 11 }, showticklabels: i !== away, ...coordinates(name, ranges[i], longest) });
    const height = isNarrow() ? 360 : 430, low = isNarrow() ? 0.17 : 0, size = edge(spans, longest, (1 - low) * height);
    const ratio = spans.map(span => size * span / longest);
    const layout = { ...base({ l: 0, r: isNarrow() ? 0 : RIGHT, t: 0, b: 0 }), height, scene: { domain: { y: [low, 1] },
      xaxis: sceneAxis("X", 0), yaxis: sceneAxis("Y", 1), zaxis: sceneAxis("Z", 2), aspectmode: "manual",
      aspectratio: { x: ratio[0], y: ratio[1], z: ratio[2] }, annotations, dragmode: "turntable",
      camera: { eye: VIEWS[space.view], up: { x: 0, y: 0, z: 1 }, center: { x: 0, y: 0, z: 0 }, projection: { type: "orthographic" } },
      uirevision: space.view + space.isWhole } };
    return { traces, layout };
  }

  // Without WebGL: the two longest coordinates in the plane.
  function flat(data) {
    const { layout, traces } = path(data), ranges = bounds(), names = ["x", "y", "z"];
    const [a, b] = [0, 1, 2].sort((i, j) => (ranges[j][1] - ranges[j][0]) - (ranges[i][1] - ranges[i][0])).slice(0, 2).sort();
    const title = i => ({ label: `${names[i].toUpperCase()} (mm)`, from: ranges[i][0], to: ranges[i][1] });
    return {
      layout: { ...layout, scene: undefined, ...{ margin: { l: 60, r: RIGHT, t: 10, b: 46 } }, xaxis: axis(title(a), {}),
        yaxis: axis(title(b), { scaleanchor: "x" }) },
      traces: traces.map(trace => ({ ...trace, type: "scatter", z: undefined, x: trace[names[a]], y: trace[names[b]],
        mode: trace.line?.colorscale || trace.mode === "markers" ? "markers" : "lines",
        marker: trace.line?.colorscale ? { ...trace.line, width: undefined, size: 4 } : { color: color("ink"), symbol: "circle-open" },
        line: { color: color("zero"), dash: trace.line?.dash, width: 1.5 } })),
    };
  }

  // Drawing

  const hasSpace = !!document.createElement("canvas").getContext("webgl");
  const FORMS = { plain: chart, time: chart, circle, path: hasSpace ? path : flat };

  function draw(figure) {
    const { traces, layout } = FORMS[figure.data.form](figure.data);
    // A change of the window's width deletes the height of the layout.
    figure.plot.style.height = `${layout.height}px`;
    Plotly.react(figure.plot, traces, layout, CONFIG);
    if (figure.isDrawn) return;
    figure.isDrawn = true;
    describe(figure);
    if (figure.data.form === "time") {
      figure.plot.on("plotly_relayout", change => linkZoom(figure, change));
      figure.plot.on("plotly_click", ({ points: [point] }) => space && !screen.overPath && show(point.data.meta ?? 0, point.x));
    }
    if (figure === space) listenToClicks(figure.plot);
  }

  // A press on the path reports the point under it with each drawing, also at the start of a rotation: only one that ends where
  // it began is a click, and it is shown behind these reports.
  function listenToClicks(plot) {
    let press = null, place = null;
    plot.addEventListener("pointerdown", event => { press = event; place = null; }, true);
    addEventListener("pointerup", event => {
      if (press && Math.hypot(event.clientX - press.clientX, event.clientY - press.clientY) < 4) setTimeout(() => place && showIndex(...place), 50);
      press = null;
    }, true);
    plot.on("plotly_click", ({ points: [point] }) => {
      const index = point.data.index?.[point.pointNumber];
      if (index !== undefined && index !== null) place = [point.data.meta, index];
    });
  }

  const redraw = list => list.filter(figure => figure.isDrawn).forEach(draw);

  // The last zoom that all charts have, which their events repeat.
  let lastZoom = "";
  function linkZoom(from, change) {
    if (!Object.keys(change).some(key => key.startsWith("xaxis."))) return;
    const update = change["xaxis.autorange"] ? { "xaxis.autorange": true } : { "xaxis.range": [...from.plot.layout.xaxis.range] };
    const zoom = JSON.stringify(update);
    if (zoom === lastZoom) return;
    lastZoom = zoom;
    for (const figure of overTime) if (figure !== from && figure.isDrawn) Plotly.relayout(figure.plot, update);
  }

  // Shows the place of a run at a time.
  function show(run, time) {
    const one = space?.data.runs.find(one => one.run === run);
    if (!one) return;
    let nearest = 0;
    one.time.forEach((t, i) => { if (Math.abs(t - time) < Math.abs(one.time[nearest] - time)) nearest = i; });
    showIndex(run, nearest);
  }

  function showIndex(run, index) {
    const one = space.data.runs.find(one => one.run === run);
    screen.cursor = { run, index, time: one.time[index] };
    if (isRapid(one)(index)) showAll();
    redraw([space, ...overTime]);
    // A zoom without the place ends.
    const place = screen.overPath ? pathPosition(run, one.time[index]) : one.time[index];
    const zoomed = overTime.find(({ plot, isDrawn }) => isDrawn && !isInside(place, ...plot.layout.xaxis.range));
    if (zoomed) Plotly.relayout(zoomed.plot, { "xaxis.autorange": true });
    space.note.textContent = hoverText(one, index).replace(/<br>/g, ", ").replace(/&lt;/g, "<").replace(/&gt;/g, ">").replace(/&amp;/g, "&");
  }

  // Shows the whole path, as its button does.
  function showAll() {
    if (!space.isWhole) space.element.querySelector("button.whole")?.click();
  }

  // Text alternatives: the ranges of the values

  function describe({ data, element, plot }) {
    const text = (values, unit) => values.some(v => v !== null) ? `from ${range(values).map(v => digits(v, unit)).join(" to ")}` : "no values";
    const marks = ({ lines, bands }) => [...lines.map(one => one.label), ...bands.map(one => `${one.label} ${one.ends.length} ×`)];
    const parts = data.form === "path"
      ? data.runs.map(one => ["X", "Y", "Z"].map((name, i) => `${name} ${text(one.reference[i], "mm")}`)
        .concat(`contour error ${text(one.error, "µm")}`).join(", "))
      : [...data.panels.map(({ y, series, ...marked }) =>
        [y.label, ...series.map(one => `${one.label} ${text(one.y, y.unit)}`), ...marks(marked)].join(", ")), ...marks(data)];
    plot.setAttribute("aria-label", [element.querySelector(".title").textContent, ...parts].join("; "));
    const outside = (data.panels ?? []).flatMap(({ y, series }) => series.flatMap(one => one.y.filter((v, i) =>
      v !== null && isInside(one.x[i], data.x.from, data.x.to) && !isInside(v, y.from, y.to)))).length;
    if (outside > 0) element.querySelector(".note").append(` ${outside} of the values lie outside the plot; a double click shows them.`);
  }

  // Controls

  function button(label, action, isPressed) {
    const element = Object.assign(document.createElement("button"), { type: "button", textContent: label });
    element.setAttribute("aria-pressed", String(isPressed));
    element.addEventListener("click", () => {
      for (const other of element.parentElement.querySelectorAll("button")) other.setAttribute("aria-pressed", String(other === element));
      action();
    });
    return element;
  }

  function toolbar(label, buttons) {
    const bar = Object.assign(document.createElement("div"), { className: "controls" });
    bar.setAttribute("role", "group");
    bar.setAttribute("aria-label", label);
    bar.append(...buttons);
    return bar;
  }

  function controls() {
    if (space) {
      const { runs, magnification } = space.data, isProgram = runs.some(one => one.lines.length);
      Object.assign(space, { view: "3D", isWhole: false, magnification: isProgram ? 1 : magnification });
      const bars = [toolbar("View", Object.keys(VIEWS).map(name => button(name, () => { space.view = name; draw(space); }, name === "3D")))];
      if (magnification > 1) bars.push(toolbar("Scale of the error", [1, magnification].map(factor => button(factor > 1 ? `error × ${factor}` : "true scale",
        () => { space.magnification = factor; draw(space); }, factor === space.magnification))));
      if (runs.some(one => one.rapid.includes(1))) bars.push(toolbar("Extent", [["cuts", false], ["all", true]].map(([name, isWhole]) =>
        Object.assign(button(name, () => { space.isWhole = isWhole; draw(space); }, !isWhole), { className: isWhole ? "whole" : "" }))));
      space.note = Object.assign(document.createElement("p"), { className: "place", textContent: "" });
      space.note.setAttribute("aria-live", "polite");
      space.plot.before(...bars);
      space.plot.after(space.note);
      if (overTime.length) overTime[0].element.before(toolbar("Horizontal axis", [["over time", false], ["over path", true]].map(([name, overPath]) =>
        button(name, () => { screen.overPath = overPath; redraw(overTime); }, !overPath))));
    }
    const runs = document.querySelector("fieldset.runs");
    if (runs && figures.length) {
      runs.hidden = false;
      runs.addEventListener("change", ({ target }) => {
        if (target.checked) hidden.delete(Number(target.value)); else hidden.add(Number(target.value));
        redraw(figures);
      });
    }
    for (const place of document.querySelectorAll("button[data-time]")) place.addEventListener("click", () => {
      document.querySelectorAll("button[data-time]").forEach(other => other.setAttribute("aria-pressed", String(other === place)));
      show(Number(place.dataset.run), Number(place.dataset.time));
      if (space && space.element.getBoundingClientRect().top < 0) space.element.scrollIntoView();
    });
  }

  // The style sheet has other colors in a dark scheme and on paper.
  function setPrinting(isPrinting) {
    if (screen.isPrinting === isPrinting) return;
    screen.isPrinting = isPrinting;
    document.documentElement.classList.toggle("printing", isPrinting);
    figures.forEach(draw);
  }

  controls();
  const waiting = [...figures];
  const next = () => {
    const figure = waiting.shift();
    if (!figure) { document.documentElement.dataset.plotted = "all"; return; }
    if (!figure.isDrawn) draw(figure);
    setTimeout(next);
  };
  next();
  matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => redraw(figures));
  matchMedia("print").addEventListener("change", ({ matches }) => setPrinting(matches));
  addEventListener("beforeprint", () => setPrinting(true));
  addEventListener("afterprint", () => setPrinting(false));
})();
