/** How others join this server. */

import { remembered } from "../session/memory";

export interface Joining {
  /** The best first; empty when only this machine reaches the server. */
  addresses: string[];
  /** SHA-256 of the certificate; empty without TLS. */
  fingerprint: string;
}

/** Ask the server; where it does not say, others may come as this page did. */
export async function howToJoin(): Promise<Joining> {
  const token = remembered("token");
  const here = isHere(location.hostname) ? [] : [location.origin];
  try {
    const response = await fetch("/api/joining", { headers: token ? { Authorization: `Bearer ${token}` } : {} });
    if (!response.ok) throw new Error(`${response.status}`);
    const { addresses, fingerprint } = (await response.json()) as Partial<Joining>;
    // How this page was reached is known to work.
    return { addresses: [...new Set([...here, ...(addresses ?? [])])], fingerprint: fingerprint ?? "" };
  } catch {
    return { addresses: here, fingerprint: "" };
  }
}

/** Whether a host is this machine to itself, so that nobody else gets anywhere by it. A name may begin with digits, too. */
export const isHere = (host: string) =>
  host === "localhost" ||
  host.endsWith(".localhost") ||
  host === "[::1]" ||
  host === "0.0.0.0" ||
  /^127(\.\d{1,3}){3}$/.test(host);
