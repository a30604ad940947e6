/**
 * Hold-to-run: at most one motion at a time. It stops when the user releases the button, and when the page is hidden,
 * frozen or left, or loses the focus or the connection. The server stops it by itself within 300 ms.
 */

import type { JogRobotArgs } from "../protocol/types";
import { call } from "../session/connection";
import { getState, store } from "../store/store";
import { Lease, type LeaseRequest } from "./lease";
import { sentence, withLock } from "./requests";

type JogCommand = Omit<JogRobotArgs, "robot_id" | "hold" | "sent_ms" | "valid_ms">;

/** A running hold-to-run motion. `over` resolves at its end, with the reason if the user did not release it. */
export interface HoldToRunMotion {
  end: () => void;
  over: Promise<string>;
}

declare module "../store/runtime" {
  interface Runtime {
    /** The lease of the running hold-to-run motion. */
    lease?: Lease | undefined;
  }
}

/** Stop the running hold-to-run motion. */
export function stopHoldToRun(): void {
  getState().runtime.lease?.end();
}

export function holdJog(robot_id: string, command: JogCommand): HoldToRunMotion {
  return startHoldToRun(robot_id, (lease) => call("JogRobot", { robot_id, ...command, ...lease }));
}

export function holdHandTeaching(robot_id: string, arm_id?: string): HoldToRunMotion {
  return startHoldToRun(robot_id, (lease) =>
    call("HoldHandTeaching", { robot_id, ...(arm_id ? { arm_id } : {}), ...lease }),
  );
}

function startHoldToRun(robotId: string, send: (request: LeaseRequest) => Promise<unknown>): HoldToRunMotion {
  stopHoldToRun();
  const { runtime } = getState();
  const lease = new Lease(++runtime.holds, send);
  runtime.lease = lease;
  const unwatch = endWhenLeft(lease);
  const over = withLock(robotId, () => {
    lease.begin();
    return lease.over;
  })
    .catch(sentence)
    .then((reason) => {
      lease.end(); // not started if the lock was refused
      unwatch();
      if (runtime.lease === lease) runtime.lease = undefined;
      return reason;
    });
  return { end: () => lease.end(), over };
}

/** End a lease when the connection is lost or the user leaves the page. Return the function that stops watching. */
function endWhenLeft(lease: Lease): () => void {
  const watching = new AbortController();
  const end = () => lease.end();
  for (const event of ["blur", "pagehide"]) window.addEventListener(event, end, watching);
  for (const event of ["freeze", "visibilitychange"]) document.addEventListener(event, end, watching);
  const unsubscribe = store.subscribe(({ connection }) => {
    if (connection.status !== "ready") end();
  });
  return () => {
    watching.abort();
    unsubscribe();
  };
}
