/** Controls of all screens: react-aria's behaviour in our clothes. */

import { t } from "@lingui/core/macro";
import { type ReactNode, Suspense } from "react";
import {
  Button as AriaButton,
  type ButtonProps,
  FieldError,
  Input,
  Label,
  TextField,
  type TextFieldProps,
} from "react-aria-components";
import { tell } from "../../store/store";
import type { AskNameProps, ConfirmProps } from "./dialogs";
import { Icon, type IconName } from "./icons";
import { lazily } from "./lazily";
import type { MoreProps } from "./menu";

export type { Choice } from "./menu";

const ConfirmDialog = lazily(() => import("./dialogs").then((module) => ({ default: module.Confirm })));
const AskNameDialog = lazily(() => import("./dialogs").then((module) => ({ default: module.AskName })));
const MoreMenu = lazily(() => import("./menu"));

export type Look = "" | "primary" | "plain" | "danger";

interface PlainButtonProps extends Omit<ButtonProps, "children" | "className"> {
  look?: Look;
  icon?: IconName;
  children?: ReactNode;
  className?: string;
  /** Why it cannot be pressed now, as a sentence: it looks so, and says it when it is pressed. Empty: it can. */
  why?: string;
}

export function Button({ look = "", icon, children, className, why = "", onPress, ...rest }: PlainButtonProps) {
  const press: ButtonProps["onPress"] = why ? () => tell("info", why) : onPress;
  return (
    <AriaButton
      {...rest}
      onPress={press}
      aria-disabled={why !== "" || undefined}
      className={`button ${look} ${className ?? ""}`}
    >
      {icon && <Icon name={icon} />}
      {children}
      {why && <span className="hidden-but-read">{t`, not available: ${why}`}</span>}
    </AriaButton>
  );
}

export function Field({
  label,
  hint,
  placeholder,
  type,
  ...rest
}: TextFieldProps & { label: string; hint?: string; placeholder?: string }) {
  return (
    <TextField {...rest} className="field">
      <Label>{label}</Label>
      <Input placeholder={placeholder} type={type} />
      {hint && <span className="quiet small">{hint}</span>}
      <FieldError className="error" />
    </TextField>
  );
}

/** Asks before something that cannot be taken back. */
export function Confirm(props: ConfirmProps) {
  return (
    <Suspense fallback={null}>
      <ConfirmDialog {...props} />
    </Suspense>
  );
}

/** Asks for a name. */
export function AskName(props: AskNameProps) {
  return (
    <Suspense fallback={null}>
      <AskNameDialog {...props} />
    </Suspense>
  );
}

/** A button that opens a list of further actions. The list's code comes when the page has nothing better to do. */
export function More(props: MoreProps) {
  const { label, icon = "more", children, look = "plain" } = props;
  return (
    <Suspense
      fallback={
        <Button look={look} icon={icon} aria-label={label}>
          {children}
        </Button>
      }
    >
      <MoreMenu {...props} />
    </Suspense>
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
