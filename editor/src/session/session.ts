/**
 * The session of this page: connect, log in, request the data that it shows, and repeat this after a reconnect.
 * Motion is never requested here.
 */

import { t } from "@lingui/core/macro";
import type { ConnectionState, ProtocolClient } from "../protocol/client";
import { Refused } from "../protocol/errors";
import {
  ADDITIONAL_EVENTS,
  type AlarmRecord,
  type CellStatus,
  type ObjectObservationsData,
  type ObjectPointsData,
  type PartInventory,
  type RecordingChangedData,
  ROLES,
  type ServerEvent,
} from "../protocol/types";
import { isRunning } from "../store/selectors";
import { OFFLINE, type State } from "../store/state";
import { applyEvent, getState, setConnection, store } from "../store/store";
import { telemetry } from "../store/telemetry";
import { RobotArms } from "./arms";
import { call } from "./connection";
import { DocumentDetails } from "./documentDetails";
import type { Follower } from "./follower";
import { LanguageFollower } from "./language";
import { loadGeneralState, loadLists, loadTypes } from "./lists";
import { note } from "./log";
import { PresenceReporter } from "./presence";
import { ProgramDetails } from "./programDetails";
import { RobotStreams } from "./streams";

/** WebSocket close code of the server for a missing or invalid token. */
const TOKEN_REFUSED = 4401;
/** Code of the error if a request needs a token. */
const TOKEN_NEEDED = "token_needed";
/** Time limit for releasing locks before this page leaves the cell, s; the server releases them later otherwise. */
const RELEASE_TIMEOUT = 1;

declare module "../store/runtime" {
  interface Runtime {
    session?: Session;
    /** Receives the observations of devices, which bypass the store, while trends are shown. */
    takeObservations?: ((data: ObjectObservationsData) => void) | undefined;
    /** Receives the points of devices while the page with them is open. */
    takePoints?: ((data: ObjectPointsData) => void) | undefined;
    /** Receive changed alarms, which bypass the store, while they are shown. */
    takeAlarm?: Set<(record: AlarmRecord) => void>;
    /** Receive stored recordings, which bypass the store, while they are listed. */
    takeRecording?: Set<(changed: RecordingChangedData) => void>;
    /** Receive changed part inventories, which bypass the store, while they are shown. */
    takeParts?: Set<(inventory: PartInventory) => void>;
    /** Receive the changed state of the cell, which bypasses the store, while it is shown. */
    takeCell?: Set<(cell: CellStatus) => void>;
    /** Receive changed interlocks and their states, which bypass the store, while they are shown. */
    takeInterlocks?: Set<(event: Extract<ServerEvent, { event: "InterlockStates" | "InterlockChanged" }>) => void>;
  }
}

export class Session {
  private token = "";
  /** Number of the connection, so that an answer that belongs to an earlier one changes nothing. */
  private epoch = 0;
  /** The server serves pages, but the last attempts to open a websocket failed. */
  private socketRefused = false;
  private connecting = false;
  private readonly presence = new PresenceReporter();
  /** Followers whose data contain texts of the server. */
  private readonly details: readonly Follower[] = [new DocumentDetails(), new ProgramDetails()];
  private readonly followers: readonly Follower[] = [
    ...this.details,
    new RobotStreams(),
    new RobotArms(),
    this.presence,
    new LanguageFollower(() => this.retranslate()),
  ];

  constructor(private readonly client: ProtocolClient) {
    client.onEvent = (event) => this.onEvent(event);
    client.onState = (state, reason, code) => this.onState(state, reason, code);
    client.onInvalidMessage = (text) => {
      note("fault", `invalid message: ${text}`);
      console.warn("invalid message:", text);
    };
    store.subscribe((state, before) => this.follow(state, before));
    window.addEventListener("online", () => client.reconnectNow());
    document.addEventListener("visibilitychange", () => {
      if (!document.hidden) client.reconnectNow();
    });
  }

  /** Connect under a name. The token is needed if the server requires one. */
  join(user: string, token: string): void {
    this.token = token;
    setConnection({ status: "connecting", user, reason: "", needsToken: false, role: ROLES.programmer });
    this.client.stop(t`Joining again.`);
    this.client.start();
  }

  /** Release the locks of this user, and leave. */
  async releaseLocksAndLeave(): Promise<void> {
    await Promise.race([releaseOwnLocks(), new Promise((resolve) => setTimeout(resolve, RELEASE_TIMEOUT * 1000))]);
    this.leave();
  }

  leave(): void {
    this.client.stop();
    setConnection({ status: "left", reason: "" });
  }

  /** Report the presence after a change that is not part of the state: another screen is shown. */
  reportPresence(): void {
    this.presence.follow(getState());
  }

  /** Request the data again that contain texts of the server, which are translated when they arrive. */
  private retranslate(): void {
    if (getState().connection.status !== "ready") return;
    for (const each of this.details) each.reset();
    store.setState(({ program }) => ({ program: isRunning(getState()) ? { ...program, trace: [] } : program }));
    Promise.all([subscribe(), loadTypes(), loadLists()]).catch(() => {}); // offline: requested after the reconnect
  }

  private onEvent(event: ServerEvent): void {
    if (event.event === "RobotJoints") telemetry.takeJoints(event.data);
    else if (event.event === "RobotEef") telemetry.takeEef(event.data);
    else if (event.event === "ObjectObservations") getState().runtime.takeObservations?.(event.data);
    else if (event.event === "ObjectPoints") getState().runtime.takePoints?.(event.data);
    else if (event.event === "AlarmChanged") for (const take of getState().runtime.takeAlarm ?? []) take(event.data);
    else if (event.event === "RecordingChanged")
      for (const take of getState().runtime.takeRecording ?? []) take(event.data);
    else if (event.event === "PartsChanged") for (const take of getState().runtime.takeParts ?? []) take(event.data);
    else if (event.event === "CellChanged") for (const take of getState().runtime.takeCell ?? []) take(event.data);
    else if (event.event === "LogOnChanged")
      void import("./logOn").then(({ handleLogOnChanged }) =>
        handleLogOnChanged(event.data, () => this.onState("open", "", 0)),
      );
    else if (event.event === "InterlockStates" || event.event === "InterlockChanged")
      for (const take of getState().runtime.takeInterlocks ?? []) take(event);
    else {
      // Frequent events would displace all other entries of the diary.
      if (event.event !== "MovePreview" && event.event !== "UserPresence")
        note("event", `${event.event} ${event.change_type ?? ""}`);
      applyEvent(event);
    }
  }

  private onState(state: ConnectionState, reason: string, code: number): void {
    this.epoch++;
    note("connection", `${state} ${reason} ${code}`);
    const failed = this.connecting && state === "waiting" && !reason;
    this.connecting = state === "connecting";
    if (failed) void this.checkServer(this.epoch);
    if (state === "open") {
      this.socketRefused = false;
      for (const each of this.followers) each.reset();
      // The server sends locks, users and tasks again; the document stays on the screen.
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
      void this.enter(this.epoch);
    } else if (state === "waiting") {
      const was = getState().connection.status;
      setConnection({
        status: was === "ready" || was === "joining" || was === "lost" ? "lost" : "connecting",
        reason: reason || this.unreachable(),
      });
    } else if (state === "closed" && code === TOKEN_REFUSED) {
      const invalid = reason || t`The token is not valid.`;
      setConnection({ status: "refused", reason: this.token ? invalid : t`A token is needed.`, needsToken: true });
    }
  }

  private unreachable(): string {
    if (!this.socketRefused) return t`The server cannot be reached.`;
    const [problem, remedy] =
      location.protocol === "https:"
        ? [
            t`The server answers, but the browser refuses the live connection.`,
            t`Install the certificate of the server from http://${location.host}/ on this device.`,
          ]
        : [
            t`The server answers, but the live connection fails.`,
            t`Check the proxy or firewall between this device and the server.`,
          ];
    return `${problem} ${remedy}`;
  }

  /** Find out why a websocket cannot be opened: a browser may accept the certificate for the page only. */
  private async checkServer(epoch: number): Promise<void> {
    const request = { cache: "no-store", signal: AbortSignal.timeout(3000) } as const;
    const answers = await fetch("/healthz/ready", request).then(
      (response) => response.ok,
      () => false,
    );
    if (getState().connection.status === "ready" || answers === this.socketRefused) return;
    this.socketRefused = answers;
    if (epoch === this.epoch) setConnection({ reason: this.unreachable() });
  }

  /** Log in and load what the home screen needs. */
  private async enter(epoch: number): Promise<void> {
    const isCurrent = () => epoch === this.epoch;
    try {
      if (this.token) {
        const { role, shared = false } = await call("Authenticate", { token: this.token });
        setConnection({
          role: ROLES[role.toLowerCase().replace(" ", "_") as keyof typeof ROLES] ?? ROLES.operator,
          shared,
        });
      }
      const { shared, user } = getState().connection;
      if (shared) await (await import("./logOn")).waitForPerson();
      else if (user) await call("RegisterUser", { user_name: user });
      else this.leave();
      if (!isCurrent()) return;
      const server = await call("SystemInfo");
      if (!isCurrent()) return;
      setConnection({ server });
      // Nothing that the user changes from now on may be replaced by an older answer.
      await Promise.all([subscribe(), loadTypes(), loadLists(), loadGeneralState()]);
      if (!isCurrent()) return;
      await releaseOwnLocks();
      if (!isCurrent()) return;
      setConnection({ status: "ready", reason: "" });
    } catch (error) {
      if (!isCurrent()) return; // the connection is lost again, and the next one starts over
      if (error instanceof Refused) {
        this.client.stop(t`The server refused the user.`);
        const needsToken = error.code === TOKEN_NEEDED || error.request === "Authenticate";
        const reason = error.code === TOKEN_NEEDED ? t`A token is needed.` : error.message;
        setConnection({ status: "refused", reason, needsToken });
      } else {
        // For example an answer that took too long: without another attempt, the page would wait for ever.
        this.client.reconnect(error instanceof Error ? error.message : String(error));
      }
    }
  }

  private follow(state: State, before: State): void {
    if (state.live.state !== before.live.state && state.live.state === "stopped") telemetry.clear();
    for (const each of this.followers) each.follow(state);
    // Problems come and go with edits and with object types, and no event reports them.
    const edited =
      before.doc !== null || (before.connection.status === "ready" && before.types.byName !== state.types.byName);
    if (edited && !state.doc && state.connection.status === "ready") loadLists().catch(() => {});
  }
}

/** Release the locks that this user held when the connection was lost or the page was closed. */
async function releaseOwnLocks(): Promise<void> {
  const { locks, connection } = getState();
  const own = Object.keys(locks).filter((id) => locks[id] === connection.user);
  await Promise.allSettled(own.map((object_id) => call("WriteUnlock", { object_id })));
}

/** Subscribe to the additional events. An older server refuses the whole list if it does not know one of them. */
async function subscribe(): Promise<void> {
  try {
    await call("SubscribeEvents", { events: [...ADDITIONAL_EVENTS] });
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    await Promise.allSettled(ADDITIONAL_EVENTS.map((name) => call("SubscribeEvents", { events: [name] })));
  }
}

/** Create the session of this page. */
export function createSession(client: ProtocolClient): Session {
  const session = new Session(client);
  getState().runtime.session = session;
  return session;
}

/** Return the session of this page. */
export function theSession(): Session {
  const { session } = getState().runtime;
  if (!session) throw new Error("The page has no session yet. main.tsx creates it.");
  return session;
}
