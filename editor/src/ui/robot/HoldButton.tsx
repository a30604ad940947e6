/**
 * A button that acts while it is held, by finger, mouse or key. Other causes that end it (page hidden, disconnect) are
 * in commands/holdToRun.ts.
 */

import { t } from "@lingui/core/macro";
import { type ReactNode, useEffect, useRef, useState } from "react";
import type { HoldToRunMotion } from "../../commands/holdToRun";
import { notify } from "../../store/store";

interface HoldButtonProps {
  /** Label for screen readers. */
  label: string;
  /** The reason why it is not available; empty if it is available. */
  why?: string;
  className?: string;
  onHold: () => HoldToRunMotion;
  /** Called at the end, with the reason if it was not released. */
  onOver?: (reason: string) => void;
  children: ReactNode;
}

export function HoldButton({ label, why = "", className = "", onHold, onOver, children }: HoldButtonProps) {
  const held = useRef<HoldToRunMotion | null>(null);
  const [down, setDown] = useState(false);
  const begin = () => {
    if (why) {
      notify("info", why);
      return;
    }
    if (held.current) return;
    const mine = onHold();
    held.current = mine;
    setDown(true);
    void mine.over.then((reason) => {
      if (held.current === mine) held.current = null;
      setDown(false);
      onOver?.(reason);
    });
  };
  const end = () => held.current?.end();
  useEffect(() => () => held.current?.end(), []);
  return (
    <button
      type="button"
      className={`button hold ${className}`}
      aria-label={label}
      aria-pressed={down}
      aria-disabled={why !== "" || undefined}
      data-held={down}
      onPointerDown={(event) => {
        if (event.button !== 0) return;
        event.currentTarget.setPointerCapture(event.pointerId);
        begin();
      }}
      onPointerUp={end}
      onPointerCancel={end}
      onLostPointerCapture={end}
      onKeyDown={(event) => {
        if (event.key === "Escape") end();
        if (event.key !== " " && event.key !== "Enter") return;
        event.preventDefault();
        if (!event.repeat) begin();
      }}
      onKeyUp={(event) => {
        if (event.key === " " || event.key === "Enter") end();
      }}
      onBlur={end}
      onContextMenu={(event) => event.preventDefault()}
    >
      {children}
      {why && <span className="hidden-but-read">{t`, not available: ${why}`}</span>}
    </button>
  );
}
