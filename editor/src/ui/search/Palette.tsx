/** Search for commands and objects by name. */

import { t } from "@lingui/core/macro";
import { useMemo, useState } from "react";
import { Autocomplete, Input, Label, ListBox, ListBoxItem, SearchField } from "react-aria-components";
import { notify, setUi, useEditor } from "../../store/store";
import { ModalDialog } from "../kit/dialogs";
import { entriesOf } from "./entries";
import { found } from "./matches";
import "./search.css";

/** Number of commands that are offered again. */
const REMEMBERED = 5;

export default function Palette({ onClose }: { onClose: () => void }) {
  const state = useEditor((each) => each);
  const recent = state.ui.recentCommands;
  const [search, setSearch] = useState("");
  const entries = useMemo(() => entriesOf(state), [state]);
  const shown = found(entries, search, recent);
  const choose = (id: string) => {
    const entry = entries.find((each) => each.id === id);
    if (!entry) return;
    onClose();
    if (entry.why) {
      notify("info", `${entry.words}: ${entry.why}`);
      return;
    }
    setUi({ recentCommands: [id, ...recent.filter((each) => each !== id)].slice(0, REMEMBERED) });
    entry.act();
  };
  return (
    <ModalDialog title={t`Find a command or an object`} onClose={onClose}>
      <Autocomplete inputValue={search} onInputChange={setSearch}>
        <SearchField className="field" autoFocus aria-label={t`Find`}>
          <Label className="hidden-but-read">{t`Find`}</Label>
          <Input placeholder={t`Part of the name`} />
        </SearchField>
        <div className="found" tabIndex={0} role="group" aria-label={t`Results`}>
          <ListBox
            aria-label={t`Found`}
            items={shown}
            selectionMode="none"
            onAction={(key) => choose(String(key))}
            renderEmptyState={() => <p className="quiet">{t`No match.`}</p>}
          >
            {(entry) => (
              <ListBoxItem id={entry.id} textValue={entry.words} className="found-entry">
                <span>{entry.words}</span>
                <span className="quiet small">{entry.why || entry.detail}</span>
              </ListBoxItem>
            )}
          </ListBox>
        </div>
      </Autocomplete>
    </ModalDialog>
  );
}
