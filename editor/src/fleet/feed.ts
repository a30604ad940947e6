/** The connection of the page to the server of the fleet: it receives cards, and sends nothing. */

import type { FleetCard, FleetUpdate } from "../protocol/types";

/** Close code of the server for a missing or invalid token. */
const NOT_ADMITTED = 4401;
/** Time without a message after which the shown cells are outdated, ms. The server sends a message each second. */
const SILENCE = 1900;
/** Pause before the next attempt to connect, ms. */
const RETRY = 1000;

export interface Fleet {
  cards: ReadonlyMap<string, FleetCard>;
  /** Whether the server of the fleet answers. */
  connected: boolean;
  /** Whether it is connected to the broker. */
  broker: boolean;
  /** Whether cards have been received. */
  loaded: boolean;
  needsToken: boolean;
}

const NOTHING: Fleet = { cards: new Map(), connected: false, broker: true, loaded: false, needsToken: false };

/** Return the cards after an update. The first update after a connection contains all cards. */
export function updated(cards: Fleet["cards"], { cells, removed }: FleetUpdate, first: boolean): Fleet["cards"] {
  if (!first && cells.length === 0 && removed.length === 0) return cards;
  const next = new Map(first ? [] : cards);
  for (const id of removed) next.delete(id);
  for (const card of cells) next.set(card.id, card);
  return next;
}

export class FleetFeed {
  private fleet = NOTHING;
  private token = "";
  private readonly listeners = new Set<() => void>();

  /** Call a function after each change, until the returned function is called. */
  readonly subscribe = (changed: () => void): (() => void) => {
    this.listeners.add(changed);
    return () => this.listeners.delete(changed);
  };

  readonly present = (): Fleet => this.fleet;

  /** Connect, and connect again whenever the connection is lost. */
  connect(token: string): void {
    this.token = token;
    this.show({ needsToken: false });
    this.open();
  }

  private show(changes: Partial<Fleet>): void {
    this.fleet = { ...this.fleet, ...changes };
    for (const changed of this.listeners) changed();
  }

  private open(): void {
    const url = new URL("/ws", location.href);
    url.protocol = location.protocol === "https:" ? "wss:" : "ws:";
    if (this.token) url.searchParams.set("token", this.token);
    const socket = new WebSocket(url);
    let first = true;
    let silence = 0;
    let over = false;
    const end = (code: number) => {
      if (over) return;
      over = true;
      clearTimeout(silence);
      socket.close();
      if (code === NOT_ADMITTED) this.show({ connected: false, needsToken: true });
      else {
        this.show({ connected: false });
        setTimeout(() => this.open(), RETRY);
      }
    };
    const listen = () => {
      clearTimeout(silence);
      silence = window.setTimeout(() => end(0), SILENCE);
    };
    socket.onopen = listen;
    socket.onclose = (event) => end(event.code);
    socket.onmessage = (event) => {
      if (over) return;
      listen();
      const update = JSON.parse(String(event.data)) as FleetUpdate;
      const cards = updated(this.fleet.cards, update, first);
      first = false;
      const { connected, broker, loaded } = this.fleet;
      if (cards !== this.fleet.cards || !connected || !loaded || broker !== update.broker)
        this.show({ cards, connected: true, broker: update.broker, loaded: true });
    };
  }
}
