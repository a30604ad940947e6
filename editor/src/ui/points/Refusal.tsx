/** Show a refusal next to the control that caused it. */

import { useState } from "react";

/** Return a function that sends a request, whether it is running, and its refusal until the next request. */
export function useRefusal(): { refused: string; busy: boolean; ask: (work: Promise<string>) => Promise<boolean> } {
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
