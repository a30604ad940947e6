/**
 * A card reader that works as a keyboard: it types the number of a card faster than a person, and then Enter. The keys
 * are held back until it is clear who typed them, so that the number is never written into a field.
 */

/** Longest time between two keys of a reader, ms. Persons need longer for most keys. */
export const MAX_GAP = 50;
/** Least length of the number of a card. */
const SHORTEST = 4;

/**
 * The decision about a key. `typed`: delayed keys of a person, which precede it. `late`: number of keys of the card
 * that have already been given to the page, since the page was too busy to read the next one in time.
 */
type Verdict = { hold: true } | { hold: false; typed: string } | { card: string; late: number };

export class CardKeys {
  private held = "";
  private given = "";
  private at = -Infinity;

  /** Take a key at a time, ms. */
  key(key: string, at: number): Verdict {
    const fast = at - this.at <= MAX_GAP;
    this.at = at;
    if (!fast) this.given = "";
    const number = this.given + this.held;
    if (key === "Enter" && fast && number.length >= SHORTEST) {
      const late = this.given.length;
      this.held = this.given = "";
      return { card: number, late };
    }
    if (key.length !== 1) {
      const typed = this.flush();
      this.given = "";
      return { hold: false, typed };
    }
    this.held += key;
    return { hold: true };
  }

  /** Return the held keys, and hold none any more: no further key came in time. */
  flush(): string {
    const { held } = this;
    this.given += held;
    this.held = "";
    return held;
  }
}

/**
 * Call `onCard` with the number of each card that is read on this page, wherever the focus is. Keys of a person are
 * passed to the focused element a little later. Return a function that stops reading.
 */
export function readCards(onCard: (card: string) => void): () => void {
  const keys = new CardKeys();
  let timer = 0;
  const isField = (each: Element) => each instanceof HTMLInputElement || each instanceof HTMLTextAreaElement;
  const give = (typed: string) => {
    const focus = document.activeElement ?? document.body;
    if (isField(focus) && typed) document.execCommand("insertText", false, typed);
    else
      for (const key of typed)
        focus.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true, cancelable: true }));
  };
  const listen = (event: KeyboardEvent) => {
    if (!event.isTrusted) return; // given above
    if (event.ctrlKey || event.metaKey || event.altKey || event.isComposing || event.repeat) return;
    if (event.key === "Shift" || event.key === " ") return; // Shift: a reader types capitals with it
    // The 3D view moves while a key is held down, so its keys must not be delayed.
    const passes = event.target instanceof HTMLCanvasElement;
    clearTimeout(timer);
    const verdict = keys.key(event.key, event.timeStamp);
    if ("card" in verdict || (verdict.hold && !passes)) {
      event.preventDefault();
      event.stopImmediatePropagation();
    }
    if ("card" in verdict) {
      if (isField(document.activeElement ?? document.body))
        for (let each = 0; each < verdict.late; each++) document.execCommand("delete");
      onCard(verdict.card);
    } else if (passes) timer = window.setTimeout(() => keys.flush(), MAX_GAP);
    else if (verdict.hold) timer = window.setTimeout(() => give(keys.flush()), MAX_GAP);
    else give(verdict.typed);
  };
  window.addEventListener("keydown", listen, { capture: true });
  return () => {
    clearTimeout(timer);
    window.removeEventListener("keydown", listen, { capture: true });
  };
}
