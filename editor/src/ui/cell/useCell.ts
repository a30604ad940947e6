/** The cell as a machine: state, mode, authority and PLC, followed while a component shows them. */

import { useEffect, useState } from "react";
import type { CellStatus } from "../../protocol/types";
import { call, serves } from "../../session/connection";
import { getState, useEditor } from "../../store/store";

/** Return the last known state of the cell; undefined until it is loaded, null if that failed. */
export function useCell(): CellStatus | null | undefined {
  const ready = useEditor((state) => state.connection.status === "ready");
  const [cell, setCell] = useState<CellStatus | null>();
  useEffect(() => {
    if (!ready || !serves("GetCell")) return;
    let current = true;
    const { runtime } = getState();
    runtime.takeCell ??= new Set();
    const listeners = runtime.takeCell;
    listeners.add(setCell);
    call("GetCell").then(
      (answer) => current && setCell(answer),
      () => current && setCell((known) => known ?? null), // offline: loaded again after the reconnect
    );
    return () => {
      current = false;
      listeners.delete(setCell);
    };
  }, [ready]);
  return cell;
}
