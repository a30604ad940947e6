/** Properties of the controls that kit.tsx loads when they are needed. */

import type { ReactNode } from "react";
import type { IconName } from "./icons";

export type Variant = "" | "primary" | "plain" | "danger";

export interface ConfirmProps {
  title: string;
  children: ReactNode;
  /** Text of the button that confirms. */
  confirmLabel: string;
  /** The reason why it is not possible now, a sentence. */
  why?: string;
  onConfirm: () => void;
  onClose: () => void;
}

export interface AskNameProps {
  title: string;
  label?: string;
  initial?: string;
  confirmLabel: string;
  /** Existing names. */
  taken?: string[];
  children?: ReactNode;
  onConfirm: (name: string) => void;
  onClose: () => void;
}

export interface Choice {
  id: string;
  label: string;
  icon?: IconName;
  /** Why it is not available. */
  why?: string;
  act: () => void;
}

export interface MoreProps {
  label: string;
  choices: Choice[];
  icon?: IconName;
  children?: ReactNode;
  variant?: Variant;
}
