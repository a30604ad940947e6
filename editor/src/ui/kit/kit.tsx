/** Controls of all screens: react-aria's behaviour in our clothes. */

import { type FormEvent, type ReactNode, useState } from "react";
import {
  Button as AriaButton,
  type ButtonProps,
  Dialog,
  FieldError,
  Heading,
  Input,
  Label,
  Menu,
  MenuItem,
  MenuTrigger,
  Modal,
  ModalOverlay,
  Popover,
  TextField,
  type TextFieldProps,
} from "react-aria-components";
import { Icon, type IconName } from "./icons";

type Look = "" | "primary" | "plain" | "danger";

export function Button({ look = "", icon, children, className, ...rest }: Omit<ButtonProps, "children" | "className"> & { look?: Look; icon?: IconName; children?: ReactNode; className?: string }) {
  return (
    <AriaButton {...rest} className={`button ${look} ${className ?? ""}`}>
      {icon && <Icon name={icon} />}
      {children}
    </AriaButton>
  );
}

export function Field({ label, hint, placeholder, type, ...rest }: TextFieldProps & { label: string; hint?: string; placeholder?: string }) {
  return (
    <TextField {...rest} className="field">
      <Label>{label}</Label>
      <Input placeholder={placeholder} type={type} />
      {hint && <span className="quiet small">{hint}</span>}
      <FieldError className="error" />
    </TextField>
  );
}

/** A window over all others. `onClose` is called by Escape and by a tap beside it, too. */
export function Window({ title, onClose, children, role = "dialog" }: { title: string; onClose: () => void; children: ReactNode; role?: "dialog" | "alertdialog" }) {
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

/** Asks before something that cannot be taken back. */
export function Confirm({ title, children, yes, onYes, onClose }: { title: string; children: ReactNode; yes: string; onYes: () => void; onClose: () => void }) {
  return (
    <Window title={title} onClose={onClose} role="alertdialog">
      <div>{children}</div>
      <div className="actions">
        <Button onPress={onClose} autoFocus>
          Cancel
        </Button>
        <Button
          look="danger"
          onPress={() => {
            onClose();
            onYes();
          }}
        >
          {yes}
        </Button>
      </div>
    </Window>
  );
}

/** Asks for a name. */
export function AskName({ title, label = "Name", initial = "", yes, taken = [], children, onYes, onClose }: { title: string; label?: string; initial?: string; yes: string; taken?: string[]; children?: ReactNode; onYes: (name: string) => void; onClose: () => void }) {
  const [name, setName] = useState(initial);
  const clean = name.trim();
  const problem = clean !== initial && taken.includes(clean) ? "There is one of that name." : "";
  const submit = (event: FormEvent) => {
    event.preventDefault();
    if (!clean || problem) return;
    onClose();
    onYes(clean);
  };
  return (
    <Window title={title} onClose={onClose}>
      <form onSubmit={submit} className="ask-name">
        <Field label={label} value={name} onChange={setName} autoFocus isInvalid={problem !== ""} hint={problem} autoComplete="off" />
        {children}
        <div className="actions">
          <Button onPress={onClose}>Cancel</Button>
          <Button look="primary" type="submit" isDisabled={!clean || problem !== ""}>
            {yes}
          </Button>
        </div>
      </form>
    </Window>
  );
}

export interface Choice {
  id: string;
  label: string;
  icon?: IconName;
  /** Why it cannot be chosen now. */
  not?: string;
  act: () => void;
}

/** A button that opens a list of further actions. */
export function More({ label, choices, icon = "more", children, look = "plain" }: { label: string; choices: Choice[]; icon?: IconName; children?: ReactNode; look?: Look }) {
  return (
    <MenuTrigger>
      <Button look={look} icon={icon} aria-label={label}>
        {children}
      </Button>
      <Popover className="popover">
        <Menu className="menu" aria-label={label} onAction={(key) => choices.find((each) => each.id === key)?.act()} disabledKeys={choices.filter((each) => each.not).map((each) => each.id)}>
          {choices.map((each) => (
            <MenuItem key={each.id} id={each.id} className="menu-item" textValue={each.label}>
              {each.icon && <Icon name={each.icon} />}
              <span>
                {each.label}
                {each.not && <span className="quiet small"> – {each.not}</span>}
              </span>
            </MenuItem>
          ))}
        </Menu>
      </Popover>
    </MenuTrigger>
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
