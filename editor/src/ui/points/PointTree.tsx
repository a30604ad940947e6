/** All points below their parents; dragging a point onto an item changes its parent. */

import { t } from "@lingui/core/macro";
import { useMemo } from "react";
import { type DropItem, isTextDropItem, ListBox, ListBoxItem, useDragAndDrop } from "react-aria-components";
import { possibleParents, setParent } from "../../commands/points";
import { byName } from "../../formats";
import { theEngine } from "../../session/engine";
import type { OpenDocument } from "../../store/state";
import { getState, notify, select, setUi, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { Icon } from "../kit/icons";
import { ReachBadge } from "./Reach";

const WORLD = "world";

interface Row {
  id: string;
  name: string;
  kind: "world" | "object" | "point";
  depth: number;
  orientations: string[];
}

function rowsOf(doc: OpenDocument): Row[] {
  const points = Object.values(doc.points);
  const orientations = Object.values(doc.orientations);
  const below = (parent: string | undefined, depth: number): Row[] =>
    points
      .filter((each) => each.parent === parent)
      .flatMap((point) => [
        {
          id: point.id,
          name: point.name,
          kind: "point" as const,
          depth,
          orientations: orientations.filter((each) => each.pointId === point.id).map((each) => each.id),
        },
        ...below(point.id, depth + 1),
      ]);
  const objects = Object.values(doc.objects)
    .filter((each) => each.pose && points.some((point) => point.parent === each.id))
    .sort(byName);
  return [
    ...objects.flatMap((object) => [
      { id: object.id, name: object.name, kind: "object" as const, depth: 0, orientations: [] },
      ...below(object.id, 1),
    ]),
    { id: WORLD, name: t`World`, kind: "world", depth: 0, orientations: [] },
    ...below(undefined, 1),
  ];
}

export function PointTree() {
  const doc = useEditor((state) => state.doc);
  const reach = useEditor((state) => state.reach);
  const rows = useMemo(() => (doc ? rowsOf(doc) : []), [doc]);
  const { dragAndDropHooks } = useDragAndDrop({
    getItems: (keys) => [...keys].map((key) => ({ "text/plain": String(key) })),
    getDropOperation: (target) => (target.type === "item" && target.dropPosition === "on" ? "move" : "cancel"),
    onItemDrop: (event) => {
      void dropped(event.items).then((id) => {
        if (id && getState().doc?.points[id]) void changeParent(id, String(event.target.key));
      });
    },
  });
  return (
    <ListBox
      aria-label={t`Points. Drag a point onto its new parent.`}
      className="things"
      items={rows}
      dependencies={[reach]}
      dragAndDropHooks={dragAndDropHooks}
      onAction={(key) => {
        const id = String(key);
        const kind = rows.find((each) => each.id === id)?.kind;
        if (kind !== "point" && kind !== "object") return;
        select({ kind, id });
        setUi({ tool: "" });
        theEngine()?.focus(id);
      }}
    >
      {(row) => (
        <ListBoxItem
          id={row.id}
          textValue={row.name}
          className="thing"
          style={{ paddingLeft: 10 + row.depth * 18 }}
          onHoverStart={() => theEngine()?.hover(row.id)}
        >
          <Icon name={row.kind === "point" ? "point" : row.kind === "object" ? "box" : "home"} />
          <span className="thing-name">{row.name}</span>
          {row.orientations.map((id) => (
            <ReachBadge key={id} id={id} />
          ))}
        </ListBoxItem>
      )}
    </ListBox>
  );
}

async function dropped(items: DropItem[]): Promise<string> {
  const [item] = items;
  return item && isTextDropItem(item) ? item.getText("text/plain") : "";
}

async function changeParent(id: string, target: string): Promise<void> {
  const parent = target === WORLD ? "" : target;
  const state = getState();
  if ((state.doc?.points[id]?.parent ?? "") === parent) return;
  if (parent && !possibleParents(state, id).includes(parent)) {
    notify("info", t`${nameOf(state, parent)} is a child of ${nameOf(state, id)} and cannot be its parent.`);
    return;
  }
  const refused = await setParent(id, parent);
  if (refused) notify("error", refused);
}
