/**
 * Complete a press whose control moved away below a finger at rest. A card or an alarm that appears between pressing
 * and releasing moves the button away; without this, the release would be outside of it and the press would be lost.
 */

interface Point {
  clientX: number;
  clientY: number;
}

type Rect = Pick<DOMRect, "left" | "right" | "top" | "bottom">;

interface Press extends Point {
  pointerId: number;
  control: HTMLElement;
}

/** Distance below which a finger counts as still, CSS pixels. */
const STILL = 12;
/** Time in which a browser sends the click of a press itself, ms. */
const CLICK_TIMEOUT = 100;

const contains = (rect: Rect, { clientX: x, clientY: y }: Point): boolean =>
  x >= rect.left && x <= rect.right && y >= rect.top && y <= rect.bottom;

/** Return whether a control that was pressed at a point has moved away below a finger that stayed. */
export const movedAway = (pressed: Point, released: Point, rect: Rect): boolean =>
  Math.hypot(released.clientX - pressed.clientX, released.clientY - pressed.clientY) <= STILL &&
  !contains(rect, released);

/** Watch the presses of a page. A control that was removed or replaced during the press is not activated. */
export function keepPresses(page: Document): void {
  let press: Press | null = null;
  const listen = (type: "pointerdown" | "pointerup" | "pointercancel", act: (event: PointerEvent) => void) =>
    page.addEventListener(type, act, { capture: true, passive: true });
  listen("pointerdown", (event) => {
    const { pointerId, clientX, clientY } = event;
    const control = (event.target as Element).closest<HTMLElement>("[data-react-aria-pressable]");
    const pressed = event.button === 0 && control && contains(control.getBoundingClientRect(), event);
    press = pressed ? { pointerId, clientX, clientY, control } : null;
  });
  listen("pointercancel", () => {
    press = null;
  });
  listen("pointerup", (event) => {
    const before = press;
    press = null;
    if (before?.pointerId !== event.pointerId) return;
    const { control } = before;
    if (!movedAway(before, event, control.getBoundingClientRect())) return;
    let clicked = false;
    control.addEventListener("click", () => (clicked = true), { once: true, capture: true });
    setTimeout(() => {
      if (!clicked && control.isConnected) control.click();
    }, CLICK_TIMEOUT);
  });
}
