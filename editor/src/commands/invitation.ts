/** The data with which other users can join this server. */

import { rest } from "../session/rest";

export interface InvitationData {
  /** Addresses, best first; empty if only this computer can reach the server. */
  addresses: string[];
  /** SHA-256 fingerprint of the certificate; empty without TLS. */
  fingerprint: string;
  /** SHA-256 fingerprint of the local certificate authority; empty if the server has none. */
  authority: string;
}

/** Request the data from the server. An older server does not have it: return the address of this page. */
export async function loadInvitation(): Promise<InvitationData> {
  const here = isLocalHost(location.hostname) ? [] : [location.origin];
  try {
    const response = await rest("/api/joining");
    const { addresses, fingerprint, authority } = (await response.json()) as Partial<InvitationData>;
    // The address of this page is known to work.
    return {
      addresses: [...new Set([...here, ...(addresses ?? [])])],
      fingerprint: fingerprint ?? "",
      authority: authority ?? "",
    };
  } catch {
    return { addresses: here, fingerprint: "", authority: "" };
  }
}

/** Return whether a host name means the local computer, which other devices cannot reach. */
export const isLocalHost = (host: string) =>
  host === "localhost" ||
  host.endsWith(".localhost") ||
  host === "[::1]" ||
  host === "0.0.0.0" ||
  /^127(\.\d{1,3}){3}$/.test(host);
