/**
 * Hold-to-run: at most one motion at a time. It stops when the user releases the button, and when the page is hidden,
 * frozen or left, or loses the focus or the connection. The server stops it by itself within 300 ms.
 */

import type { JogRobotArgs } from "../protocol/types";
import { call } from "../session/connection";
import { store } from "../store/store";
import { Lease, type LeaseRequest } from "./lease";
import { held, sentence } from "./requests";

export type JogWhat = Omit<JogRobotArgs, "robot_id" | "hold" | "sent_ms" | "valid_ms">;

/** A held motion. `over` resolves with the reason if it ended for another reason than release. */
export interface Held {
  end: () => void;
  over: Promise<string>;
}

let current: Lease | null = null;

/** Release everything. */
export function endHolds(): void {
  current?.end();
}

export function holdJog(robot_id: string, what: JogWhat): Held {
  return hold(robot_id, (lease) => call("JogRobot", { robot_id, ...what, ...lease }));
}

export function holdHandTeaching(robot_id: string, arm_id?: string): Held {
  return hold(robot_id, (lease) => call("HoldHandTeaching", { robot_id, ...(arm_id ? { arm_id } : {}), ...lease }));
}

function hold(robotId: string, send: (request: LeaseRequest) => Promise<unknown>): Held {
  endHolds();
  const lease = new Lease(send);
  current = lease;
  const over = held(robotId, () => {
    lease.begin();
    return lease.over;
  })
    .catch(sentence)
    .then((reason) => {
      lease.end(); // not started if the lock was refused
      if (current === lease) current = null;
      return reason;
    });
  return { end: () => lease.end(), over };
}

store.subscribe((state) => {
  if (current && state.connection.status !== "ready") endHolds();
});

if (typeof window !== "undefined") {
  for (const event of ["blur", "pagehide"]) window.addEventListener(event, endHolds);
  for (const event of ["freeze", "visibilitychange"]) document.addEventListener(event, endHolds);
}
