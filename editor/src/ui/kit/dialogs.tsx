/** Dialogs; a separate chunk. */

import { t } from "@lingui/core/macro";
import { type FormEvent, type ReactNode, useState } from "react";
import { Dialog, Heading, Modal, ModalOverlay } from "react-aria-components";
import { Field } from "./Field";
import { Button } from "./kit";
import type { AskNameProps, ConfirmProps } from "./props";

interface ModalDialogProps {
  title: string;
  onClose: () => void;
  children: ReactNode;
  role?: "dialog" | "alertdialog";
}

/** A modal dialog. `onClose` is called by Escape and by a tap outside, too. */
export function ModalDialog({ title, onClose, children, role = "dialog" }: ModalDialogProps) {
  return (
    <ModalOverlay isOpen isDismissable onOpenChange={(open) => open || onClose()} className="overlay">
      <Modal className="dialog">
        <Dialog role={role}>
          <Heading slot="title" level={2}>
            {title}
          </Heading>
          {children}
        </Dialog>
      </Modal>
    </ModalOverlay>
  );
}

/** Ask for confirmation of an action that cannot be undone. */
export function Confirm({ title, children, confirmLabel, why = "", onConfirm, onClose }: ConfirmProps) {
  return (
    <ModalDialog title={title} onClose={onClose} role="alertdialog">
      <div>{children}</div>
      <div className="actions">
        <Button onPress={onClose} autoFocus>
          {t`Cancel`}
        </Button>
        <Button
          variant="danger"
          why={why}
          onPress={() => {
            onClose();
            onConfirm();
          }}
        >
          {confirmLabel}
        </Button>
      </div>
    </ModalDialog>
  );
}

/** Ask for a name. */
export function AskName({
  title,
  label = t`Name`,
  initial = "",
  confirmLabel,
  taken = [],
  children,
  onConfirm,
  onClose,
}: AskNameProps) {
  const [name, setName] = useState(initial);
  const clean = name.trim();
  const problem = clean !== initial && taken.includes(clean) ? t`This name is already in use.` : "";
  const submit = (event: FormEvent) => {
    event.preventDefault();
    if (!clean || problem) return;
    onClose();
    onConfirm(clean);
  };
  return (
    <ModalDialog title={title} onClose={onClose}>
      <form onSubmit={submit} className="ask-name">
        <Field
          label={label}
          value={name}
          onChange={setName}
          autoFocus
          isInvalid={problem !== ""}
          hint={problem}
          autoComplete="off"
        />
        {children}
        <div className="actions">
          <Button onPress={onClose}>{t`Cancel`}</Button>
          <Button variant="primary" type="submit" isDisabled={!clean || problem !== ""}>
            {confirmLabel}
          </Button>
        </div>
      </form>
    </ModalDialog>
  );
}
