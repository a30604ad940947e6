/** The interlocks of the open scene and their states, followed while the panel shows them. */

import { useEffect, useState } from "react";
import { translate } from "../../i18n/serverMessages";
import type { Interlock, InterlockState } from "../../protocol/types";
import { call, serves } from "../../session/connection";
import { getState, useEditor } from "../../store/store";

export interface Found {
  interlocks: Interlock[];
  states: Record<string, InterlockState>;
}

function byId(states: readonly InterlockState[]): Record<string, InterlockState> {
  return Object.fromEntries(states.map((each) => [each.id, { ...each, text: translate(each) }]));
}

/** Return the interlocks in their order; null until they are loaded. */
export function useInterlocks(): Found | null {
  const ready = useEditor((state) => state.connection.status === "ready");
  const scene = useEditor((state) => state.doc?.scene.id);
  const [found, setFound] = useState<Found | null>(null);
  useEffect(() => {
    if (!ready || !scene || !serves("ListInterlocks")) return;
    let current = true;
    const { runtime } = getState();
    runtime.takeInterlocks ??= new Set();
    const listeners = runtime.takeInterlocks;
    const take: Parameters<typeof listeners.add>[0] = (event) => {
      if (event.event === "InterlockStates") {
        const states = byId(event.data.interlocks);
        setFound((known) => known && { ...known, states });
        return;
      }
      const changed = event.data;
      const kind = event.change_type;
      setFound((known) => {
        if (!known) return known;
        const others = known.interlocks.filter((each) => each.id !== changed.id);
        if (kind === "remove") return { ...known, interlocks: others };
        if (kind === "add") return { ...known, interlocks: [...others, changed] };
        return { ...known, interlocks: known.interlocks.map((each) => (each.id === changed.id ? changed : each)) };
      });
    };
    listeners.add(take);
    call("ListInterlocks").then(
      ({ interlocks, states }) => current && setFound({ interlocks, states: byId(states) }),
      () => {}, // offline: loaded again after the reconnect
    );
    return () => {
      current = false;
      listeners.delete(take);
    };
  }, [ready, scene]);
  return found;
}
