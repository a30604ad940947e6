/**
 * All actions by device, with search and recently used ones. A tap adds an action and connects it after the selected
 * one. Actions in space use the next taught point, or a new one at the crosshair; the others need no point.
 */

import { t } from "@lingui/core/macro";
import { useEffect, useMemo, useState } from "react";
import {
  Button as AriaButton,
  Input,
  Label,
  SearchField,
  ToggleButton,
  ToggleButtonGroup,
} from "react-aria-components";
import { createPortal } from "react-dom";
import { aimedPlace } from "../../commands/crosshair";
import { addAction, notEditable } from "../../commands/program";
import { takesPlace, type Where } from "../../commands/startingValues";
import { byName } from "../../formats";
import { pointFor, type Slot, slotFor, slotKey, slotsOf } from "../../program/chain";
import { errorWords } from "../../program/errorKinds";
import { recursive } from "../../program/functions";
import { callMeta, metaOf } from "../../program/logic";
import { words } from "../../program/naming";
import { SERVICES } from "../../program/services";
import type { ObjectAction } from "../../protocol/types";
import { whyUnavailable } from "../../store/permissions";
import type { OpenDocument, State } from "../../store/state";
import { getState, notify, select, setUi, useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { NewFunction, OpenButton } from "../functions/FunctionOffers";
import { SelectField } from "../kit/fields";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { CATEGORY_ICONS } from "./categories";

/** Number of actions that are offered again. */
const RECENT = 4;

interface Offer {
  key: string;
  objectId: string;
  object: string;
  category: string;
  meta: ObjectAction;
  /** Name of the function, if it calls one. */
  called?: string;
  why: string;
}

const titleOf = ({ called, meta }: Offer): string => called ?? words(meta.name);

export function AddAction() {
  const doc = useEditor((state) => state.doc);
  const types = useEditor((state) => state.types);
  const cannot = useEditor((state) => notEditable(state, "AddAction"));
  const online = useEditor((state) => state.live.state === "started");
  const selectedId = useEditor((state) => state.ui.selection?.id ?? "");
  const selected = doc ? pointFor(doc, selectedId) : "";
  const pointName = useEditor((state) => nameOf(state, selected));
  const recent = useEditor((state) => state.ui.recentActions);
  const [search, setSearch] = useState("");
  const [anew, setAnew] = useState(false);
  const [busy, setBusy] = useState("");
  const [slot, setSlot] = useState<Slot | null>(null);
  const [last, setLast] = useState("");
  useEffect(() => setSlot(null), [selectedId]);
  const onPoint = selected && !anew ? selected : "";
  const slots = doc?.project?.has_logic ? slotsOf(doc, types) : [];
  const proposed = doc?.project?.has_logic ? slotFor(doc, types, selectedId) : null;
  const chosen = (slot && slots.find((each) => slotKey(each) === slotKey(slot))) ?? proposed;
  const offers = useMemo(() => offersOf(getState(), onPoint), [doc, types, onPoint, online]);
  const wanted = search.trim().toLowerCase();
  const found = offers.filter((each) =>
    `${each.object} ${titleOf(each)} ${each.meta.description ?? ""} ${words(each.category)}`
      .toLowerCase()
      .includes(wanted),
  );
  const used = wanted ? [] : recent.flatMap((key) => offers.filter((each) => each.key === key));

  const add = async (offer: Offer) => {
    const why = cannot || offer.why;
    if (why) return notify("info", `${titleOf(offer)}: ${why}`);
    const placed = takesPlace(offer.objectId, offer.meta);
    const where = placed ? placeFor(onPoint) : null;
    if (placed && !where) return notify("info", t`Nothing at the crosshair. Aim at the table or an object.`);
    setBusy(offer.key);
    setUi({ recentActions: [offer.key, ...recent.filter((each) => each !== offer.key)].slice(0, RECENT) });
    setLast((await addAction(offer.objectId, offer.meta, where, chosen)) ?? "");
    setBusy("");
  };
  const row = (offer: Offer, prefix = "") => (
    <li key={prefix + offer.key} className={offer.called && "offer-call"}>
      <AriaButton
        className="offer"
        aria-disabled={offer.why !== "" || cannot !== "" || undefined}
        isDisabled={busy !== ""}
        onPress={() => void add(offer)}
      >
        <span className="offer-name">
          {titleOf(offer)}
          {prefix && <span className="quiet small"> · {offer.object}</span>}
        </span>
        <span className="quiet small">{offer.why || offer.meta.description?.split("\n")[0]}</span>
      </AriaButton>
      {offer.called && <OpenButton id={offer.objectId} name={offer.called} />}
    </li>
  );
  return (
    <>
      <div className="where">
        <ToggleButtonGroup
          className="tabs small-tabs"
          aria-label={t`Position of the action`}
          selectionMode="single"
          disallowEmptySelection
          selectedKeys={[onPoint ? "point" : "here"]}
          onSelectionChange={(keys) => setAnew([...keys][0] === "here")}
        >
          <ToggleButton id="here" className="tab">
            {t`At the crosshair`}
          </ToggleButton>
          <ToggleButton id="point" className="tab" isDisabled={!selected}>
            {selected ? t`On ${pointName}` : t`On a point`}
          </ToggleButton>
        </ToggleButtonGroup>
        <p className="quiet small">
          {onPoint
            ? t`Actions in space are added to ${pointName}.`
            : t`Actions in space get a new point at the crosshair.`}
        </p>
      </div>
      {chosen && (
        <SelectField
          label={t`Follows`}
          value={slotKey(chosen)}
          choices={slots.map((each) => [slotKey(each), slotWords(getState(), each)])}
          onChange={(key) => setSlot(slots.find((each) => slotKey(each) === key) ?? null)}
        />
      )}
      {doc?.actions[last] && (
        <p className="added" role="status">
          {t`Added ${doc.actions[last].name}.`}{" "}
          <Button
            onPress={() => {
              select({ kind: "action", id: last });
              setUi({ tool: "" });
            }}
          >
            {t`Set parameters`}
          </Button>
        </p>
      )}
      {!onPoint && <Crosshair />}
      <SearchField className="field" value={search} onChange={setSearch}>
        <Label className="hidden-but-read">{t`Search actions`}</Label>
        <Input placeholder={t`Search ${offers.length} actions`} />
      </SearchField>
      {used.length > 0 && (
        <section className="offers" aria-label={t`Recent`}>
          <h3>{t`Recent`}</h3>
          <ul>{used.map((offer) => row(offer, "recent/"))}</ul>
        </section>
      )}
      {groups(found).map(([object, of]) => (
        <section key={object} className="offers" aria-label={object}>
          <h3>
            <Icon name={of[0]?.called ? "function" : (CATEGORY_ICONS[of[0]?.category ?? ""] ?? "box")} /> {object}{" "}
            {of[0]?.category && <span className="tag">{words(of[0].category)}</span>}
          </h3>
          <ul>{of.map((offer) => row(offer))}</ul>
          {of[0]?.called && <NewFunction slot={chosen} />}
        </section>
      ))}
      {doc?.project?.has_logic && !found.some((each) => each.called) && <NewFunction slot={chosen} />}
      {found.length === 0 && (
        <p className="quiet">{offers.length ? t`No action matches.` : t`No device in this scene has actions.`}</p>
      )}
    </>
  );
}

/** Marks the middle of the view. */
function Crosshair() {
  const view = document.querySelector(".view");
  return view && createPortal(<span className="crosshair" aria-hidden="true" />, view);
}

/** Return a slot as text: "move", "test: if no". */
function slotWords(state: State, { after, condition, exit }: Slot): string {
  const name = nameOf(state, after);
  if (exit !== undefined) return `${name}: ${errorWords(state.doc?.logic[exit]?.error_kinds ?? [])}`;
  if (!condition) return name;
  if (condition.value === "true") return t`${name}: if yes`;
  if (condition.value === "false") return t`${name}: if no`;
  return t`${name}: if ${condition.value}`;
}

function placeFor(pointId: string): Where | null {
  if (!pointId) return aimedPlace();
  const { selection } = getState().ui;
  return selection?.kind === "orientation" ? { pointId, orientationId: selection.id } : { pointId };
}

function groups(offers: Offer[]): [string, Offer[]][] {
  const found = new Map<string, Offer[]>();
  for (const offer of offers) found.set(offer.object, [...(found.get(offer.object) ?? []), offer]);
  return [...found];
}

function offersOf(state: State, pointId: string): Offer[] {
  const { doc, types } = state;
  const rank = (type: string) => (type in types.robots ? 0 : 1);
  const objects = Object.values(doc?.objects ?? {}).sort((a, b) => rank(a.type) - rank(b.type) || byName(a, b));
  const present = new Set(objects.map((each) => each.type));
  const services = SERVICES.filter((type) => !present.has(type) && type in types.byName);
  const calls = Object.values(doc?.functions ?? {})
    .sort(byName)
    .map((called): Offer => {
      const meta = callMeta(types, doc as OpenDocument, called);
      const recurs = recursive(doc as OpenDocument, called.id) ? t`A function cannot call itself.` : "";
      return {
        key: `${called.id}/${meta.name}`,
        objectId: called.id,
        object: t`Functions`,
        category: "",
        meta: { ...meta, description: meta.parameters.map((each) => words(each.name)).join(", ") },
        called: called.name,
        why: recurs || whyNot(state, called.id, meta, pointId),
      };
    });
  const ofObjects = [
    ...objects.map(({ id, name, type }) => ({ id, name, type })),
    ...services.map((type) => ({ id: type, name: types.byName[type]?.display_name ?? type, type })),
  ].flatMap(({ id, name, type }) =>
    (types.actions[type] ?? []).map((meta) => ({
      key: `${id}/${meta.name}`,
      objectId: id,
      object: name,
      category: meta.category ?? types.byName[type]?.category ?? "",
      meta,
      why: services.includes(type) ? whyUnavailable(state, "AddSceneObject") : whyNot(state, id, meta, pointId),
    })),
  );
  return [...calls, ...ofObjects];
}

/** Return why an action cannot be added now; an empty string if it can. */
function whyNot(state: State, objectId: string, meta: ObjectAction, pointId: string): string {
  if (meta.disabled) return meta.problem ?? t`Not available.`;
  const needsJoints = takesPlace(objectId, meta) && meta.parameters.some((each) => each.type === "joints");
  if (needsJoints && state.live.state !== "started") {
    const there = Object.values(state.doc?.joints ?? {}).some(
      (each) => each.pointId === pointId && each.robot_id === objectId,
    );
    if (!there) return t`Needs joints. Go online to read them from the robot.`;
  }
  const needsImage = meta.parameters.some((each) => each.type === "image");
  if (needsImage) {
    const { doc, types } = state;
    const given = Object.values(doc?.actions ?? {}).some(
      (action) => doc && metaOf(types, doc, action)?.returns.includes("image"),
    );
    if (!given) return t`Needs a picture. Add an action that takes one first.`;
  }
  return "";
}
