/** Values of an action with their names. */

import { t } from "@lingui/core/macro";
import { plain } from "../../viewmodel/items";

/** Longer values can be expanded. */
const SHORT = 60;

export function Values({ names, values }: { names: string[]; values: string[] }) {
  return (
    <dl className="values">
      {values.map((value, index) => (
        <div key={index}>
          <dt>{names[index] ?? t`result ${index + 1}`}</dt>
          <dd>
            <Value json={value} />
          </dd>
        </div>
      ))}
    </dl>
  );
}

function Value({ json }: { json: string }) {
  const image = pictureOf(json);
  if (image) return <img src={image} alt={t`Camera picture`} />;
  const text = json === "true" ? t`yes` : json === "false" ? t`no` : plain(json);
  if (text.length <= SHORT) return text;
  return (
    <details>
      <summary>{text.slice(0, SHORT)}…</summary>
      {text}
    </details>
  );
}

/** Pictures are base64-encoded JPEG or PNG. */
function pictureOf(json: string): string | null {
  const found = /^"((?:\/9j\/|iVBOR)[A-Za-z0-9+/=]+)"$/.exec(json);
  if (!found?.[1]) return null;
  return `data:image/${found[1].startsWith("/9j/") ? "jpeg" : "png"};base64,${found[1]}`;
}
