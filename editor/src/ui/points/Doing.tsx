/** What was refused is shown where it was asked for. */

import { useState } from "react";

/** Ask, and keep why it was refused until something else is asked. */
export function useAsking(): { refused: string; busy: boolean; ask: (work: Promise<string>) => Promise<boolean> } {
  const [refused, setRefused] = useState("");
  const [busy, setBusy] = useState(false);
  const ask = async (work: Promise<string>): Promise<boolean> => {
    setBusy(true);
    setRefused("");
    const why = await work;
    setBusy(false);
    setRefused(why);
    return why === "";
  };
  return { refused, busy, ask };
}

export function RefusedText({ children }: { children: string }) {
  if (!children) return null;
  return (
    <p className="error small" role="alert">
      {children}
    </p>
  );
}
