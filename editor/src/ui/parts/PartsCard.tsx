/** The places of the parts in the cell: the interrupted action, expected and sensed parts, a question for each part. */

import { t } from "@lingui/core/macro";
import { useEffect, useState } from "react";
import { ask } from "../../commands/requests";
import { runPackage } from "../../commands/run";
import { translate } from "../../i18n/serverMessages";
import type { ConfirmedPart, Part, PartInventory, Place } from "../../protocol/types";
import { call, serves } from "../../session/connection";
import { whyUnavailable } from "../../store/permissions";
import { isRunning } from "../../store/selectors";
import { getState, useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import "../held/held.css";
import "./parts.css";

/** Return inventories with a changed one. */
export function withInventory(known: readonly PartInventory[], changed: PartInventory): PartInventory[] {
  return [...known.filter((each) => each.scene_id !== changed.scene_id), changed];
}

/** Return the parts about which the card asks: those that are not confirmed, or all of them. */
export const askedParts = (inventory: PartInventory, all: boolean): Part[] =>
  inventory.parts.filter((part) => all || !part.confirmed);

/** Return the places where a part may be, the likely ones first. */
export function answersFor(part: Part, inventory: PartInventory): Place[] {
  const rank = (place: Place) => (place.id === part.place ? 0 : place.id === part.moving_to ? 1 : 2);
  const taken = new Set(
    inventory.parts.filter((each) => each.number !== part.number && each.confirmed).map((e) => e.place),
  );
  return inventory.places
    .filter((place) => place.capacity === 0 || !taken.has(place.id))
    .sort((a, b) => rank(a) - rank(b));
}

declare module "../../store/runtime" {
  interface Runtime {
    /** The inventories as last shown: another card shows them at once, and moves nothing when they are loaded. */
    parts?: PartInventory[];
  }
}

/** Return the part inventories, null until they are loaded. */
export function useInventories(): PartInventory[] | null {
  const ready = useEditor((state) => state.connection.status === "ready");
  const phase = useEditor((state) => state.program.state);
  const { runtime } = getState();
  const [inventories, setInventories] = useState<PartInventory[] | null>(runtime.parts ?? null);
  if (inventories) runtime.parts = inventories;
  useEffect(() => {
    if (!ready || !serves("GetParts")) return;
    let current = true;
    runtime.takeParts ??= new Set();
    const listeners = runtime.takeParts;
    const take = (changed: PartInventory) => setInventories((known) => withInventory(known ?? [], changed));
    listeners.add(take);
    call("GetParts").then(
      (answer) => current && setInventories(answer),
      () => current && setInventories((known) => known ?? []), // offline: loaded again after the reconnect
    );
    return () => {
      current = false;
      listeners.delete(take);
    };
  }, [ready, phase, runtime]);
  return inventories;
}

/**
 * Show the first scene with a question; without one, the parts that a stopped program has left in the cell. With `all`,
 * all parts can be corrected, because the program is held. With `folded`, the card is folded as long as all parts are
 * confirmed. `whyNoStart`: why no program can be started or continued now.
 */
export default function PartsCard({
  all = false,
  folded = false,
  whyNoStart = "",
}: {
  all?: boolean;
  folded?: boolean;
  whyNoStart?: string;
}) {
  const inventories = useInventories() ?? [];
  const runs = useEditor(isRunning);
  const open = inventories.find((each) => askedParts(each, all).length > 0 || each.run !== undefined);
  if (open) {
    const asks = !folded || askedParts(open, false).length > 0;
    return asks ? <Inventory inventory={open} all={all} whyNoStart={whyNoStart} /> : <Folded inventory={open} />;
  }
  if (runs) return null;
  return inventories
    .filter((each) => each.parts.length > 0)
    .map((each) => (
      <Folded
        key={each.scene_id}
        inventory={each}
        note={t`A stopped program does not continue. It starts from its beginning.`}
      />
    ));
}

function Folded({ inventory, note }: { inventory: PartInventory; note?: string }) {
  return (
    <details>
      <summary>{t`Parts in the cell`}</summary>
      {note && <p>{note}</p>}
      <Inventory inventory={inventory} all />
    </details>
  );
}

function Inventory({
  inventory,
  all,
  whyNoStart = "",
}: {
  inventory: PartInventory;
  all: boolean;
  whyNoStart?: string;
}) {
  const [chosen, setChosen] = useState<number>();
  const why = useEditor((state) => whyUnavailable(state, "ConfirmParts"));
  const whyContinue = useEditor((state) => whyUnavailable(state, "RunPackage")) || whyNoStart;
  const parts = askedParts(inventory, all);
  const part = parts.find((each) => each.number === chosen) ?? (all ? undefined : parts[0]);
  const packages = useEditor((state) => state.lists.packages) ?? [];
  const confirm = (found: ConfirmedPart[], dismiss = false) =>
    ask("ConfirmParts", { scene_id: inventory.scene_id, parts: found, dismiss }).then(() => setChosen(undefined));
  const { run } = inventory;
  const found = packages.find((each) => each.id === run?.package_id);
  const program = found?.package_meta.name ?? t`The program`;
  const continues = found !== undefined && run?.continues === true;
  const at = run?.continues_at?.join(", ");
  const running = run?.actions.map((each) => each.action_name).join(", ");
  return (
    <section className="held" data-parts aria-label={t`Parts in the cell`}>
      {run && (
        <div role="alert">
          <h2>
            <Icon name="warn" /> {t`The program was interrupted`}
          </h2>
          <p className="held-what">
            {running ? t`${program} was at ${running}.` : t`${program} was between two actions.`}
          </p>
          <p>
            {!run.confirmed
              ? t`Nothing moves by itself. First confirm where the parts are.`
              : continues
                ? t`It can continue there with its results, after your decision. Start starts it from its beginning.`
                : whyNot(run.missing, found !== undefined)}
          </p>
        </div>
      )}
      {(!run || parts.length > 0) && <Places inventory={inventory} />}
      {all && !part && (
        <div className="held-choices">
          {parts.map((each) => (
            <Button key={each.number} why={why} onPress={() => setChosen(each.number)}>
              {t`Correct ${shown(each)}`}
            </Button>
          ))}
        </div>
      )}
      {part && (
        <>
          <h2>{t`Where is part ${shown(part)}?`}</h2>
          {/* With a key, a press never answers for another part that has just taken this place. */}
          <div key={part.number} className="held-choices">
            {answersFor(part, inventory).map((place) => (
              <Button
                key={place.id}
                variant={[part.place, part.moving_to].includes(place.id) ? "primary" : ""}
                why={why}
                onPress={() => void confirm([{ number: part.number, place: place.id }])}
              >
                {place.name}
              </Button>
            ))}
            <Button why={why} onPress={() => void confirm([{ number: part.number, place: "" }])}>
              {t`I have taken it out of the cell`}
            </Button>
            {part.serial === "" && (
              <Button why={why} onPress={() => void confirm([{ number: part.number, place: "", exists: false }])}>
                {t`There was no part`}
              </Button>
            )}
            {all && <Button onPress={() => setChosen(undefined)}>{t`Back`}</Button>}
          </div>
        </>
      )}
      {run?.confirmed && (
        <div className="held-choices">
          {continues && (
            <Button variant="primary" why={whyContinue} onPress={() => void runPackage(found.id, false, true)}>
              {at ? t`Continue at ${at}` : t`Continue after the last action`}
            </Button>
          )}
          <Button why={why} onPress={() => void confirm([], true)}>
            {continues ? t`Do not continue` : t`Dismiss`}
          </Button>
        </div>
      )}
      {run?.confirmed && found && (run.restarts?.length ?? 0) > 0 && (
        <details>
          <summary>{t`Continue at another action`}</summary>
          <p>{t`It and the actions after it are executed again. The program waits there for your decision.`}</p>
          <div className="held-choices">
            {run.restarts?.map((each) => (
              <Button
                key={each.at}
                why={whyContinue || translate({ ...each, text: each.text ?? "" })}
                onPress={() => void runPackage(found.id, false, true, { continue_at: each.at })}
              >
                {each.name}
              </Button>
            ))}
          </div>
        </details>
      )}
      {run && !run.confirmed && parts.length === 0 && (
        <div className="held-choices">
          <Button variant="primary" why={why} onPress={() => void confirm([])}>
            {t`There are no parts in the cell`}
          </Button>
        </div>
      )}
    </section>
  );
}

/** Return why a program cannot continue. `missing`: action whose result is missing; `present`: its package exists. */
export function whyNot(missing: string, present: boolean): string {
  const start = t`Press Start to start it from its beginning.`;
  if (!present) return t`It cannot continue, because it was started from an open project, or its package was deleted.`;
  if (missing) return `${t`It cannot continue: ${missing} would have to be repeated.`} ${start}`;
  return `${t`It cannot continue, because its progress is not stored.`} ${start}`;
}

const shown = (part: Part): string => part.serial || `#${part.number}`;

/** The places that contain a part or may contain it, or whose sensors detect one: expected next to sensed. */
function Places({ inventory }: { inventory: PartInventory }) {
  const rows = inventory.places
    .map((place) => {
      const sure = inventory.parts.filter((part) => part.place === place.id).map(shown);
      const maybe = inventory.parts
        .filter((part) => part.moving_to === place.id)
        .map((part) => t`${shown(part)} (or here)`);
      return { place, expected: [...sure, ...maybe].join(", ") };
    })
    .filter(({ place, expected }) => expected || place.sensed);
  const anySensor = rows.some(({ place }) => place.sensed !== undefined);
  const sensed = (place: Place) => (place.sensed === undefined ? "–" : place.sensed ? t`a part` : t`no part`);
  return (
    <table className="parts-table">
      <thead>
        <tr>
          <th>{t`Where`}</th>
          <th>{t`Expected`}</th>
          {anySensor && <th>{t`Sensed`}</th>}
        </tr>
      </thead>
      <tbody>
        {rows.map(({ place, expected }) => (
          <tr key={place.id}>
            <td data-name>{place.name}</td>
            <td data-name>{expected || t`no part`}</td>
            {anySensor && <td>{sensed(place)}</td>}
          </tr>
        ))}
      </tbody>
    </table>
  );
}
