/** The device cards, loaded again when the state of a device changes. */

import { useCallback, useEffect, useState } from "react";
import { sortedCards } from "../../commands/maintenance";
import type { DeviceCard } from "../../protocol/types";
import { call } from "../../session/connection";
import { useEditor } from "../../store/store";

/** Return the cards, null until they are loaded, and the function that loads them again. */
export function useDeviceCards(): { cards: DeviceCard[] | null; reload: () => Promise<void> } {
  const ready = useEditor((state) => state.connection.status === "ready");
  const objects = useEditor((state) => state.live.objects);
  const health = useEditor((state) => state.live.health);
  const [cards, setCards] = useState<DeviceCard[] | null>(null);
  const reload = useCallback(async () => {
    try {
      setCards(sortedCards((await call("ListDeviceCards")).devices));
    } catch {
      // Disconnected: loaded again after the reconnect.
    }
  }, []);
  // A device that connects or is confirmed changes its card.
  useEffect(() => {
    if (ready) void reload();
  }, [ready, objects, health, reload]);
  return { cards, reload };
}
