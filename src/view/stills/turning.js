// Draws the plan to be turned: triangles with a depth buffer of its own on a canvas, so that every browser shows the same.
addEventListener("DOMContentLoaded", () => {
  "use strict";
  const figure = document.querySelector(".turning");
  const [canvas, words] = ["canvas", "span"].map(name => figure.querySelector(name));
  const { parts, scenes } = JSON.parse(document.querySelector("script[type='application/json']").textContent);
  const captions = [...document.querySelectorAll(".still figcaption")];
  const paper = canvas.getContext("2d");
  const FINENESS = 2, START = { azimuth: -1.2, elevation: 0.33, zoom: 1 };
  let scene = 0, eye = { ...START }, waits = false;

  const placed = (part, index) => {
    const m = part.poses[Math.min(index, part.poses.length - 1)];
    const row = (p, r) => (m[r] * p[0] + m[r + 1] * p[1] + m[r + 2] * p[2]) / 1e4 + m[9 + r / 3];
    return part.points.map(p => [row(p, 0), row(p, 3), row(p, 6)]);
  };
  // Each part in each scene.
  const world = scenes.map((_, index) => parts.map(part => placed(part, index)));
  const everything = [...world.flat(2), ...scenes.flatMap(each => [each.tool, each.arrow_end, ...each.sight || []])];
  const side = (axis, pick) => everything.reduce((found, point) => pick(found, point[axis]), everything[0][axis]);
  const box = [0, 1, 2].map(axis => [side(axis, Math.min), side(axis, Math.max)]);
  const middle = box.map(([low, high]) => (low + high) / 2);
  // How far each point is from the upright axis in the middle, and above or below the middle (mm).
  const rims = everything.map(([x, y, z]) => [Math.hypot(x - middle[0], y - middle[1]), Math.abs(z - middle[2])]);
  const farthest = of => rims.reduce((most, rim) => Math.max(most, of(rim)), 1);
  const radius = farthest(([across]) => across);

  // Where a point is seen, all along parallel lines: pixels to the right and down, and how near it is (mm).
  const camera = () => {
    const [ca, sa, ce, se] = [Math.cos(eye.azimuth), Math.sin(eye.azimuth), Math.cos(eye.elevation), Math.sin(eye.elevation)];
    // However it is turned about the axis, all is in the picture.
    const height = farthest(([across, up]) => ce * up + se * across);
    const scale = 0.48 * Math.min(canvas.width / radius, canvas.height / height) * eye.zoom;
    return point => {
      const [x, y, z] = point.map((value, axis) => value - middle[axis]);
      const out = ca * x + sa * y;
      return [canvas.width / 2 + (ca * y - sa * x) * scale, canvas.height / 2 - (ce * z - se * out) * scale, ce * out + se * z];
    };
  };

  const line = (from, to, colour, width, dash) => {
    paper.strokeStyle = colour;
    paper.lineWidth = width * FINENESS;
    paper.setLineDash((dash || []).map(length => length * FINENESS));
    paper.beginPath();
    paper.moveTo(from[0], from[1]);
    paper.lineTo(to[0], to[1]);
    paper.stroke();
  };

  const floor = see => {
    const reach = 4 * Math.ceil(radius / 1000) + 2;
    for (let at = -reach; at <= reach; at++) {
      const [low, high] = [-reach, reach].map(end => end * 500);
      line(see([at * 500, low, 0]), see([at * 500, high, 0]), "rgb(128 140 152 / .35)", 0.7);
      line(see([low, at * 500, 0]), see([high, at * 500, 0]), "rgb(128 140 152 / .35)", 0.7);
    }
  };

  const cross = (a, b) => [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
  const robot = see => {
    const [width, height] = [canvas.width, canvas.height];
    const picture = new ImageData(width, height), pixels = new Uint32Array(picture.data.buffer);
    const depth = new Float32Array(width * height).fill(-Infinity);
    // Light from the viewer's left shoulder.
    const [ca, sa] = [Math.cos(eye.azimuth + 0.6), Math.sin(eye.azimuth + 0.6)];
    parts.forEach((part, index) => {
      const points = world[scene][index], seen = points.map(see);
      for (const [i, j, k] of part.triangles) {
        const [a, b, c] = [seen[i], seen[j], seen[k]];
        const area = (b[0] - a[0]) * (c[1] - a[1]) - (b[1] - a[1]) * (c[0] - a[0]);
        if (area >= 0) continue; // Seen from behind.
        const edge = to => points[to].map((value, axis) => value - points[i][axis]);
        const normal = cross(edge(j), edge(k));
        const lit = (0.6 * (ca * normal[0] + sa * normal[1]) + 0.75 * normal[2]) / (Math.hypot(...normal) || 1);
        const shade = 0.4 + 0.34 * (1 + lit);
        const [red, green, blue] = part.colour.map(share => Math.min(255, share * shade));
        const colour = 0xff000000 | blue << 16 | green << 8 | red;
        const [top, bottom] = [Math.min(a[1], b[1], c[1]), Math.max(a[1], b[1], c[1])];
        const [left, right] = [Math.min(a[0], b[0], c[0]), Math.max(a[0], b[0], c[0])];
        for (let y = Math.max(0, Math.ceil(top)); y <= Math.min(height - 1, bottom); y++)
          for (let x = Math.max(0, Math.ceil(left)); x <= Math.min(width - 1, right); x++) {
            const u = ((b[0] - x) * (c[1] - y) - (b[1] - y) * (c[0] - x)) / area;
            const v = ((c[0] - x) * (a[1] - y) - (c[1] - y) * (a[0] - x)) / area;
            const w = 1 - u - v;
            if (u < 0 || v < 0 || w < 0) continue;
            const near = u * a[2] + v * b[2] + w * c[2], at = y * width + x;
            if (near > depth[at]) [depth[at], pixels[at]] = [near, colour];
          }
      }
    });
    const sheet = Object.assign(document.createElement("canvas"), { width, height });
    sheet.getContext("2d").putImageData(picture, 0, 0);
    paper.drawImage(sheet, 0, 0);
  };

  const marks = see => {
    const { tool, arrow_end, sight, is_gauge } = scenes[scene];
    if (sight && !is_gauge) line(...sight.map(see), "#0f9d63", 1.2, [5, 3]);
    arrow(...[tool, arrow_end].map(see), "#d32f2f", 3);
    if (is_gauge) arrow(...sight.map(see), "#0f9d63", 2.4);
  };

  const arrow = (from, to, colour, width) => {
    const length = Math.hypot(to[0] - from[0], to[1] - from[1]);
    if (length <= FINENESS) return;
    const [x, y] = [0, 1].map(axis => (to[axis] - from[axis]) / length * 11 * FINENESS);
    line(from, [to[0] - x, to[1] - y], colour, width);
    paper.fillStyle = colour;
    paper.beginPath();
    paper.moveTo(to[0], to[1]);
    paper.lineTo(to[0] - x - 0.42 * y, to[1] - y + 0.42 * x);
    paper.lineTo(to[0] - x + 0.42 * y, to[1] - y - 0.42 * x);
    paper.fill();
  };

  const draw = () => {
    waits = false;
    if (canvas.clientWidth === 0) return; // Not there, as in print.
    canvas.width = Math.round(Math.min(canvas.clientWidth, 1200) * FINENESS);
    canvas.height = Math.round(canvas.width * 0.5);
    const see = camera();
    floor(see);
    robot(see);
    marks(see);
    words.replaceChildren(...captions[scene].cloneNode(true).childNodes);
  };
  const redraw = () => {
    if (!waits) requestAnimationFrame(draw);
    waits = true;
  };
  const turn = (azimuth, elevation, zoom = 1) => {
    eye.azimuth += azimuth;
    eye.elevation = Math.min(1.5, Math.max(0.02, eye.elevation + elevation));
    eye.zoom = Math.min(6, Math.max(0.4, eye.zoom * zoom));
    redraw();
  };
  const step = by => {
    scene = (scene + by + scenes.length) % scenes.length;
    draw();
  };

  canvas.addEventListener("pointerdown", event => canvas.setPointerCapture(event.pointerId));
  canvas.addEventListener("pointermove", event => {
    if (event.buttons) turn(-event.movementX * 0.008, event.movementY * 0.008);
  });
  canvas.addEventListener("dblclick", () => { eye = { ...START }; redraw(); });
  canvas.addEventListener("keydown", event => {
    const turns = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.1], ArrowDown: [0, -0.1], "+": [0, 0, 1.2], "-": [0, 0, 1 / 1.2] };
    if (!turns[event.key]) return;
    event.preventDefault();
    turn(...turns[event.key]);
  });
  const [previous, next] = figure.querySelectorAll("button");
  previous.addEventListener("click", () => step(-1));
  next.addEventListener("click", () => step(1));
  addEventListener("resize", redraw);
  figure.hidden = false;
  draw();
});
