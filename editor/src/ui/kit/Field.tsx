/** A text field with label and hint. It is separate from the other controls, because the first page shows none. */

import { FieldError, Input, Label, TextField, type TextFieldProps } from "react-aria-components";

interface Props extends TextFieldProps {
  label: string;
  hint?: string;
  placeholder?: string;
}

export function Field({ label, hint, placeholder, type, ...rest }: Props) {
  return (
    <TextField {...rest} className="field">
      <Label>{label}</Label>
      <Input placeholder={placeholder} type={type} />
      {hint && <span className="quiet small">{hint}</span>}
      <FieldError className="error" />
    </TextField>
  );
}
