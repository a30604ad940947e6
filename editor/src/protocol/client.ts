/**
 * One connection to the server that comes back by itself: requests with ids and deadlines, events as they come.
 *
 * A request is sent once or not at all. What was under way when the connection was lost fails, and nothing is kept to
 * be sent later: no motion begins by itself when the connection is back.
 */

import { t } from "@lingui/core/macro";
import { ConnectionLost, DeadlineExceeded, Refused } from "./errors";
import type { Requests, ServerEvent } from "./types";

/** What the client needs of a WebSocket. */
export interface Socket {
  readonly readyState: number;
  send(text: string): void;
  close(code?: number, reason?: string): void;
  onopen: (() => void) | null;
  onclose: ((event: { code: number; reason: string }) => void) | null;
  onmessage: ((event: { data: unknown }) => void) | null;
}

export type ConnectionState = "closed" | "connecting" | "open" | "waiting";

export interface ClientOptions {
  open: () => Socket;
  /** Seconds before the first, and at most before any, new attempt. */
  backoff?: { first: number; most: number };
  /** Seconds without any message after which the server is asked whether it is there, and for which it may be silent then. */
  liveness?: { quiet: number; answer: number };
  random?: () => number;
}

export interface CallOptions {
  dryRun?: boolean;
  /** Seconds. */
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
  /** Key and values of the message, so that it can be translated. */
  key?: string;
  values?: Record<string, string | number>;
  data?: unknown;
  code?: string;
}

interface Waiting {
  request: string;
  resolve: (data: never) => void;
  reject: (error: Error) => void;
  done: () => void;
}

/** Seconds: what answers at once, and what waits for a device. */
export const DEADLINE = 15;
const OPEN = 1;
/** The server's code for a token that is missing or not valid: trying again would not help. */
const NOT_ADMITTED = 4401;

export class ProtocolClient {
  state: ConnectionState = "closed";
  /** Called with each change of the state; `reason` is the server's when it closed the connection. */
  onState: (state: ConnectionState, reason: string, code: number) => void = () => {};
  onEvent: (event: ServerEvent) => void = () => {};
  /** Messages that are no answer and no event of the protocol; only told. */
  onOddity: (text: string) => void = () => {};

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

  /** Connect, and stay connected until `stop`. */
  start(): void {
    if (this.state === "closed") this.connect();
  }

  /** Close, and don't come back. */
  stop(reason = "left"): void {
    clearTimeout(this.retry);
    const socket = this.detach();
    this.enter("closed", reason, 1000);
    this.failAll();
    socket?.close(1000, reason);
  }

  /** Try again at once instead of when the pause is over; for when the network, or the user, is back. */
  hurry(): void {
    if (this.state !== "waiting") return;
    clearTimeout(this.retry);
    this.connect();
  }

  /**
   * Ask the server. Rejects with Refused, ConnectionLost, DeadlineExceeded, or the signal's reason; never asks twice.
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
      socket.send(JSON.stringify({ id, request, args, dry_run: options?.dryRun || undefined, codes: true }));
    });
  }

  private connect(): void {
    this.enter("connecting", "", 0);
    const socket = this.options.open();
    this.socket = socket;
    socket.onopen = () => {
      this.attempts = 0;
      this.enter("open", "", 0);
      this.expectLife();
    };
    socket.onmessage = (event) => {
      this.expectLife();
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
      // Spread, so that not all tablets of a hall come at once.
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

  /** A cable that is pulled is told by nobody: who is silent is asked, and given up when there is no answer. */
  private expectLife(): void {
    clearTimeout(this.watch);
    this.watch = setTimeout(() => {
      if (this.state !== "open") return;
      this.call("SystemInfo", undefined, { deadline: this.liveness.answer }).catch((error: unknown) => {
        if (!(error instanceof DeadlineExceeded)) return;
        const socket = this.detach();
        this.lost(1006, t`The server does not answer.`);
        socket?.close();
      });
    }, this.liveness.quiet * 1000);
  }

  private receive(text: string): void {
    let message: Answer | ServerEvent;
    try {
      message = JSON.parse(text) as Answer | ServerEvent;
    } catch {
      this.onOddity(text.slice(0, 200));
      return;
    }
    if ("event" in message) {
      this.onEvent(message);
      return;
    }
    const waiting = this.waiting.get(message.id);
    if (!waiting) {
      if (message.id === 0) this.onOddity(text.slice(0, 200));
      return; // an answer after its deadline answers nothing any more
    }
    waiting.done();
    if (message.result) waiting.resolve(message.data as never);
    else waiting.reject(new Refused(waiting.request, message.messages ?? [], message.code, message));
  }
}
