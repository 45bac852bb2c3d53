'use strict';
// WebGL 2: textures, programs and what is drawn with them.
const draw = (() => {
  const ROW = 2048;
  const HEAD = '#version 300 es\n';
  let gl, canvas, info, mesh, spheres = 0, colors = 0, ask = null;
  const programs = {};
  const units = new Map();

  const compile = (kind, source) => {
    const shader = gl.createShader(kind);
    gl.shaderSource(shader, source);
    gl.compileShader(shader);
    return shader;
  };

  // All programs are begun before any is waited for.
  const begin = (name, defines, part, outputs) => {
    const common = HEAD + info.header + defines;
    const texts = ['#define VERTEX 1\n', ''].map((side) => `${common}${side}${data.text('look-up')}\n${data.text(part)}`);
    const program = gl.createProgram();
    const shaders = [compile(gl.VERTEX_SHADER, texts[0]), compile(gl.FRAGMENT_SHADER, texts[1])];
    for (const shader of shaders) gl.attachShader(program, shader);
    if (outputs) gl.transformFeedbackVaryings(program, outputs, gl.INTERLEAVED_ATTRIBS);
    for (const [place, attribute] of ['position', 'normal', 'state'].entries()) gl.bindAttribLocation(program, place, attribute);
    gl.linkProgram(program);
    programs[name] = { program, shaders };
  };

  const finish = (name) => {
    const { program, shaders } = programs[name];
    if (!gl.getProgramParameter(program, gl.LINK_STATUS) && !gl.isContextLost()) {
      const logs = shaders.map((shader) => gl.getShaderInfoLog(shader)).concat(gl.getProgramInfoLog(program));
      throw new Error(`the program ${name} does not work on this device: ${logs.filter(Boolean).join(' ')}`);
    }
    const count = gl.getProgramParameter(program, gl.ACTIVE_UNIFORMS);
    const at = {};
    for (let i = 0; i < count; i++) {
      const label = gl.getActiveUniform(program, i).name.replace('[0]', '');
      at[label] = gl.getUniformLocation(program, label);
    }
    programs[name] = { program, at };
    gl.useProgram(program);
    for (const [sampler, unit] of units) if (at[sampler]) gl.uniform1i(at[sampler], unit);
    if (at.gridOrigin) gl.uniform3fv(at.gridOrigin, info.grid_origin);
    if (at.gridSpacing) gl.uniform3fv(at.gridSpacing, info.grid_spacing);
    if (at.gridPoints) gl.uniform3iv(at.gridPoints, info.grid_points);
  };

  const texture = (name, internal, format, type, channels, numbers) => {
    const rows = Math.max(1, Math.ceil(numbers.length / channels / ROW));
    const most = gl.getParameter(gl.MAX_TEXTURE_SIZE);
    if (rows > most) throw new Error(`this device has textures of at most ${most} rows, and ${name} has ${rows}`);
    const whole = new numbers.constructor(ROW * rows * channels);
    whole.set(numbers);
    const unit = units.size;
    units.set(name, unit);
    gl.activeTexture(gl.TEXTURE0 + unit);
    gl.bindTexture(gl.TEXTURE_2D, gl.createTexture());
    for (const [key, value] of [['MIN_FILTER', 'NEAREST'], ['MAG_FILTER', 'NEAREST'], ['WRAP_S', 'CLAMP_TO_EDGE'], ['WRAP_T', 'CLAMP_TO_EDGE']]) {
      gl.texParameteri(gl.TEXTURE_2D, gl[`TEXTURE_${key}`], gl[value]);
    }
    gl.texImage2D(gl.TEXTURE_2D, 0, internal, ROW, rows, 0, format, type, whole);
  };

  const lookUpTexture = async (name) => {
    const numbers = await data.numbers(name), channels = data.channels(name);
    if (numbers instanceof Float32Array) {
      const [internal, format] = [null, null, [gl.RG32F, gl.RG], [gl.RGB32F, gl.RGB], [gl.RGBA32F, gl.RGBA]][channels];
      texture(name, internal, format, gl.FLOAT, channels, numbers);
    } else if (numbers instanceof Uint16Array) texture(name, gl.R16UI, gl.RED_INTEGER, gl.UNSIGNED_SHORT, 1, numbers);
    else texture(name, gl.R32UI, gl.RED_INTEGER, gl.UNSIGNED_INT, 1, numbers);
    return numbers;
  };

  const array = (place, numbers, size, type, normalised, divisor) => {
    gl.bindBuffer(gl.ARRAY_BUFFER, gl.createBuffer());
    gl.bufferData(gl.ARRAY_BUFFER, numbers, gl.STATIC_DRAW);
    gl.enableVertexAttribArray(place);
    gl.vertexAttribPointer(place, size, type, normalised, 0, 0);
    gl.vertexAttribDivisor(place, divisor);
  };

  const OUTPUTS = [
    'lightOff', 'lightOn', 'lightExact', 'probesLow', 'probesHigh', 'offLow', 'offHigh', 'onLow', 'onHigh', 'givenLow', 'givenHigh', 'told',
  ];
  const NUMBERS_OUT = 45;

  // Makes everything ready; `light` is what each texel holds, for picking.
  const open = async (on) => {
    canvas = on;
    info = data.info;
    // Several samples of a pixel would show a floor that goes on under a wall as dark as it is there: places are asked for at
    // the middle of the pixel, not where the sample lies.
    gl = canvas.getContext('webgl2', { antialias: false, alpha: false, preserveDrawingBuffer: true });
    if (!gl) throw new Error('this browser has no WebGL 2, which this page draws with');
    gl.pixelStorei(gl.UNPACK_ALIGNMENT, 1);
    const probes = await lookUpTexture('probes');
    for (const name of ['light', 'roots', 'words', 'distances', 'gridIndex']) if (data.has(name)) await lookUpTexture(name);
    mesh = await data.mesh();
    const texels = await data.texels(mesh.texels);
    const own = await data.numbers('own');
    texture('charts', gl.RGBA32UI, gl.RGBA_INTEGER, gl.UNSIGNED_INT, 4, mesh.charts);
    texture('texels', gl.RGBA8UI, gl.RGBA_INTEGER, gl.UNSIGNED_BYTE, 4, texels);
    texture('own', gl.RGB9_E5, gl.RGB, gl.UNSIGNED_INT_5_9_9_9_REV, 1, own);
    const lit = [];
    for (const name of ['lit0', 'lit1', 'lit2']) {
      if (!data.has(name)) continue;
      lit.push(await data.numbers(name));
      texture(name, gl.RGB9_E5, gl.RGB, gl.UNSIGNED_INT_5_9_9_9_REV, 1, lit.at(-1));
    }
    texture('colormap', gl.RGB8, gl.RGB, gl.UNSIGNED_BYTE, 3, codec.bytesOf(document.body.dataset.colors));
    begin('surface', '', 'surface', null);
    begin('depth', '#define DEPTH_ONLY 1\n', 'surface', null);
    begin('spheres', '#define SPHERES 1\n', 'spheres', null);
    begin('lines', '#define LINES 1\n', 'spheres', null);
    if (!info.is_baked) begin('asks', '#define ASKS 1\n', 'spheres', OUTPUTS);
    for (const name of Object.keys(programs)) finish(name);
    colors = gl.createVertexArray();
    gl.bindVertexArray(colors);
    array(0, mesh.place, 3, gl.FLOAT, false, 0);
    array(1, mesh.normal, 4, gl.SHORT, true, 0);
    spheres = gl.createVertexArray();
    gl.bindVertexArray(spheres);
    array(2, Uint8Array.from(info.states), 1, gl.UNSIGNED_BYTE, false, 1);
    gl.bindVertexArray(null);
    return { mesh, texels, lit, probes };
  };

  const unitColor = (color) => color.map((byte) => byte / 255);
  const MARKS = [[0.8, 0.8, 0.8], [0.2, 0.85, 0.4], [1.0, 0.45, 0.15], [0.6, 0.6, 0.65]];

  // Draws a frame: `shown` has what the controls say, `picked` the point or null. `scale`: pixels of the canvas for one of its size.
  const frame = (shown, picked, scale) => {
    const width = Math.max(1, Math.round(canvas.clientWidth * scale)), height = Math.max(1, Math.round(canvas.clientHeight * scale));
    if (canvas.width !== width || canvas.height !== height) [canvas.width, canvas.height] = [width, height];
    const { matrix, half, near } = camera.viewProjection(width / height);
    const eye = camera.eye(), gain = 2 ** shown.exposure;
    gl.viewport(0, 0, width, height);
    gl.clearColor(0.075, 0.08, 0.09, 1);
    gl.depthMask(true);
    gl.colorMask(true, true, true, true);
    gl.enable(gl.DEPTH_TEST);
    gl.depthFunc(gl.LESS);
    gl.clear(gl.COLOR_BUFFER_BIT | gl.DEPTH_BUFFER_BIT);
    const use = (name) => {
      const { program, at } = programs[name];
      gl.useProgram(program);
      gl.uniformMatrix4fv(at.viewProjection, false, matrix);
      if (at.eye) gl.uniform3fv(at.eye, eye);
      if (at.gain) gl.uniform1f(at.gain, gain);
      if (at.cut) gl.uniform1f(at.cut, shown.cut);
      return at;
    };
    const surface = (name) => {
      const at = use(name);
      if (at.texelSide) gl.uniform1f(at.texelSide, info.texel_m);
      if (at.nudge) gl.uniform1f(at.nudge, info.nudge_m);
      if (at.visibility) gl.uniform1i(at.visibility, shown.visibility);
      if (at.show) gl.uniform1i(at.show, shown.show);
      if (at.ranges) gl.uniform2fv(at.ranges, info.ranges);
      gl.drawArrays(gl.TRIANGLES, 0, 3 * mesh.triangles);
    };
    gl.bindVertexArray(colors);
    // Depth first: each pixel then asks the probes once.
    gl.colorMask(false, false, false, false);
    surface('depth');
    gl.colorMask(true, true, true, true);
    gl.depthMask(false);
    gl.depthFunc(gl.EQUAL);
    surface('surface');
    gl.depthMask(true);
    gl.depthFunc(gl.LESS);

    const marked = picked?.probes ? picked : { probes: new Array(8).fill(-1), marks: new Array(8).fill(0) };
    const common = (at) => {
      if (at.radius) gl.uniform1f(at.radius, info.radius_m);
      if (at.chosen) gl.uniform1iv(at.chosen, marked.probes);
      if (at.marks) gl.uniform1iv(at.marks, marked.marks);
      if (at.markColors) gl.uniform3fv(at.markColors, MARKS.flat());
    };
    const balls = (onlyChosen) => {
      const at = use('spheres');
      common(at);
      if (at.up) gl.uniform3fv(at.up, camera.up());
      if (at.pixel) gl.uniform1f(at.pixel, (2 * half) / height);
      if (at.onlyChosen) gl.uniform1i(at.onlyChosen, onlyChosen);
      const { rim, inside, unsampled } = info.colors;
      if (at.stateColors) gl.uniform3fv(at.stateColors, [rim, inside, unsampled].flatMap(unitColor));
      gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, info.probes);
    };
    gl.bindVertexArray(spheres);
    if (shown.probes) balls(0);
    if (picked) {
      // What belongs to the point is seen through everything.
      gl.disable(gl.DEPTH_TEST);
      const at = use('lines');
      common(at);
      gl.uniform3fv(at.point, picked.place);
      gl.uniform2f(at.viewport, width, height);
      if (at.near) gl.uniform1f(at.near, near);
      const line = (what, count, size) => {
        gl.uniform1i(at.what, what);
        gl.uniform1f(at.width, size * scale);
        gl.drawArraysInstanced(gl.TRIANGLE_STRIP, 0, 4, count);
      };
      if (picked.probes) {
        gl.uniform3fv(at.boxLow, picked.box.low);
        gl.uniform3fv(at.boxSides, picked.box.sides);
        line(1, 12, 1);
        line(0, 8, 2.5);
      }
      if (picked.probes) {
        gl.enable(gl.DEPTH_TEST);
        gl.clear(gl.DEPTH_BUFFER_BIT);
        balls(1);
        gl.disable(gl.DEPTH_TEST);
        use('lines');
      }
      line(2, 1, 13);
    }
    gl.bindVertexArray(null);
    return gl.getError();
  };

  // Waits until all that was asked for is drawn.
  const wait = () => gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(4));

  // What the look-up makes of points: each has position, normal, geometric, view, centre and mask.
  const lookUp = (points) => {
    const { program } = programs.asks;
    const floats = new Float32Array(16 * points.length);
    points.forEach((p, i) => floats.set([...p.position, ...p.normal, ...p.geometric, ...p.view, ...p.centre, p.mask], 16 * i));
    const from = gl.createBuffer(), to = gl.createBuffer(), vertices = gl.createVertexArray();
    gl.useProgram(program);
    gl.bindVertexArray(vertices);
    gl.bindBuffer(gl.ARRAY_BUFFER, from);
    gl.bufferData(gl.ARRAY_BUFFER, floats, gl.STATIC_DRAW);
    const parts = [['askPosition', 3], ['askNormal', 3], ['askGeometric', 3], ['askView', 3], ['askCentre', 3], ['askMask', 1]];
    let offset = 0;
    for (const [name, size] of parts) {
      const at = gl.getAttribLocation(program, name);
      if (at >= 0) {
        gl.enableVertexAttribArray(at);
        gl.vertexAttribPointer(at, size, gl.FLOAT, false, 64, offset);
      }
      offset += 4 * size;
    }
    gl.bindBuffer(gl.ARRAY_BUFFER, null);
    ask ??= gl.createTransformFeedback();
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, ask);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, to);
    gl.bufferData(gl.TRANSFORM_FEEDBACK_BUFFER, 4 * NUMBERS_OUT * points.length, gl.STREAM_READ);
    gl.enable(gl.RASTERIZER_DISCARD);
    gl.beginTransformFeedback(gl.POINTS);
    gl.drawArrays(gl.POINTS, 0, points.length);
    gl.endTransformFeedback();
    gl.disable(gl.RASTERIZER_DISCARD);
    const found = new Float32Array(NUMBERS_OUT * points.length), whole = new Int32Array(found.buffer);
    gl.getBufferSubData(gl.TRANSFORM_FEEDBACK_BUFFER, 0, found);
    gl.bindBufferBase(gl.TRANSFORM_FEEDBACK_BUFFER, 0, null);
    gl.bindTransformFeedback(gl.TRANSFORM_FEEDBACK, null);
    gl.bindVertexArray(null);
    gl.deleteVertexArray(vertices);
    gl.deleteBuffer(from);
    gl.deleteBuffer(to);
    return points.map((_, i) => {
      const of = (start, count, numbers = found) => [...numbers.subarray(NUMBERS_OUT * i + start, NUMBERS_OUT * i + start + count)];
      const [seen, known] = of(41, 2, whole);
      return { light: [of(0, 3), of(3, 3), of(6, 3)], probes: of(9, 8, whole), off: of(17, 8), on: of(25, 8), given: of(33, 8), seen, known };
    });
  };

  return { open, frame, wait, lookUp };
})();
