/** Why a request was not granted. */

import { t } from "@lingui/core/macro";

/** The server refuses; the message is the sentence for the user, `code` names the reason where the server tells it. */
export class Refused extends Error {
  override readonly name = "Refused";
  constructor(
    readonly request: string,
    readonly messages: string[],
    readonly code?: string,
  ) {
    super(messages.join(" ") || t`${request} was refused.`);
  }
}

/** There is no connection, or it was lost before the answer came: what became of the request is not known. */
export class ConnectionLost extends Error {
  override readonly name = "ConnectionLost";
  constructor(
    readonly request: string,
    /** Whether the request had been sent: then it may have been carried out. */
    readonly sent: boolean,
  ) {
    super(sent ? t`The connection was lost before ${request} was answered.` : t`There is no connection to the server.`);
  }
}

/** No answer came in time. It may still be carried out. */
export class DeadlineExceeded extends Error {
  override readonly name = "DeadlineExceeded";
  constructor(
    readonly request: string,
    readonly seconds: number,
  ) {
    super(t`The server did not answer ${request} within ${seconds} s.`);
  }
}
