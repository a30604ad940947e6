// Probe inside the page: times of the first items, and from a message to the frame that shows it.
(() => {
  const seen = { items: 0, robot: 0, joints: [], edits: [], previews: [], taps: [], enters: [] };
  window.__bench = seen;
  const epoch = () => performance.timeOrigin + performance.now();
  const waiting = { joints: [] };
  const OriginalWebSocket = window.WebSocket;
  window.WebSocket = class extends OriginalWebSocket {
    constructor(...given) {
      super(...given);
      this.addEventListener("message", ({ data }) => {
        const head = String(data).slice(0, 60);
        if (head.includes('"RobotJoints"')) waiting.joints.push(performance.now());
        if (head.includes('"ActionPointChanged"')) seen.edits.push(epoch());
        if (head.includes('"MovePreview"')) seen.previews.push(epoch());
      });
    }
  };
  addEventListener("click", () => seen.taps.push(epoch()), true);
  addEventListener("keydown", ({ key }) => key === "Enter" && seen.enters.push(epoch()), true);
  let hooked = null;
  const poll = () => {
    const engine = window.__engine;
    if (engine && hooked !== engine) {
      hooked = engine;
      const { renderer } = engine;
      const gl = renderer.getContext();
      const render = renderer.render.bind(renderer);
      const pixel = new Uint8Array(4);
      renderer.render = (...given) => {
        render(...given);
        if (!waiting.joints.length) return;
        gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel); // waits until the frame is drawn
        const now = performance.now();
        for (const at of waiting.joints.splice(0)) seen.joints.push(now - at);
      };
    }
    if (!seen.items && engine?.ids().length) seen.items = performance.now();
    if (!seen.robot && engine) {
      const robot = engine.ids().map((id) => engine.item(id)).find((item) => item.kind === "robot");
      if (robot && Object.keys(robot.joints ?? {}).length) seen.robot = performance.now();
    }
    if (!seen.robot) setTimeout(poll, 5);
  };
  poll();
})();
