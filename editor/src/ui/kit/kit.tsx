/** Controls of all screens, made of react-aria components. */

import { t } from "@lingui/core/macro";
import type { ReactNode } from "react";
import { Button as AriaButton, type ButtonProps } from "react-aria-components";
import { notify } from "../../store/store";
import { Icon, type IconName } from "./icons";
import type { Variant } from "./props";

interface PlainButtonProps extends Omit<ButtonProps, "children" | "className"> {
  variant?: Variant;
  icon?: IconName;
  children?: ReactNode;
  className?: string;
  /** The reason why it is not available, a sentence shown when it is pressed; empty if it is available. */
  why?: string;
}

export function Button({ variant = "", icon, children, className, why = "", onPress, ...rest }: PlainButtonProps) {
  const press: ButtonProps["onPress"] = why ? () => notify("info", why) : onPress;
  return (
    <AriaButton
      {...rest}
      onPress={press}
      aria-disabled={why !== "" || undefined}
      className={`button ${variant} ${className ?? ""}`}
    >
      {icon && <Icon name={icon} />}
      {children}
      {why && <span className="hidden-but-read">{t`, not available: ${why}`}</span>}
    </AriaButton>
  );
}

export function Waiting({ children }: { children: ReactNode }) {
  return (
    <div className="waiting" role="status">
      <span className="spinner" aria-hidden="true" />
      {children}
    </div>
  );
}
