/**
 * Keeps this tablet in the session: connects, logs in, asks for what it needs to know, and does all that again
 * whenever the connection comes back. Motion is never asked for here.
 */

import { t } from "@lingui/core/macro";
import { type CallOptions, ProtocolClient } from "../protocol/client";
import { Refused } from "../protocol/errors";
import { ADDITIONAL_EVENTS, type Requests, ROLES, type ServerEvent } from "../protocol/types";
import { OFFLINE } from "../store/state";
import { applyEvent, now, setConnection, store, tell } from "../store/store";
import { telemetry } from "../store/telemetry";
import { followArms, forgetArms } from "./arms";
import { note } from "./diary";
import { followDocument, forgetFollowed } from "./following";
import { forgetPresence, tellPresence } from "./presence";
import { followPrograms, forgetPrograms } from "./programs";
import { followRobots, forgetStreams } from "./streams";

export const client = new ProtocolClient({ open: () => new WebSocket(address()) as never });

/** Ask the server; see ProtocolClient.call. */
export function call<N extends keyof Requests>(
  request: N,
  args?: Requests[N]["args"],
  options?: CallOptions,
): Promise<Requests[N]["data"]> {
  const answer = (client.call as (...given: unknown[]) => Promise<Requests[N]["data"]>).call(
    client,
    request,
    args,
    options,
  );
  if (!options?.dryRun)
    answer.catch((error) => note("refused", `${request}: ${error instanceof Error ? error.message : error}`));
  return answer;
}

/** Tell whether the server serves a request of ours. */
export function serves(request: keyof Requests): boolean {
  return now().connection.server?.supported_rpc_requests.includes(request) ?? false;
}

let token = "";
/** Counts the connections, so that an answer for an earlier one changes nothing. */
let epoch = 0;

function address(): string {
  return `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`;
}

/** Connect under a name. The token is needed where the server asks for one. */
export function join(user: string, withToken: string): void {
  token = withToken;
  setConnection({ status: "connecting", user, reason: "", role: ROLES.programmer });
  client.stop(t`Joining again.`);
  client.start();
}

export function leave(): void {
  client.stop();
  setConnection({ status: "left", reason: "" });
}

client.onEvent = (event: ServerEvent) => {
  if (event.event === "RobotJoints") telemetry.takeJoints(event.data);
  else if (event.event === "RobotEef") telemetry.takeEef(event.data);
  else {
    // Of a stream nobody wants to read each.
    if (event.event !== "MovePreview" && event.event !== "UserPresence")
      note("event", `${event.event} ${event.change_type ?? ""}`);
    applyEvent(event);
  }
};

client.onState = (state, reason, code) => {
  epoch++;
  note("connection", `${state} ${reason ?? ""} ${code ?? ""}`);
  if (state === "open") {
    forgetStreams();
    forgetArms();
    forgetFollowed();
    forgetPresence();
    forgetPrograms();
    // What is held, who is there and what is under way is told anew; the view and the document stay.
    store.setState((known) => ({
      locks: {},
      lockedAt: {},
      users: {},
      tasks: {},
      previews: {},
      live: known.live.state === "stopped" ? OFFLINE : { ...OFFLINE, state: known.live.state },
      program: { ...known.program, running: [] },
    }));
    setConnection({ status: "joining" });
    void enter(epoch);
  } else if (state === "waiting") {
    const was = now().connection.status;
    setConnection({
      status: was === "ready" || was === "joining" || was === "lost" ? "lost" : "connecting",
      reason: reason || t`The server cannot be reached.`,
    });
  } else if (state === "closed" && code === 4401) {
    setConnection({ status: "refused", reason: token ? reason || t`The token is not valid.` : t`A token is needed.` });
  }
};

client.onOddity = (text) => {
  note("fault", t`Invalid message: ${text}`);
  console.warn(t`not understood:`, text);
};

async function enter(mine: number): Promise<void> {
  const current = () => mine === epoch;
  try {
    if (token) {
      const { role } = await call("Authenticate", { token });
      setConnection({ role: ROLES[role.toLowerCase().replace(" ", "_") as keyof typeof ROLES] ?? ROLES.operator });
    }
    await call("RegisterUser", { user_name: now().connection.user });
    const server = await call("SystemInfo");
    if (!current()) return;
    setConnection({ server });
    await Promise.all([subscribe(), loadTypes(), loadLists()]);
    if (!current()) return;
    await letGo();
    if (!current()) return;
    setConnection({ status: "ready", reason: "" });
  } catch (error) {
    if (!current()) return; // the connection is lost again: it will be tried anew
    if (error instanceof Refused) {
      client.stop(t`The server refused the user.`);
      setConnection({ status: "refused", reason: error.message });
    } else {
      tell("error", error instanceof Error ? error.message : String(error));
    }
  }
}

/** Give back what the user still held when his connection was lost or his page ended: nobody has it in hand any more. */
async function letGo(): Promise<void> {
  const { locks, connection } = now();
  const mine = Object.keys(locks).filter((id) => locks[id] === connection.user);
  await Promise.allSettled(mine.map((object_id) => call("WriteUnlock", { object_id })));
}

/** An older server knows fewer events, and refuses all when it does not know one. */
async function subscribe(): Promise<void> {
  try {
    await call("SubscribeEvents", { events: [...ADDITIONAL_EVENTS] });
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    await Promise.allSettled(ADDITIONAL_EVENTS.map((name) => call("SubscribeEvents", { events: [name] })));
  }
}

async function loadTypes(): Promise<void> {
  const [types, robots] = await Promise.all([call("GetObjectTypes"), call("GetRobotMeta")]);
  store.setState({
    types: {
      byName: Object.fromEntries(types.map((type) => [type.type, type])),
      robots: Object.fromEntries(robots.map((robot) => [robot.type, robot])),
      actions: {},
    },
  });
}

/** Read the three lists of the home screen; events keep them up to date, but for problems, which only lists tell. */
export async function loadLists(): Promise<void> {
  const read = async <K extends "scenes" | "projects" | "packages">(
    key: K,
    request: "ListScenes" | "ListProjects" | "ListPackages",
  ) => {
    const items = await call(request);
    store.setState((state) => ({ lists: { ...state.lists, [key]: items } }));
  };
  await Promise.all([read("scenes", "ListScenes"), read("projects", "ListProjects"), read("packages", "ListPackages")]);
}

/** Give the actions of a type, asked for once. */
export async function actionsOf(type: string): Promise<void> {
  if (type in now().types.actions) return;
  const actions = await call("GetActions", { type });
  store.setState((state) => ({ types: { ...state.types, actions: { ...state.types.actions, [type]: actions } } }));
}

store.subscribe((state, before) => {
  if (state.live.state !== before.live.state && state.live.state === "stopped") telemetry.clear();
  followDocument(state);
  followRobots(state);
  followArms(state);
  tellPresence(state, now);
  followPrograms(state);
  // Problems, which no event tells, may have come or gone with what was edited, or with a kind of object.
  const mended =
    before.doc !== null || (before.connection.status === "ready" && before.types.byName !== state.types.byName);
  if (mended && !state.doc && state.connection.status === "ready") loadLists().catch(() => {});
});

if (typeof window !== "undefined") {
  window.addEventListener("online", () => client.hurry());
  document.addEventListener("visibilitychange", () => {
    if (!document.hidden) client.hurry();
  });
}
