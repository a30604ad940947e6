import { useEffect, useRef } from "react";
import { now } from "../../store/store";
import { readCards } from "./cardReader";

declare module "../../store/runtime" {
  interface Runtime {
    /** Callbacks for the cards that are read; only the last one is called. */
    cardTakers?: ((card: string) => void)[];
    /** Stops reading cards. */
    endCards?: (() => void) | undefined;
  }
}

/** Call `onCard` with each card that is read while `active`. With several components, only the last one is called. */
export function useCards(onCard: (card: string) => void, active = true): void {
  const latest = useRef(onCard);
  latest.current = onCard;
  useEffect(() => {
    if (!active) return;
    const { runtime } = now();
    runtime.cardTakers ??= [];
    const takers = runtime.cardTakers;
    const take = (card: string) => latest.current(card);
    takers.push(take);
    runtime.endCards ??= readCards((card) => takers.at(-1)?.(card));
    return () => {
      takers.splice(takers.indexOf(take), 1);
      if (takers.length > 0) return;
      runtime.endCards?.();
      runtime.endCards = undefined;
    };
  }, [active]);
}
