/** Requests to the REST interface of the server, with the token of the user. */

import { t } from "@lingui/core/macro";
import { type ServerMessage, translate } from "../i18n/serverMessages";
import { getState } from "../store/store";
import { remembered } from "./localStorage";

/** Time limit of a request, and of one that transfers a file, s. */
const DEADLINE = 30;
export const FILE_DEADLINE = 600;

interface RestOptions extends Pick<RequestInit, "method"> {
  /** Body that is sent as JSON, or as it is. */
  json?: unknown;
  body?: FormData;
  /** Text of the error, without the final dot, if the server states no reason. */
  failure?: string;
  /** Time limit of the whole answer, s. */
  deadline?: number;
}

/** Send a request and return the response. Reject with the reason of the server, or a missing answer, as a sentence. */
export async function rest(
  path: string,
  { method, json, body, failure, deadline = DEADLINE }: RestOptions = {},
): Promise<Response> {
  const headers = new Headers();
  const token = remembered("token");
  if (token) headers.set("Authorization", `Bearer ${token}`);
  const { session } = getState().connection;
  if (session) headers.set("Arcor2-Session", session);
  if (json !== undefined) headers.set("Content-Type", "application/json");
  const content = json === undefined ? body : JSON.stringify(json);
  const signal = AbortSignal.timeout(deadline * 1000);
  const request = { method: method ?? "GET", headers, signal, ...(content === undefined ? {} : { body: content }) };
  const response = await fetch(path, request).catch((error: unknown) => {
    throw signal.aborted ? new Error(t`The server did not answer within ${deadline} s.`) : error;
  });
  if (!response.ok) throw new Error(await reasonOf(response, failure ?? t`The server refused the request`));
  return response;
}

async function reasonOf(response: Response, failure: string): Promise<string> {
  const body = (await response.json().catch(() => ({}))) as Omit<ServerMessage, "text"> & { message?: string };
  return body.message === undefined ? `${failure} (${response.status}).` : translate({ ...body, text: body.message });
}
