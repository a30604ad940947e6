/**
 * The activity of this page: its connection, its 3D view, its operations. This part of the store changes without
 * notifying subscribers. A module above the store declares the type of its object with
 * `declare module`.
 */

import type { ProtocolClient } from "../protocol/client";

/** A lock of this page. */
export interface HeldLock {
  /** Number of operations that use it; the last one releases it. */
  users: number;
  /** Answer of the server to the request of the lock. */
  granted: Promise<unknown>;
}

export interface DiaryEntry {
  time: string;
  kind: "event" | "refused" | "fault" | "connection";
  text: string;
}

export interface Runtime {
  client?: ProtocolClient;
  /** Locks by the id of the item, followed by `/tree` for locks of a tree. */
  readonly locks: Map<string, HeldLock>;
  /** Number of hold-to-run motions since the page was opened. The server requires increasing numbers. */
  holds: number;
  /** Save times of the documents whose thumbnail was requested. */
  readonly thumbnailTimes: Map<string, string>;
  /** Recent events and faults, oldest first. */
  readonly diary: DiaryEntry[];
}

export function initialRuntime(): Runtime {
  return { locks: new Map(), holds: 0, thumbnailTimes: new Map(), diary: [] };
}
