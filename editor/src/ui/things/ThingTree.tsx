/** Tree of items; which are collapsed is stored on the server for the user. */

import { t } from "@lingui/core/macro";
import { Button, Collection, ListLayout, Tree, TreeItem, TreeItemContent, Virtualizer } from "react-aria-components";
import { storeViewState } from "../../commands/viewstate";
import { theEngine } from "../../session/engine";
import { heldBy } from "../../store/selectors";
import { getState, select, setUi, useEditor } from "../../store/store";
import type { Kind } from "../../store/ui";
import { selectionOf } from "../../viewmodel/names";
import { flat, type Row } from "../../viewmodel/things";
import { Icon, type IconName } from "../kit/icons";
import { hiddenOf } from "../scene/hidden";

export const ICONS: Record<Kind, IconName> = {
  object: "box",
  point: "point",
  orientation: "point",
  joints: "robot",
  action: "action",
  logic: "list",
  terminal: "play",
};

/** Longer lists scroll by themselves and render only the visible rows; height of a row, pixels. */
const MANY = 60;
const ROW = 44;
const NOTHING: readonly string[] = [];

function foldedOf(stored: unknown): readonly string[] {
  return Array.isArray(stored) ? stored.filter((each) => typeof each === "string") : NOTHING;
}

/** Select an item of a list, and bring it into the view. */
export function goTo(id: string): void {
  select(selectionOf(getState(), id));
  setUi({ tool: "" });
  theEngine()?.focus(id);
}

interface ThingTreeProps {
  label: string;
  rows: readonly Row[];
  /** A search expands everything. */
  unfolded: boolean;
}

export function ThingTree({ label, rows, unfolded }: ThingTreeProps) {
  const locks = useEditor((state) => state.locks);
  const hidden = useEditor(hiddenOf);
  const folded = foldedOf(useEditor((state) => state.view.user.collapsed));
  const parents = flat(rows).filter((row) => row.below.length > 0);
  const open = new Set(parents.map((row) => row.id).filter((id) => unfolded || !folded.includes(id)));
  const fold = (keys: ReadonlySet<unknown>) => {
    if (unfolded) return;
    const mine = parents.map((row) => row.id);
    // Forget collapsed items that no longer exist.
    const rest = folded.filter((id) => !mine.includes(id) && selectionOf(getState(), id) !== null);
    const next = [...rest, ...mine.filter((id) => !keys.has(id))];
    storeViewState("user", { collapsed: next.length > 0 ? next : null });
  };
  const item = (row: Row) => {
    const holder = heldBy(getState(), row.id);
    const detail = holder ? t`In use by ${holder}` : hidden.includes(row.id) ? t`hidden` : row.detail;
    return (
      <TreeItem
        id={row.id}
        textValue={`${row.name} ${detail}`}
        className="thing thing-row"
        onHoverStart={() => theEngine()?.hover(row.id)}
      >
        <TreeItemContent>
          {({ hasChildItems, isExpanded, level }) => (
            <>
              <span style={{ width: (level - 1) * 16 }} className="thing-indent" />
              {hasChildItems ? (
                <Button slot="chevron" className="thing-fold" isDisabled={unfolded}>
                  <svg
                    width="16"
                    height="16"
                    viewBox="0 0 16 16"
                    fill="none"
                    stroke="currentColor"
                    strokeWidth="2"
                    strokeLinecap="round"
                    aria-hidden="true"
                    data-open={isExpanded}
                  >
                    <path d="M6 3l5 5-5 5" />
                  </svg>
                </Button>
              ) : (
                <span className="thing-fold" />
              )}
              <Icon name={row.group === "robots" ? "robot" : ICONS[row.kind]} />
              <span className="thing-name">{row.name}</span>
              <span className="quiet small">{detail}</span>
            </>
          )}
        </TreeItemContent>
        <Collection items={row.below} dependencies={[locks, hidden, unfolded]}>
          {item}
        </Collection>
      </TreeItem>
    );
  };
  const visible = shownRows(rows, open);
  const tree = (
    <Tree
      aria-label={label}
      className="things"
      style={visible > MANY ? { height: `min(${visible * ROW}px, 60dvh)`, overflow: "auto" } : {}}
      items={rows}
      dependencies={[locks, hidden, unfolded]}
      expandedKeys={open}
      onExpandedChange={fold}
      onAction={(key) => goTo(String(key))}
    >
      {item}
    </Tree>
  );
  return visible > MANY ? (
    <Virtualizer layout={ListLayout} layoutOptions={{ rowSize: ROW }}>
      {tree}
    </Virtualizer>
  ) : (
    tree
  );
}

/** Return the number of rows whose parents are all unfolded. */
function shownRows(rows: readonly Row[], open: ReadonlySet<string>): number {
  return rows.reduce((sum, row) => sum + 1 + (open.has(row.id) ? shownRows(row.below, open) : 0), 0);
}
