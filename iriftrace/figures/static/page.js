"use strict";
// The picture of a page: reads the data block, draws it with three.js, and connects the controls.
(async () => {
  const byId = (id) => document.getElementById(id);
  const all = (selector) => [...document.querySelectorAll(selector)];
  const number = (value) => String(Number(value.toPrecision(4))).replaceAll("-", "\u2212");
  const stage = byId("stage"), canvas = byId("picture"), under = byId("under");
  // Shade of the darkest slope, of numbers and of bodies; pixels around the pointer that are drawn
  // to read one, as a point is drawn only where its middle is.
  const DARKEST = { values: "0.86", body: "0.38" }, AROUND = 24;

  // ---- data: a JSON header and arrays as byte planes ------------------------------------------
  const packed = Uint8Array.from(atob(byId("data").textContent), (c) => c.charCodeAt(0));
  const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
  const bytes = new Uint8Array(await new Response(stream).arrayBuffer());
  const length = new DataView(bytes.buffer).getUint32(0, true);
  const data = JSON.parse(new TextDecoder().decode(bytes.subarray(4, 4 + length)));

  function unpack({ at, count, kind }) {
    const size = kind === "uint16" ? 2 : 4, whole = new Uint8Array(count * size);
    const start = 4 + length + at;
    for (let plane = 0; plane < size; plane++)
      for (let i = 0; i < count; i++) whole[i * size + plane] = bytes[start + plane * count + i];
    if (kind === "float32") return new Float32Array(whole.buffer);
    const values = size === 2 ? new Uint16Array(whole.buffer) : new Uint32Array(whole.buffer);
    for (let i = 1; i < count; i++) values[i] += values[i - 1];
    return values;
  }

  function points(place) {
    const whole = unpack(place), n = whole.length / 3, found = new Float32Array(3 * n);
    for (let axis = 0; axis < 3; axis++)
      for (let i = 0; i < n; i++)
        found[3 * i + axis] = place.low[axis] + place.step[axis] * whole[axis * n + i];
    return found;
  }

  // ---- renderer and camera: one unit of the camera's plane is one pixel at a zoom of 1 ---------
  let renderer;
  try {
    renderer = new THREE.WebGLRenderer({ canvas, antialias: true, preserveDrawingBuffer: true });
  } catch {
    byId("note").textContent = "This browser has no WebGL 2, which the picture needs.";
    return;
  }
  renderer.setPixelRatio(window.devicePixelRatio);
  const scene = new THREE.Scene(), picking = new THREE.Scene();
  const camera = new THREE.OrthographicCamera();
  camera.up.set(0, 0, 1);
  const controls = new THREE.OrbitControls(camera, canvas);
  const shared = { factor: { value: 0 }, opacity: { value: 1 }, plane: { value: new THREE.Vector4() } };
  shared.cut = { value: data.cut ? 1 : 0 };
  if (data.cut) {
    const [centre, side] = data.cut;
    shared.plane.value.set(...side, side[0] * centre[0] + side[1] * centre[1] + side[2] * centre[2]);
  }

  const VERTEX = `
    in vec3 moved; in float tone; uniform float factor, size, lift;
    flat out uint number; out float shade; out vec3 way; out vec3 place;
    void main() {
      place = position + factor * moved;
      shade = tone;
      way = normalMatrix * normal;
      gl_Position = projectionMatrix * modelViewMatrix * vec4(place, 1.0);
      number = uint(gl_VertexID) / uint(PER);
      gl_PointSize = size;
      gl_Position.z -= lift;
    }`;
  const FRAGMENT = `
    precision highp float; precision highp sampler2D;
    flat in uint number; in float shade; in vec3 way; in vec3 place;
    uniform vec3 colour; uniform sampler2D table; uniform vec4 plane; uniform float cut, opacity, first;
    out vec4 shown;
    void main() {
      #ifdef SHELL
        if (cut > 0.5 && dot(plane.xyz, place) > plane.w) discard;
      #endif
      #ifdef PICK
        uint id = uint(first) + number;
        shown = vec4(float(id & 255u), float((id >> 8) & 255u), float(id >> 16), 255.0) / 255.0;
      #else
        vec3 base = colour;
        #ifdef VALUED
          if (shade >= 0.0) base = texture(table, vec2((0.5 + 255.0 * shade) / 256.0, 0.5)).rgb;
        #endif
        float light = 1.0;
        #if PER == 3
          float facing = max(abs(dot(normalize(way), normalize(vec3(-0.25, 0.4, 0.88)))), 0.0);
          light = mix(DARKEST, 1.06, facing);
        #endif
        shown = vec4(min(base * light, 1.0), opacity);
      #endif
    }`;

  function table(scale) {
    const rgb = scale.colours, rgba = new Uint8Array(1024);
    for (let i = 0; i < 256; i++)
      for (let c = 0; c < 4; c++)
        rgba[4 * i + c] = c < 3 ? parseInt(rgb.slice(6 * i + 2 * c, 6 * i + 2 * c + 2), 16) : 255;
    const texture = new THREE.DataTexture(rgba, 256, 1);
    texture.minFilter = texture.magFilter = THREE.LinearFilter;
    texture.needsUpdate = true;
    return texture;
  }
  const tables = data.scales.map(table);

  function tone(scale, value) {
    const [low, high] = scale.limits, f = scale.logarithmic ? Math.log : (x) => x;
    if (!Number.isFinite(value)) return -1;
    if (scale.logarithmic && value <= 0) return 0;
    return Math.min(Math.max((f(value) - f(low)) / (f(high) - f(low)), 0), 1);
  }

  // Corners of faces have the mean normal of their vertex, unless it is too far from the face's.
  function normals(corners, faces, count) {
    const sums = new Float64Array(3 * count), n = corners.length / 9;
    const flat = new Float32Array(corners.length), smooth = new Float32Array(corners.length);
    for (let face = 0; face < n; face++) {
      const [ax, ay, az, bx, by, bz, cx, cy, cz] = corners.subarray(9 * face, 9 * face + 9);
      const ux = bx - ax, uy = by - ay, uz = bz - az, vx = cx - ax, vy = cy - ay, vz = cz - az;
      const normal = [uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx];
      for (let corner = 0; corner < 3; corner++)
        for (let axis = 0; axis < 3; axis++) {
          flat[9 * face + 3 * corner + axis] = normal[axis];
          sums[3 * faces[3 * face + corner] + axis] += normal[axis];
        }
    }
    for (let i = 0; i < faces.length; i++) {
      const a = flat.subarray(3 * i, 3 * i + 3), b = sums.subarray(3 * faces[i], 3 * faces[i] + 3);
      const near = a[0] * b[0] + a[1] * b[1] + a[2] * b[2] > 0.8 * Math.hypot(...a) * Math.hypot(...b);
      const length = Math.hypot(...(near ? b : a)) || 1;
      for (let axis = 0; axis < 3; axis++) smooth[3 * i + axis] = (near ? b : a)[axis] / length;
    }
    return smooth;
  }

  // ---- objects --------------------------------------------------------------------------------
  const items = [];
  let identifiers = 1;

  function addSurface(surface, more = {}) {
    const vertices = points(surface.vertices), faces = unpack(surface.faces);
    const moved = surface.moved && points(surface.moved);
    const order = surface.points ? null : faces;
    const spread = (array, width) => {
      if (!order) return array;
      const found = new Float32Array(order.length * width);
      for (let i = 0; i < order.length; i++)
        for (let j = 0; j < width; j++) found[i * width + j] = array[order[i] * width + j];
      return found;
    };
    const geometry = new THREE.BufferGeometry(), corners = spread(vertices, 3);
    const set = (name, array, width) => geometry.setAttribute(name, new THREE.BufferAttribute(array, width));
    set("position", corners, 3);
    if (order) set("normal", normals(corners, faces, vertices.length / 3), 3);
    if (moved) set("moved", spread(moved, 3), 3);
    const item = { surface, faces, corners, geometry, ...more, shown: true, meshes: [] };
    item.moved = moved && spread(moved, 3);
    item.count = surface.points ? vertices.length / 3 : faces.length / 3;
    item.first = identifiers;
    const shell = "level" in surface;
    if (surface.values) {
      item.values = surface.values.map(unpack);
      item.u = surface.u && unpack(surface.u);
      item.scale = data.scales[surface.scale];
      set("tone", new Float32Array(corners.length / 3), 1);
    }
    const uniforms = {
      ...shared,
      opacity: shell ? shared.opacity : { value: surface.opacity ?? 1 },
      colour: { value: new THREE.Vector3(...[1, 3, 5].map((i) => parseInt(surface.colour.slice(i, i + 2), 16) / 255)) },
      table: { value: tables[surface.scale ?? 0] ?? null },
      size: { value: 1 }, lift: { value: 0 }, first: { value: item.first },
    };
    item.uniforms = uniforms;
    const transparent = shell || (surface.opacity ?? 1) < 1;
    const defines = { PER: surface.points ? 1 : 3, DARKEST: surface.values ? DARKEST.values : DARKEST.body };
    if (surface.values) defines.VALUED = 1;
    if (shell) defines.SHELL = 1;
    const material = (extra, side) => new THREE.ShaderMaterial({
      glslVersion: THREE.GLSL3, vertexShader: VERTEX, fragmentShader: FRAGMENT, uniforms, side,
      defines: { ...defines, ...extra }, transparent: transparent && !extra.PICK, depthWrite: !transparent,
    });
    const Kind = surface.points ? THREE.Points : THREE.Mesh;
    const put = (to, material, order) => {
      const mesh = new Kind(geometry, material);
      mesh.renderOrder = order;
      mesh.frustumCulled = false;
      to.add(mesh);
      item.meshes.push(mesh);
    };
    if (transparent) {
      // Far sides from the outermost to the innermost, then near sides back to the outermost.
      const place = items.length, far = shell ? place : 500;
      put(scene, material({}, THREE.BackSide), 1000 + far);
      put(scene, material({}, THREE.FrontSide), 3000 - far);
    } else {
      identifiers += item.count;
      put(scene, material({}, THREE.DoubleSide), 0);
      put(picking, material({ PICK: 1 }, THREE.DoubleSide), 0);
    }
    if (surface.edge) item.edge = addLines({ flat: points(surface.edge), colour: surface.colour }, 2.2);
    items.push(item);
    return item;
  }

  const lineMaterials = [];
  // Pairs of points; the paths of a description are cut into these.
  function addLines({ flat, colour }, width) {
    const material = new THREE.LineMaterial({ linewidth: width });
    material.color.set(colour);
    const line = new THREE.LineSegments2(new THREE.LineSegmentsGeometry(), material);
    line.geometry.setPositions(flat);
    line.frustumCulled = false;
    lineMaterials.push(material);
    scene.add(line);
    return line;
  }
  function pairs(flat, counts) {
    const found = [];
    let start = 0;
    for (const count of counts) {
      for (let i = start; i < start + count - 1; i++)
        for (let j = 0; j < 6; j++) found.push(flat[3 * i + j]);
      start += count;
    }
    return new Float32Array(found);
  }

  data.surfaces.forEach((surface) => addSurface(surface));
  const bodies = data.devices.map((device) => {
    const item = addSurface({ ...device, opacity: 1, points: false }, { device: true });
    const sight = pairs(unpack(device.sight.points), device.sight.counts);
    item.sight = sight;
    item.lines = [addLines({ flat: sight, colour: device.colour }, 1.6)];
    item.label = Object.assign(document.createElement("span"), { textContent: device.name });
    item.label.style.color = device.colour;
    byId("labels").append(item.label);
    return item;
  });
  const strings = data.lines.map((lines) => {
    const straight = unpack(lines.points), bend = lines.bend && unpack(lines.bend);
    const flat = pairs(straight, lines.counts);
    const drawn = [addLines({ flat, colour: lines.colour }, 2.2)];
    // Straight ones for comparison, thinner and grey.
    if (bend) drawn.push(addLines({ flat, colour: "#9aa0a6" }, 1.2));
    return { surface: lines, straight, bend, lines: drawn, shown: true, meshes: [] };
  });
  let cones = null, chosen = null, ends = null;
  if (data.poses) {
    cones = addSurface(data.poses.cones, { poses: true });
    ends = unpack(data.poses.ends);
    chosen = addLines({ flat: new Float32Array(6), colour: "#111111" }, 2.6);
    chosen.material.depthTest = false;
    chosen.visible = false;
  }
  const shells = items.filter((item) => "level" in item.surface);
  const target = new THREE.WebGLRenderTarget(2 * AROUND + 1, 2 * AROUND + 1);

  // ---- drawing --------------------------------------------------------------------------------
  let waiting = false, radius = 1;
  const want = () => {
    if (waiting) return;
    waiting = true;
    requestAnimationFrame(() => { waiting = false; draw(); });
  };

  function sizes(ratio) {
    for (const item of items)
      if (item.surface.points) {
        const px = Math.min(Math.max(item.surface.spacing * camera.zoom, 2.5), AROUND);
        item.uniforms.size.value = px * ratio;
        // A point that faces the viewer is not half hidden by the slope that it lies on.
        item.uniforms.lift.value = 4 * Math.max(px / camera.zoom, item.surface.spacing) / (camera.far - camera.near);
      }
  }

  function draw() {
    const width = stage.clientWidth, height = stage.clientHeight;
    if (!width || !height) return;
    if (canvas.clientWidth !== width || canvas.clientHeight !== height || canvas.width < 2) resize();
    sizes(renderer.getPixelRatio());
    renderer.setRenderTarget(null);
    renderer.setClearColor(0xffffff, 1);
    renderer.render(scene, camera);
    overlay(width, height);
    if (!document.documentElement.dataset.drawn)
      document.documentElement.dataset.drawn = (performance.now() / 1000).toFixed(2);
  }

  function resize() {
    const width = stage.clientWidth, height = stage.clientHeight;
    if (!width || !height) return;
    // What is in view stays in view.
    if (canvas.width > 1 && camera.right > 1) camera.zoom *= Math.min(width / 2 / camera.right, height / 2 / camera.top);
    renderer.setSize(width, height);
    // Paper, 640 px wide, shows the stage as it is here.
    for (const [name, value] of [["w", `${width}px`], ["h", `${height}px`], ["zoom", 640 / width]])
      stage.style.setProperty(`--${name}`, value);
    Object.assign(camera, { left: -width / 2, right: width / 2, top: height / 2, bottom: -height / 2 });
    camera.updateProjectionMatrix();
    for (const material of lineMaterials) material.resolution.set(width, height);
  }

  function overlay(width, height) {
    const place = new THREE.Vector3();
    for (const body of bodies) {
      place.fromArray(body.corners, 0).project(camera);
      const [x, y] = [width * (0.5 + place.x / 2), height * (0.5 - place.y / 2) - 34];
      body.label.hidden = !body.shown || x < 0 || y < 0 || x > width - 140 || y > height - 60;
      body.label.style.transform = `translate(${x}px, ${y}px)`;
    }
    const most = 150 / camera.zoom, power = 10 ** Math.floor(Math.log10(most));
    const mm = power * [5, 2, 1].find((step) => step * power <= most);
    byId("ruler").style.width = `${mm * camera.zoom}px`;
    byId("ruler").textContent = `${number(mm)} mm`;
    all("#axes g").forEach((group, axis) => {
      place.set(axis === 0, axis === 1, axis === 2).transformDirection(camera.matrixWorldInverse);
      const [x, y] = [26 * place.x, -26 * place.y];
      group.querySelector("line").setAttribute("x2", x);
      group.querySelector("line").setAttribute("y2", y);
      group.querySelector("text").setAttribute("x", 1.35 * x);
      group.querySelector("text").setAttribute("y", 1.35 * y);
    });
  }

  // ---- view -----------------------------------------------------------------------------------
  function fit(towards, chosenItems) {
    const direction = new THREE.Vector3(...towards).normalize();
    const right = new THREE.Vector3(0, 0, 1).cross(direction);
    if (right.length() < 1e-6) right.set(1, 0, 0);
    right.normalize();
    const up = direction.clone().cross(right), axes = [right, up, direction];
    const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
    const take = (array) => {
      const step = 3 * Math.max(1, Math.floor(array.length / 60000));
      for (let i = 0; i + 2 < array.length; i += step)
        axes.forEach((axis, k) => {
          const along = axis.x * array[i] + axis.y * array[i + 1] + axis.z * array[i + 2];
          low[k] = Math.min(low[k], along);
          high[k] = Math.max(high[k], along);
        });
    };
    chosenItems.forEach((item) => { take(item.corners); take(item.sight ?? []); });
    if (low[0] === Infinity) return;
    if (stage.clientWidth && camera.right !== stage.clientWidth / 2) resize();
    const room = [Math.max(stage.clientWidth - 230, 0.6 * stage.clientWidth), stage.clientHeight - 150];
    camera.zoom = Math.min(...[0, 1].map((k) => Math.max(room[k], 80) / Math.max(high[k] - low[k], 1e-6)));
    const middle = axes.map((_, k) => (low[k] + high[k]) / 2);
    controls.target.set(0, 0, 0);
    axes.forEach((axis, k) => controls.target.addScaledVector(axis, middle[k]));
    camera.position.copy(controls.target).addScaledVector(direction, 10 * radius);
    camera.near = 0;
    camera.far = 20 * radius;
    camera.updateProjectionMatrix();
    controls.update();
    want();
  }
  const inner = items.filter((item) => !item.device && !item.poses);
  const measure = () => {
    const box = [[Infinity, -Infinity], [Infinity, -Infinity], [Infinity, -Infinity]];
    for (const item of items)
      for (let i = 0; i < item.corners.length; i++) {
        const range = box[i % 3], value = item.corners[i];
        if (value < range[0]) range[0] = value;
        if (value > range[1]) range[1] = value;
      }
    radius = Math.hypot(...box.map(([a, b]) => b - a)) || 1;
  };
  const home = () => fit(data.towards, items.filter((item) => item.shown));
  const near = () => {
    const direction = camera.position.clone().sub(controls.target);
    fit(direction.toArray(), inner.length ? inner : items);
  };

  function turn(across, upwards) {
    const offset = camera.position.clone().sub(controls.target), length = offset.length();
    const azimuth = Math.atan2(offset.y, offset.x) + across;
    const elevation = Math.asin(offset.z / length) + upwards;
    const limited = Math.min(Math.max(elevation, -1.55), 1.55);
    camera.position.set(Math.cos(limited) * Math.cos(azimuth), Math.cos(limited) * Math.sin(azimuth), Math.sin(limited))
      .multiplyScalar(length).add(controls.target);
    controls.update();
  }
  const KEYS = {
    ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0),
    ArrowUp: () => turn(0, 0.1), ArrowDown: () => turn(0, -0.1),
    "+": () => zoom(1.2), "=": () => zoom(1.2), "-": () => zoom(1 / 1.2), 0: home, f: near,
    v: () => report(stage.clientWidth / 2, stage.clientHeight / 2),
  };
  const zoom = (factor) => { camera.zoom *= factor; camera.updateProjectionMatrix(); want(); };
  canvas.addEventListener("keydown", (event) => {
    if (!KEYS[event.key] || event.ctrlKey || event.metaKey) return;
    KEYS[event.key]();
    event.preventDefault();
  });

  // ---- value under the pointer ----------------------------------------------------------------
  function pick(x, y) {
    const width = stage.clientWidth, height = stage.clientHeight, side = 2 * AROUND + 1;
    camera.setViewOffset(width, height, Math.floor(x) - AROUND, Math.floor(y) - AROUND, side, side);
    sizes(1);
    renderer.setRenderTarget(target);
    renderer.setClearColor(0x000000, 0);
    renderer.clear();
    renderer.render(picking, camera);
    camera.clearViewOffset();
    const pixel = new Uint8Array(4);
    renderer.readRenderTargetPixels(target, AROUND, AROUND, 1, 1, pixel);
    renderer.setRenderTarget(null);
    const id = pixel[0] + 256 * pixel[1] + 65536 * pixel[2];
    const item = items.find((one) => one.shown && id >= one.first && id < one.first + one.count && one.uniforms.opacity.value === 1);
    return id && item ? { item, index: id - item.first } : null;
  }

  // Weights of a triangle's corners where the line of sight through a pixel's centre meets it.
  function weights(item, face, x, y) {
    const ndc = [(2 * (Math.floor(x) + 0.5)) / stage.clientWidth - 1, 1 - (2 * (Math.floor(y) + 0.5)) / stage.clientHeight];
    const from = new THREE.Vector3(...ndc, -1).unproject(camera);
    const along = new THREE.Vector3(...ndc, 1).unproject(camera).sub(from);
    const [a, b, c] = [0, 1, 2].map((i) => new THREE.Vector3().fromArray(item.corners, 9 * face + 3 * i));
    const u = b.clone().sub(a), v = c.clone().sub(a), cross = along.clone().cross(v);
    const determinant = u.dot(cross), s = from.clone().sub(a);
    const second = s.dot(cross) / determinant, third = along.dot(s.clone().cross(u)) / determinant;
    const hit = a.clone().addScaledVector(u, second).addScaledVector(v, third);
    return { weights: [1 - second - third, second, third], hit };
  }

  let member = 0;
  function read(x, y) {
    const found = pick(x, y);
    if (!found) return null;
    const { item, index } = found, per = item.surface.of;
    const read = { name: item.surface.name, item, index };
    let at = [[index, 1]];
    if (item.surface.points) read.place = [0, 1, 2].map((k) => item.corners[3 * index + k]);
    else {
      const { weights: w, hit } = weights(item, index, x, y);
      read.place = hit.toArray();
      if (per === "vertex") at = w.map((weight, i) => [item.faces[3 * index + i], weight]);
    }
    if (!item.values) return read;
    const sum = (array) => at.reduce((total, [i, weight]) => total + weight * array[i], 0);
    const values = item.values[Math.min(member, item.values.length - 1)];
    return { ...read, value: sum(values), u: item.u && member === 0 ? sum(item.u) : null, label: item.scale.label };
  }
  function report(x, y) {
    const found = read(x, y);
    under.hidden = !found;
    if (!found) return null;
    const pose = found.item.poses ? poseOf(found.index) : null;
    const [, label, unit] = /^(.*?)(?: \((\S+)\)| \(.*\))?$/.exec(found.label ?? "");
    const value = "value" in found && (Number.isFinite(found.value)
      ? `${label}: ${number(found.value)} ${unit ?? ""}${found.u == null ? "" : `, u ${number(found.u)} ${unit ?? ""}`}`
      : "no value");
    const rank = found.index * (found.item.surface.every ?? 1);
    const kind = pose !== null ? `pose ${pose}` : found.item.surface.points ? "point" : found.name;
    under.textContent = [kind, value, `at (${found.place.map(number).join(", ")}) mm`].filter(Boolean).join("\n");
    under.dataset.index = rank;
    return found;
  }
  let moving = 0;
  canvas.addEventListener("pointermove", (event) => {
    if (event.buttons || moving) return;
    const { offsetX, offsetY } = event;
    moving = requestAnimationFrame(() => { moving = 0; report(offsetX, offsetY); });
  });
  canvas.addEventListener("pointerleave", () => { under.hidden = true; });

  // ---- controls -------------------------------------------------------------------------------
  const level = byId("level"), opacity = byId("opacity"), cut = byId("cut");
  const slider = byId("members"), factor = byId("factor");
  function visible() {
    const mine = shells.filter((item) => (item.surface.member ?? -1) === (data.members.length && "member" in item.surface ? Math.max(member - 1, 0) : -1));
    const only = level ? Number(level.value) : 0;
    mine.sort((a, b) => a.surface.level - b.surface.level);
    for (const item of [...items, ...strings]) {
      const ticked = all("#legend input").find((box) => box.value === item.surface.name);
      let shown = ticked ? ticked.checked : true;
      if ("level" in (item.surface ?? {})) {
        const place = mine.indexOf(item) + 1;
        shown = place > 0 && (only === 0 || only === place);
        if (item.edge) item.edge.visible = shown && shared.cut.value > 0;
      }
      item.shown = shown;
      item.meshes.forEach((mesh, place) => { mesh.visible = shown && !(item.ghost && place); });
      (item.lines ?? []).forEach((line) => { line.visible = shown; });
    }
    if (level) {
      level.max = mine.length;
      const one = mine[only - 1];
      byId("level-text").textContent = one
        ? `${one.surface.name}: ${number(one.surface.level)} °C` : `all ${mine.length}`;
      level.setAttribute("aria-valuetext", byId("level-text").textContent);
    }
    want();
  }
  function recolour() {
    for (const item of items.filter((one) => one.values)) {
      const values = item.values[Math.min(member, item.values.length - 1)];
      const tones = item.geometry.getAttribute("tone"), points = item.surface.points;
      for (let i = 0; i < tones.array.length; i++) {
        const at = points ? i : item.surface.of === "face" ? Math.floor(i / 3) : item.faces[i];
        tones.array[i] = tone(item.scale, values[at]);
      }
      tones.needsUpdate = true;
    }
    want();
  }
  const steps = factor ? JSON.parse(factor.dataset.steps) : [0];
  function exaggerate() {
    const times = steps[factor ? Number(factor.value) : 0];
    const moved = items.some((item) => item.moved);
    shared.factor.value = moved ? times : 0;
    for (const item of items.filter((one) => !one.values && !one.device && !("level" in one.surface))) {
      // Points that move into a body are seen through it.
      item.ghost = moved && times > 0;
      item.uniforms.opacity.value = item.ghost ? 0.35 : item.surface.opacity;
      Object.assign(item.meshes[0].material, { transparent: item.ghost || item.surface.opacity < 1, depthWrite: !item.ghost });
      if (item.ghost) item.meshes[0].renderOrder = 2000;
    }
    for (const { surface, straight, bend, lines } of strings) {
      if (!bend) continue;
      lines[0].geometry.setPositions(pairs(straight.map((x, i) => x + times * bend[i]), surface.counts));
    }
    if (factor) {
      const what = factor.dataset.what;
      byId("factor-text").textContent = times ? `\u00d7 ${number(times)}` : "none";
      byId("note").textContent = times === 0 ? `${what} not drawn` : times === 1 ? `${what} at true size`
        : `${what} drawn ${number(times)} times as large`;
      factor.setAttribute("aria-valuetext", byId("note").textContent);
    }
    visible();
  }
  function choose() {
    member = Number(slider.value);
    const mean = slider.min === "0";
    byId("members-text").textContent = member ? data.members[member - 1] : mean ? "mean" : "";
    slider.setAttribute("aria-valuetext", byId("members-text").textContent);
    recolour();
    visible();
  }
  all("#legend input").forEach((box) => box.addEventListener("change", visible));
  if (level) {
    level.addEventListener("input", visible);
    const faint = () => {
      // The slider is the opacity of all shells together.
      const together = Number(opacity.value) / 100, count = Number(level.value) ? 1 : Math.max(Number(level.max), 1);
      shared.opacity.value = 1 - (1 - together) ** (1 / count);
      byId("opacity-text").textContent = `${opacity.value} %`;
      want();
    };
    opacity.addEventListener("input", faint);
    level.addEventListener("input", faint);
    visible();
    faint();
  }
  cut?.addEventListener("change", () => { shared.cut.value = cut.checked ? 1 : 0; visible(); });
  factor?.addEventListener("input", exaggerate);
  slider?.addEventListener("input", choose);
  byId("home").addEventListener("click", home);
  byId("near")?.addEventListener("click", near);

  // ---- poses ----------------------------------------------------------------------------------
  const poseOf = (face) => Math.floor(face / (cones.count / (ends.length / 6)));
  function show(pose) {
    const rows = all("#poses tbody tr");
    rows.forEach((row) => row.setAttribute("aria-selected", String(Number(row.dataset.pose) === pose)));
    const list = byId("poses").parentElement, row = rows[pose];
    list.scrollTop = row.offsetTop - list.clientHeight / 2;
    chosen.visible = true;
    chosen.geometry.setPositions(ends.slice(6 * pose, 6 * pose + 6));
    byId("pose-title").textContent = `Pose ${pose}`;
    byId("pose-numbers").replaceChildren(...data.poses.headings.flatMap((name, i) => [
      Object.assign(document.createElement("dt"), { textContent: name }),
      Object.assign(document.createElement("dd"), { textContent: data.poses.rows[pose][i] }),
    ]));
    const map = byId("pose-map"), source = data.poses.maps[pose];
    map.hidden = !source;
    byId("pose-caption").textContent = source ? map.dataset.caption : map.dataset.missing;
    if (source) Object.assign(map, { src: source, alt: `Map of what pose ${pose} sees: ${map.dataset.caption}` });
    byId("pose").hidden = false;
    want();
  }
  if (data.poses) {
    all("#poses tbody tr").forEach((row) => row.querySelector("button").addEventListener("click", () => show(Number(row.dataset.pose))));
    let pressed = null;
    canvas.addEventListener("pointerdown", (event) => { pressed = [event.offsetX, event.offsetY]; });
    canvas.addEventListener("pointerup", (event) => {
      if (!pressed || Math.hypot(event.offsetX - pressed[0], event.offsetY - pressed[1]) > 4) return;
      const found = read(event.offsetX, event.offsetY);
      if (found?.item.poses) show(poseOf(found.index));
    });
  }

  all(".bar").forEach((bar, place) => {
    const colours = data.scales[place].colours.match(/.{6}/g).filter((_, i) => i % 15 === 0);
    bar.querySelector(".ramp").style.background = `linear-gradient(to top, ${colours.map((c) => `#${c}`).join(", ")})`;
    bar.querySelectorAll(".tick").forEach((tick) => { tick.style.bottom = `${tick.dataset.at}%`; });
  });
  all(".swatch").forEach((swatch) => { swatch.style.background = swatch.dataset.colour; });
  measure();
  controls.addEventListener("change", want);
  new ResizeObserver(() => { if (!matchMedia("print").matches) { resize(); want(); } }).observe(stage);
  recolour();
  exaggerate();
  if (slider) choose();
  home();
  if (data.poses) show(data.poses.best);
})();
