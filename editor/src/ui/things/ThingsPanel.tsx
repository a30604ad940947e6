/** All items of the workplace: by kind and name, by parents, or at the crosshair. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useMemo, useState } from "react";
import { Input, Label, SearchField, ToggleButton, ToggleButtonGroup } from "react-aria-components";
import { storeViewState } from "../../commands/viewstate";
import { setUi, useEditor } from "../../store/store";
import { allOf, counts, fitting, narrowed, type Row, thingsOf } from "../../viewmodel/things";
import { GROUPS, type Group } from "../../viewmodel/visibility";
import { ToggleGroup } from "../kit/fields";
import { Button } from "../kit/kit";
import { hiddenOf } from "../scene/hidden";
import { AtCrosshair } from "./AtCrosshair";
import { ThingTree } from "./ThingTree";
import { ViewSettings } from "./ViewSettings";
import "./things.css";

const WORDS: Record<Group, MessageDescriptor> = {
  robots: msg`Robots`,
  objects: msg`Objects`,
  points: msg`Points`,
  actions: msg`Actions`,
  program: msg`Program`,
  others: msg`Others`,
};
const HIDDEN = "hidden";

export default function ThingsPanel() {
  const [by, setBy] = useState<"list" | "crosshair">("list");
  return (
    <>
      <ToggleGroup
        quiet
        label={t`Show`}
        value={by}
        choices={[
          ["list", t`All`],
          ["crosshair", t`At the crosshair`],
        ]}
        onChange={setBy}
      />
      {by === "list" ? <All /> : <AtCrosshair />}
    </>
  );
}

function All() {
  const doc = useEditor((state) => state.doc);
  const types = useEditor((state) => state.types);
  const stored = useEditor((state) => state.view.user.filters);
  const hiddenIds = useEditor(hiddenOf);
  const [search, setSearch] = useState("");
  const things = useMemo(() => thingsOf({ doc, types }), [doc, types]);
  const rows = useMemo(() => allOf(things), [things]);
  const number = useMemo(() => counts(rows), [rows]);
  const hiddenRows = rows.filter((row) => hiddenIds.includes(row.id)).length;
  const groups = new Set<string>(
    Array.isArray(stored)
      ? stored.filter((each) =>
          each === HIDDEN ? hiddenRows > 0 : GROUPS.includes(each as Group) && number[each as Group] > 0,
        )
      : [],
  );
  const inProject = useEditor((state) => state.doc?.project != null);
  const ofKind = fitting(new Set([...groups].filter((each) => each !== HIDDEN)), search);
  const fits = (row: Row) => ofKind(row) && (!groups.has(HIDDEN) || hiddenIds.includes(row.id));
  const narrow = search.trim() !== "" || groups.size > 0;
  const parts: [string, string, Row[]][] = [
    [t`Objects`, "", narrowed(things.placed, fits)],
    [t`Without a pose`, t`Without a pose`, narrowed(things.unplaced, fits)],
    [t`Program`, t`Program`, narrowed(things.program, fits)],
  ];
  const found = parts.filter(([, , part]) => part.length > 0);
  return (
    <>
      {inProject && (
        <Button icon="plus" onPress={() => setUi({ tool: "add" })}>
          {t`Add object`}
        </Button>
      )}
      <SearchField className="field" value={search} onChange={setSearch}>
        <Label className="hidden-but-read">{t`Search`}</Label>
        <Input placeholder={t`Search ${rows.length} objects`} />
      </SearchField>
      <ToggleButtonGroup
        className="chips"
        aria-label={t`Only these kinds`}
        selectionMode="multiple"
        selectedKeys={groups}
        onSelectionChange={(keys) => storeViewState("user", { filters: keys.size > 0 ? [...keys] : null })}
      >
        {GROUPS.filter((group) => number[group] > 0).map((group) => (
          <ToggleButton key={group} id={group} className="button chip">
            {i18n._(WORDS[group])} <small>{number[group]}</small>
          </ToggleButton>
        ))}
        {hiddenRows > 0 && (
          <ToggleButton id={HIDDEN} className="button chip">
            {t`Hidden`} <small>{hiddenRows}</small>
          </ToggleButton>
        )}
      </ToggleButtonGroup>
      {found.map(([label, heading, part]) => (
        <section key={label} className="things-part">
          {heading && <h3>{heading}</h3>}
          <ThingTree label={label} rows={part} unfolded={narrow} />
        </section>
      ))}
      {found.length === 0 && (
        <p className="quiet">
          {rows.length === 0
            ? t`The workplace is empty.`
            : groups.size > 0
              ? t`No match among these kinds.`
              : t`No match.`}
        </p>
      )}
      <ViewSettings narrowed={groupsOfAny(groups)} />
    </>
  );
}

const groupsOfAny = (groups: ReadonlySet<string>): boolean => [...groups].some((each) => each !== HIDDEN);
