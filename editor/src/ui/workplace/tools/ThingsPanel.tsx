/** All that is in the workplace, as a list to search: the same as tapping in the view, and for what has no place. */

import { useMemo, useState } from "react";
import { Input, Label, ListBox, ListBoxItem, SearchField } from "react-aria-components";
import { heldBy } from "../../../store/selectors";
import type { Kind, OpenDocument } from "../../../store/state";
import { theEngine } from "../../../session/engine";
import { now, select, setUi, useEditor } from "../../../store/store";
import { Icon, type IconName } from "../../kit/icons";
import { KINDS, selectionOf } from "../../names";

interface Row {
  id: string;
  kind: Kind;
  name: string;
  detail: string;
  depth: number;
}

const ICONS: Record<Kind, IconName> = { object: "box", point: "point", orientation: "point", joints: "robot", action: "action", logic: "list", terminal: "play" };

/** Objects, then points below what they hang on, each with what is on it. */
export function rowsOf(doc: OpenDocument): Row[] {
  const rows: Row[] = [];
  const points = Object.values(doc.points);
  const below = (parent: string | undefined, depth: number) => {
    for (const point of points.filter((each) => each.parent === parent)) {
      rows.push({ id: point.id, kind: "point", name: point.name, detail: KINDS.point, depth });
      const mine = (each: { pointId: string }) => each.pointId === point.id;
      for (const one of Object.values(doc.actions).filter(mine)) {
        rows.push({ id: one.id, kind: "action", name: one.name, detail: KINDS.action, depth: depth + 1 });
      }
      for (const one of Object.values(doc.orientations).filter(mine)) {
        rows.push({ id: one.id, kind: "orientation", name: one.name, detail: KINDS.orientation, depth: depth + 1 });
      }
      for (const one of Object.values(doc.joints).filter(mine)) {
        rows.push({ id: one.id, kind: "joints", name: one.name, detail: KINDS.joints, depth: depth + 1 });
      }
      below(point.id, depth + 1);
    }
  };
  for (const object of Object.values(doc.objects).sort((a, b) => a.name.localeCompare(b.name))) {
    rows.push({ id: object.id, kind: "object", name: object.name, detail: object.type, depth: 0 });
    below(object.id, 1);
  }
  below(undefined, 0);
  return rows;
}

export default function ThingsPanel() {
  const doc = useEditor((state) => state.doc);
  const locks = useEditor((state) => state.locks);
  const [search, setSearch] = useState("");
  const rows = useMemo(() => (doc ? rowsOf(doc) : []), [doc]);
  const wanted = search.trim().toLowerCase();
  const found = rows.filter((row) => `${row.name} ${row.detail}`.toLowerCase().includes(wanted));
  return (
    <>
      <SearchField className="field" value={search} onChange={setSearch}>
        <Label className="hidden-but-read">Search</Label>
        <Input placeholder={`Search ${rows.length} things`} />
      </SearchField>
      <ListBox
        aria-label="Things"
        className="things"
        items={found}
        dependencies={[locks]}
        onAction={(key) => {
          const selection = selectionOf(now(), String(key));
          select(selection);
          setUi({ tool: "" });
          if (selection) theEngine()?.focus(selection.id);
        }}
        renderEmptyState={() => <p className="quiet">{rows.length ? "Nothing is called that." : "Nothing is in the workplace yet."}</p>}
      >
        {(row) => (
          <ListBoxItem id={row.id} textValue={row.name} className="thing" style={{ paddingLeft: 10 + row.depth * 18 }}>
            <Icon name={ICONS[row.kind]} />
            <span className="thing-name">{row.name}</span>
            <span className="quiet small">{heldBy(now(), row.id) ? `${heldBy(now(), row.id)} works on it` : row.detail}</span>
          </ListBoxItem>
        )}
      </ListBox>
    </>
  );
}
