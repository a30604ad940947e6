/** Cards that are read on this page, for the component that was shown last. */
import { useEffect, useRef } from "react";
import { getState } from "../../store/store";
import { readCards } from "./cardReader";

declare module "../../store/runtime" {
  interface Runtime {
    /** Callbacks for the cards that are read; only the last one is called. */
    cardListeners?: ((card: string) => void)[];
    /** Stops reading cards. */
    stopReadingCards?: (() => void) | undefined;
  }
}

/** Call `onCard` with each card that is read while `active`. With several components, only the last one is called. */
export function useCards(onCard: (card: string) => void, active = true): void {
  const latest = useRef(onCard);
  latest.current = onCard;
  useEffect(() => {
    if (!active) return;
    const { runtime } = getState();
    runtime.cardListeners ??= [];
    const listeners = runtime.cardListeners;
    const take = (card: string) => latest.current(card);
    listeners.push(take);
    runtime.stopReadingCards ??= readCards((card) => listeners.at(-1)?.(card));
    return () => {
      listeners.splice(listeners.indexOf(take), 1);
      if (listeners.length > 0) return;
      runtime.stopReadingCards?.();
      runtime.stopReadingCards = undefined;
    };
  }, [active]);
}
