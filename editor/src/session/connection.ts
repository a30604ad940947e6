/** The connection to the server: requests, and which of them the server knows. */

import { type CallOptions, ProtocolClient } from "../protocol/client";
import type { Requests } from "../protocol/types";
import { getState } from "../store/store";
import { note } from "./log";

/** Create the client of this page. */
export function createClient(): ProtocolClient {
  const client = new ProtocolClient({ open: () => new WebSocket(address()) as never });
  getState().runtime.client = client;
  return client;
}

/** Return the client of this page. */
export function theClient(): ProtocolClient {
  const { client } = getState().runtime;
  if (!client) throw new Error("The page has no client yet. main.tsx creates it.");
  return client;
}

function address(): string {
  return `${location.protocol === "https:" ? "wss" : "ws"}://${location.host}/ws`;
}

/** Send a request; see ProtocolClient.call. */
export function call<N extends keyof Requests>(
  request: N,
  args?: Requests[N]["args"],
  options?: CallOptions,
): Promise<Requests[N]["data"]> {
  const client = theClient();
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

/** Return whether the server knows one of our additional requests. */
export function serves(request: keyof Requests): boolean {
  return getState().connection.server?.supported_rpc_requests.includes(request) ?? false;
}
