/**
 * A connection to the server with automatic reconnect: requests with ids and time limits, events. A request is sent
 * once or not at all. Requests in progress fail on disconnect, and none is stored: no motion starts by itself after a
 * reconnect.
 */

import { t } from "@lingui/core/macro";
import { inUserLanguage, type ServerMessage } from "../i18n/serverMessages";
import { ConnectionLost, DeadlineExceeded, Refused } from "./errors";
import type { Requests, ServerEvent } from "./types";

/** The part of a WebSocket that the client uses. */
export interface Socket {
  readonly readyState: number;
  send(text: string): void;
  close(code?: number, reason?: string): void;
  onopen: (() => void) | null;
  onclose: ((event: { code: number; reason: string }) => void) | null;
  onmessage: ((event: { data: unknown }) => void) | null;
}

export type ConnectionState = "closed" | "connecting" | "open" | "waiting";

interface ClientOptions {
  open: () => Socket;
  /** Delay before the first attempt to reconnect, and largest delay, s. */
  backoff?: { first: number; most: number };
  /** Silence after which the client sends a request to check the connection, and time limit of its answer, s. */
  liveness?: { quiet: number; answer: number };
  random?: () => number;
}

export interface CallOptions {
  dryRun?: boolean;
  /** Name of a step: edits of the user with the same name are undone together. */
  step?: string | undefined;
  /** Time limit of the connection, s. */
  deadline?: number;
  signal?: AbortSignal;
}

type Args<N extends keyof Requests> = undefined extends Requests[N]["args"]
  ? [args?: Requests[N]["args"], options?: CallOptions]
  : [args: Requests[N]["args"], options?: CallOptions];

interface Answer {
  id: number;
  response: string;
  result: boolean;
  messages?: string[];
  /** What is needed to translate the message. */
  key?: ServerMessage["key"];
  values?: ServerMessage["values"];
  data?: unknown;
  code?: string;
}

interface Waiting {
  request: string;
  resolve: (data: never) => void;
  reject: (error: Error) => void;
  done: () => void;
}

/** Default time limit of a request, s. */
export const DEADLINE = 15;
const OPEN = 1;
/** Close code for a missing or invalid token; a further attempt would fail too. */
const NOT_ADMITTED = 4401;

export class ProtocolClient {
  state: ConnectionState = "closed";
  /** Called on each change of the state; `reason` is the server's if it closed the connection. */
  onState: (state: ConnectionState, reason: string, code: number) => void = () => {};
  onEvent: (event: ServerEvent) => void = () => {};
  /** Called with messages that are neither answers nor known events. */
  onInvalidMessage: (text: string) => void = () => {};

  private socket: Socket | null = null;
  private number = 0;
  private attempts = 0;
  private readonly waiting = new Map<number, Waiting>();
  private retry: ReturnType<typeof setTimeout> | undefined;
  private watch: ReturnType<typeof setTimeout> | undefined;
  private readonly backoff: { first: number; most: number };
  private readonly liveness: { quiet: number; answer: number };
  private readonly random: () => number;

  constructor(private readonly options: ClientOptions) {
    this.backoff = options.backoff ?? { first: 0.2, most: 3 };
    this.liveness = options.liveness ?? { quiet: 4, answer: 3 };
    this.random = options.random ?? Math.random;
  }

  /** Connect, and reconnect until `stop`. */
  start(): void {
    if (this.state === "closed") this.connect();
  }

  /** Close the connection for good. */
  stop(reason = "left"): void {
    clearTimeout(this.retry);
    const socket = this.detach();
    this.enter("closed", reason, 1000);
    this.failAll();
    socket?.close(1000, reason);
  }

  /** Reconnect at once, since the network or the user is back. */
  reconnectNow(): void {
    if (this.state !== "waiting") return;
    clearTimeout(this.retry);
    this.connect();
  }

  /** Drop the current connection, and open another one after a pause. */
  reconnect(reason: string): void {
    const socket = this.detach();
    this.lost(1006, reason);
    socket?.close();
  }

  /**
   * Send a request. Reject with Refused, ConnectionLost, DeadlineExceeded, or the signal's reason; never send it twice.
   */
  call<N extends keyof Requests>(request: N, ...[args, options]: Args<N>): Promise<Requests[N]["data"]> {
    const socket = this.socket;
    if (this.state !== "open" || !socket || socket.readyState !== OPEN) {
      return Promise.reject(new ConnectionLost(request, false));
    }
    const signal = options?.signal;
    if (signal?.aborted) return Promise.reject(signal.reason as Error);
    const id = ++this.number;
    const seconds = options?.deadline ?? DEADLINE;
    return new Promise((resolve, reject) => {
      const end = (error: Error) => {
        this.waiting.get(id)?.done();
        reject(error);
      };
      const aborted = () => end(signal?.reason as Error);
      const timer = setTimeout(() => end(new DeadlineExceeded(request, seconds)), seconds * 1000);
      signal?.addEventListener("abort", aborted, { once: true });
      const done = () => {
        this.waiting.delete(id);
        clearTimeout(timer);
        signal?.removeEventListener("abort", aborted);
      };
      this.waiting.set(id, { request, resolve: resolve as (data: never) => void, reject, done });
      const { dryRun, step } = options ?? {};
      socket.send(JSON.stringify({ id, request, args, dry_run: dryRun || undefined, step, codes: true }));
    });
  }

  private connect(): void {
    this.enter("connecting", "", 0);
    const socket = this.options.open();
    this.socket = socket;
    socket.onopen = () => {
      this.attempts = 0;
      this.enter("open", "", 0);
      this.watchLiveness();
    };
    socket.onmessage = (event) => {
      this.watchLiveness();
      this.receive(String(event.data));
    };
    socket.onclose = (event) => this.lost(event.code, event.reason);
  }

  private detach(): Socket | null {
    clearTimeout(this.watch);
    const socket = this.socket;
    this.socket = null;
    if (socket) socket.onopen = socket.onmessage = socket.onclose = null;
    return socket;
  }

  private lost(code: number, reason: string): void {
    this.detach();
    if (code === NOT_ADMITTED) {
      this.enter("closed", reason, code);
    } else {
      this.enter("waiting", reason, code);
      const pause = Math.min(this.backoff.most, this.backoff.first * 2 ** this.attempts++);
      // Randomised, so that not all devices reconnect at once.
      this.retry = setTimeout(() => this.connect(), pause * (0.75 + 0.5 * this.random()) * 1000);
    }
    this.failAll();
  }

  private failAll(): void {
    for (const each of [...this.waiting.values()]) {
      each.done();
      each.reject(new ConnectionLost(each.request, true));
    }
  }

  private enter(state: ConnectionState, reason: string, code: number): void {
    this.state = state;
    this.onState(state, reason, code);
  }

  /** Check the connection after a silence, since a pulled cable is not reported: send a request, or reconnect. */
  private watchLiveness(): void {
    clearTimeout(this.watch);
    this.watch = setTimeout(() => {
      if (this.state !== "open") return;
      this.call("SystemInfo", undefined, { deadline: this.liveness.answer }).catch((error: unknown) => {
        if (!(error instanceof DeadlineExceeded)) return;
        this.reconnect(t`The server does not answer.`);
      });
    }, this.liveness.quiet * 1000);
  }

  private receive(text: string): void {
    let message: Answer | ServerEvent;
    try {
      message = JSON.parse(text) as Answer | ServerEvent;
    } catch {
      this.onInvalidMessage(text.slice(0, 200));
      return;
    }
    if ("event" in message) {
      this.onEvent({ ...message, data: inUserLanguage(message.data) } as ServerEvent);
      return;
    }
    const waiting = this.waiting.get(message.id);
    if (!waiting) {
      if (message.id === 0) this.onInvalidMessage(text.slice(0, 200));
      return; // too late: the request has already failed
    }
    waiting.done();
    if (message.result) waiting.resolve(message.data as never);
    else waiting.reject(new Refused(waiting.request, message.messages ?? [], message.code, message));
  }
}
