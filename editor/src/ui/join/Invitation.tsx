/** Data for others to join: the address as a QR code, and the fingerprint to compare. */

import { t } from "@lingui/core/macro";
import encodeQR from "qr";
import { useEffect, useState } from "react";
import { type InvitationData, loadInvitation } from "../../commands/invitation";
import { Waiting } from "../kit/kit";
import "./invitation.css";

/** Quiet zone of a QR code, modules. */
const QUIET = 4;

export function Invitation() {
  const [joining, setJoining] = useState<InvitationData | null>(null);
  useEffect(() => {
    let over = false;
    void loadInvitation().then((found) => over || setJoining(found));
    return () => {
      over = true;
    };
  }, []);
  if (!joining) return <Waiting>{t`Loading…`}</Waiting>;
  const { addresses, fingerprint, authority } = joining;
  const [best, ...others] = addresses;
  return (
    <section className="invitation" aria-label={t`Invite others`}>
      <h3>{t`Others join at`}</h3>
      {best === undefined ? (
        <p className="small">
          {t`The server accepts connections from this computer only. To let others join, start it with:`}{" "}
          <code>arcor2-hw serve --host 0.0.0.0</code>{" "}
          {t`It then requires TLS and a token per user. Create a token with:`} <code>arcor2-hw token add</code>
        </p>
      ) : (
        <>
          <Code text={best} />
          <div>
            <p>
              <strong>{best}</strong>
            </p>
            {others.length > 0 && <p className="quiet small">{t`or at ${others.join(", ")}`}</p>}
            <p className="quiet small">
              {t`Scan the code with a tablet. If the server asks for a token, every user needs their own.`}
            </p>
          </div>
        </>
      )}
      {authority && best !== undefined && (
        <p className="small trust">
          {t`On a new device, open this address once and install the certificate of the server:`}{" "}
          <strong>{best.replace(/^https:/, "http:")}</strong>
          <br />
          {t`The page shows this SHA-256 fingerprint:`} <code>{authority}</code>
        </p>
      )}
      {fingerprint && (
        <p className="small fingerprint">
          {t`If the browser warns about the certificate, compare its SHA-256 fingerprint:`} <code>{fingerprint}</code>
        </p>
      )}
    </section>
  );
}

/** Black on white in the dark theme too: not every camera reads inverted codes. */
function Code({ text }: { text: string }) {
  const rows = encodeQR(text, "raw", { ecc: "medium", border: QUIET });
  const path = rows.flatMap((row, y) => row.map((black, x) => (black ? `M${x} ${y}h1v1h-1z` : ""))).join("");
  return (
    <svg
      className="join-code"
      viewBox={`0 0 ${rows.length} ${rows.length}`}
      role="img"
      aria-label={t`QR code of ${text}`}
      shapeRendering="crispEdges"
    >
      <path className="paper" d={`M0 0h${rows.length}v${rows.length}h-${rows.length}z`} />
      <path d={path} />
    </svg>
  );
}
