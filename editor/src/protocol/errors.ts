/** Errors of requests. */

import { t } from "@lingui/core/macro";
import { type ServerMessage, translate } from "../i18n/serverMessages";

/** The server refused a request. The message is for the user, `code` is the machine-readable reason. */
export class Refused extends Error {
  override readonly name = "Refused";
  constructor(
    readonly request: string,
    readonly messages: string[],
    readonly code?: string,
    translation: Omit<ServerMessage, "text"> = {},
  ) {
    super(translate({ ...translation, text: messages.join(" ") }) || t`${request} was refused.`);
  }
}

/** There is no connection, or it was lost before the answer: whether the request was carried out is unknown. */
export class ConnectionLost extends Error {
  override readonly name = "ConnectionLost";
  constructor(
    readonly request: string,
    /** Whether the request was sent, and may have been carried out. */
    readonly sent: boolean,
  ) {
    super(sent ? t`The connection was lost before ${request} was answered.` : t`Not connected to the server.`);
  }
}

/** The server did not answer in time. It may still carry out the request. */
export class DeadlineExceeded extends Error {
  override readonly name = "DeadlineExceeded";
  constructor(
    readonly request: string,
    readonly seconds: number,
  ) {
    super(t`The server did not answer ${request} within ${seconds} s.`);
  }
}
