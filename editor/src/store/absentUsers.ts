/** Users who left: the locks they still hold, and whether others have the document open. Pure functions. */

import { compareTexts } from "../formats";
import type { State } from "./state";

/** Return users who hold locks but are not connected. */
export function absentLockHolders(state: State): string[] {
  if (state.connection.status !== "ready") return [];
  const owners = new Set(Object.values(state.locks));
  return [...owners].filter((name) => name !== state.connection.user && !state.users[name]?.online).sort(compareTexts);
}

/** Return other users who have the open document open, by the server's rule for RunPackage (docs/protocol.md). */
export function usersOfDocument(state: State): string[] {
  if (!state.doc) return [];
  const ids = [state.doc.project?.id, state.doc.scene.id];
  const owners = new Set(Object.values(state.locks));
  return Object.values(state.users)
    .filter(({ user, online, role, presence }) => {
      if (!online || user === state.connection.user) return false;
      return owners.has(user) || (presence ? ids.includes(presence.document) : role !== "operator");
    })
    .map(({ user }) => user)
    .sort(compareTexts);
}
