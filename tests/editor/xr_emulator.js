/**
 * Emulates a tablet or headset with WebXR, after iwer: what iwer lacks is a page over the session, pictures of the
 * camera, and a framebuffer of its own. `window.__xr` moves the device and shows what its user sees.
 */
(({ headset, pictures, overlay }) => {
  // 20 frames a second: each of them takes processor time.
  const nextFrame = window.requestAnimationFrame.bind(window);
  window.requestAnimationFrame = (callback) => setTimeout(() => nextFrame(callback), 34);
  window.cancelAnimationFrame = clearTimeout;
  const { XRDevice, metaQuest3 } = window.IWER;
  const features = ["viewer", "local", "local-floor", "anchors", "hit-test", "plane-detection"];
  const tablet = {
    ...metaQuest3,
    name: "tablet",
    controllerConfig: undefined,
    supportedSessionModes: ["inline", "immersive-ar"],
    interactionMode: "screen-space",
    supportedFeatures: [...features, ...(overlay ? ["dom-overlay"] : []), ...(pictures ? ["camera-access"] : [])],
  };
  const device = new XRDevice(headset ? { ...metaQuest3 } : tablet, { stereoEnabled: headset, fovy: 0.75 });
  if (!headset) device.ipd = 0;

  // A floor, for hit tests.
  const floor = { matrix: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0.7, 0, 1] };
  class Room {
    trackedPlanes = new Set();
    trackedMeshes = new Set();
    environmentCanvas = document.createElement("canvas");
    render() {}
    computeDepthBuffer() {
      return null;
    }
    computeHitTestResults(ray) {
      const distance = (floor.matrix[13] - ray[13]) / -ray[9];
      if (!(distance > 0)) return [];
      const at = new Float32Array(floor.matrix);
      for (const n of [0, 1, 2]) at[12 + n] = ray[12 + n] - ray[8 + n] * distance;
      return [at];
    }
  }
  device.installRuntime({ forceInstall: true });
  device.installSEM(Room);

  // The frame is drawn into a framebuffer of its own; iwer moves and clears the canvas of a substitute.
  const screen = document.createElement("canvas");
  Object.assign(screen.style, { position: "fixed", inset: "0", pointerEvents: "none" });
  const nothing = () => {};
  const substitute = {
    canvas: screen,
    getParameter: () => [0, 0, 0, 0],
    clear: nothing,
    clearColor: nothing,
    clearDepth: nothing,
    clearStencil: nothing,
    get drawingBufferWidth() {
      return window.innerWidth;
    },
    get drawingBufferHeight() {
      return window.innerHeight;
    },
  };
  const state = { gl: null, framebuffer: null, emulated: false, lostController: false, session: null, shot: null };
  // The browser refuses the session, or does not show the page over it.
  Object.assign(state, { refuses: false, covers: false });
  const unbound = (gl, make) => {
    const bound = [gl.FRAMEBUFFER_BINDING, gl.RENDERBUFFER_BINDING, gl.TEXTURE_BINDING_2D].map((each) =>
      gl.getParameter(each),
    );
    const made = make();
    gl.bindFramebuffer(gl.FRAMEBUFFER, bound[0]);
    gl.bindRenderbuffer(gl.RENDERBUFFER, bound[1]);
    gl.bindTexture(gl.TEXTURE_2D, bound[2]);
    return made;
  };
  const Layer = window.XRWebGLLayer;
  window.XRWebGLLayer = class extends Layer {
    constructor(session, gl, init) {
      super(session, substitute, init);
      const [width, height] = [window.innerWidth, window.innerHeight];
      if (state.gl !== gl) state.texture = null; // of the context before
      state.gl = gl;
      state.framebuffer = unbound(gl, () => {
        const made = gl.createFramebuffer();
        gl.bindFramebuffer(gl.FRAMEBUFFER, made);
        for (const [kind, format] of [
          [gl.COLOR_ATTACHMENT0, gl.RGBA8],
          [gl.DEPTH_ATTACHMENT, gl.DEPTH_COMPONENT24],
        ]) {
          const buffer = gl.createRenderbuffer();
          gl.bindRenderbuffer(gl.RENDERBUFFER, buffer);
          gl.renderbufferStorage(gl.RENDERBUFFER, format, width, height);
          gl.framebufferRenderbuffer(gl.FRAMEBUFFER, kind, gl.RENDERBUFFER, buffer);
        }
        return made;
      });
    }
    get framebuffer() {
      return state.framebuffer;
    }
  };

  // Pictures of the camera: the test sets one with the pose of the device.
  const texture = () =>
    unbound(state.gl, () => {
      const { gl } = state;
      const flip = gl.getParameter(gl.UNPACK_FLIP_Y_WEBGL);
      state.texture ??= gl.createTexture();
      gl.bindTexture(gl.TEXTURE_2D, state.texture);
      gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, true);
      gl.texImage2D(gl.TEXTURE_2D, 0, gl.RGBA, gl.RGBA, gl.UNSIGNED_BYTE, state.shot);
      gl.pixelStorei(gl.UNPACK_FLIP_Y_WEBGL, flip);
      gl.texParameteri(gl.TEXTURE_2D, gl.TEXTURE_MIN_FILTER, gl.LINEAR);
      return state.texture;
    });
  if (pictures) {
    Object.defineProperty(window.XRView.prototype, "camera", {
      get: () => state.shot && { width: state.shot.width, height: state.shot.height },
    });
    window.XRWebGLBinding = class {
      getCameraImage = texture;
    };
  }
  // iwer always knows the position of the device, and never that of a controller.
  const poseOf = window.XRFrame.prototype.getPose;
  window.XRFrame.prototype.getPose = function (...spaces) {
    const pose = poseOf.apply(this, spaces);
    if (pose) Object.defineProperty(pose, "emulatedPosition", { value: state.lostController });
    return pose;
  };
  const viewer = window.XRFrame.prototype.getViewerPose;
  window.XRFrame.prototype.getViewerPose = function (space) {
    const pose = viewer.call(this, space);
    if (pose && state.emulated) Object.defineProperty(pose, "emulatedPosition", { value: true });
    return pose;
  };

  const ask = navigator.xr.requestSession.bind(navigator.xr);
  navigator.xr.requestSession = async (mode, options = {}) => {
    if (state.refuses) throw new DOMException("AR is not installed", "NotSupportedError");
    const session = await ask(mode, { ...options, requiredFeatures: ["local-floor"] });
    state.session = session;
    // In the frame of the room, so that a test knows where things are.
    const space = session.requestReferenceSpace.bind(session);
    session.requestReferenceSpace = (type) => space(type === "local" ? "local-floor" : type);
    const root = !state.covers && session.enabledFeatures.includes("dom-overlay") ? options.domOverlay?.root : undefined;
    if (root) Object.defineProperty(session, "domOverlayState", { value: { type: "screen" } });
    return session;
  };

  window.__xr = {
    device,
    state,
    /** Place the device: position, quaternion x, y, z, w, and the picture that its camera takes there. */
    async place(position, [x, y, z, w], picture) {
      if (picture) {
        const image = new Image();
        image.src = picture;
        await image.decode();
        state.shot = image;
      }
      device.position.set(...position);
      device.quaternion.set(x, y, z, w);
    },
    /** Let the session draw, and show it over the picture of the camera. Other frames are only counted. */
    async see() {
      const { gl, framebuffer, session, shot } = state;
      window.__drawing = true;
      for (let i = 0; i < 2; i++) await new Promise((done) => session.requestAnimationFrame(done));
      window.__drawing = false;
      const [width, height] = [window.innerWidth, window.innerHeight];
      const pixels = new Uint8ClampedArray(4 * width * height);
      unbound(gl, () => {
        gl.bindFramebuffer(gl.FRAMEBUFFER, framebuffer);
        gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, new Uint8Array(pixels.buffer));
      });
      const drawn = document.createElement("canvas");
      Object.assign(drawn, { width, height });
      drawn.getContext("2d").putImageData(new ImageData(pixels, width, height), 0, 0);
      const context = screen.getContext("2d");
      context.fillStyle = "#5a6570";
      context.fillRect(0, 0, width, height);
      if (shot) context.drawImage(shot, 0, 0, width, height);
      context.setTransform(1, 0, 0, -1, 0, height);
      context.drawImage(drawn, 0, 0);
      context.setTransform(1, 0, 0, 1, 0, 0);
      screen.parentElement.style.zIndex = "-1";
      // A headset does not show the page, nor its 3D view.
      if (headset) for (const each of document.querySelectorAll("#root, .view canvas")) each.style.opacity = "0";
      let count = 0;
      for (let i = 3; i < pixels.length; i += 4) if (pixels[i] > 0) count++;
      return { drawn: count, all: width * height };
    },
  };
})(window.__xrOptions);
