/** Distinguish taps from drags on the canvas, and report where the mouse hovers. */

/** Farthest that the pointer moves during a tap, pixels, and longest that it takes, ms. */
const TAP = { distance: 8, time: 600 };
/** Distance from the pointer within which small items are hit, pixels. */
const SLACK = { mouse: 6, touch: 16 };

interface PointerHandlers {
  /** Called with the position in the view and the slack, pixels. */
  onTap: (x: number, y: number, slack: number) => void;
  onHover: (x: number, y: number) => void;
}

/** Listen to the pointer on a canvas; return a function that stops listening. */
export function followPointer(canvas: HTMLCanvasElement, { onTap, onHover }: PointerHandlers): () => void {
  let start: { x: number; y: number; time: number } | null = null;
  const position = (event: PointerEvent) => {
    const box = canvas.getBoundingClientRect();
    return { x: event.clientX - box.left, y: event.clientY - box.top };
  };
  const down = (event: PointerEvent) => {
    start = event.isPrimary && event.button === 0 ? { ...position(event), time: event.timeStamp } : null;
  };
  const up = (event: PointerEvent) => {
    const from = start;
    start = null;
    if (!from || !event.isPrimary) return;
    const { x, y } = position(event);
    if (Math.hypot(x - from.x, y - from.y) > TAP.distance || event.timeStamp - from.time > TAP.time) return;
    onTap(x, y, event.pointerType === "mouse" ? SLACK.mouse : SLACK.touch);
  };
  const move = (event: PointerEvent) => {
    if (event.pointerType !== "mouse" || event.buttons) return;
    const { x, y } = position(event);
    onHover(x, y);
  };
  canvas.addEventListener("pointerdown", down);
  canvas.addEventListener("pointerup", up);
  canvas.addEventListener("pointermove", move);
  return () => {
    canvas.removeEventListener("pointerdown", down);
    canvas.removeEventListener("pointerup", up);
    canvas.removeEventListener("pointermove", move);
  };
}
