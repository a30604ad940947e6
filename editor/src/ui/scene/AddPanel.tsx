/** Add shapes and meshes with one tap, and devices with a form. */

import { i18n, type MessageDescriptor } from "@lingui/core";
import { msg, t } from "@lingui/core/macro";
import { useState } from "react";
import { Input, Label, SearchField } from "react-aria-components";
import { addShape, notBuildable, type ShapeKind } from "../../commands/scene";
import { compareTexts } from "../../formats";
import { words } from "../../program/naming";
import type { ObjectTypeMeta } from "../../protocol/types";
import { notify, useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import { CATEGORY_ICONS } from "../program/categories";
import { AddMesh } from "./AddMesh";
import { AddObject } from "./AddObject";
import "./scene.css";

const SHAPES: readonly (readonly [ShapeKind, MessageDescriptor])[] = [
  ["table", msg`Table`],
  ["box", msg`Box`],
  ["cylinder", msg`Cylinder`],
  ["sphere", msg`Sphere`],
];

export default function AddPanel() {
  const why = useEditor((state) => notBuildable(state, "AddSceneObject"));
  const whyShape = useEditor((state) => notBuildable(state, "AddSceneShape"));
  const types = useEditor((state) => state.types.byName);
  const [chosen, setChosen] = useState("");
  const [search, setSearch] = useState("");
  const type = types[chosen];
  if (type) return <AddObject type={type} why={why} onBack={() => setChosen("")} />;
  if (chosen === "mesh") return <AddMesh why={whyShape} onBack={() => setChosen("")} />;
  const wanted = search.trim().toLowerCase();
  const found = Object.values(types).filter(
    (each) =>
      isDevice(each) &&
      `${each.type} ${each.display_name} ${words(each.category ?? "")} ${each.description}`
        .toLowerCase()
        .includes(wanted),
  );
  const groups = new Map<string, ObjectTypeMeta[]>();
  for (const each of found.sort((a, b) => compareTexts(shownName(a), shownName(b)))) {
    const group = each.category ? words(each.category) : t`Other`;
    groups.set(group, [...(groups.get(group) ?? []), each]);
  }
  return (
    <>
      {why && <p className="small">{why}</p>}
      <div className="shapes" role="group" aria-label={t`Shapes`}>
        {SHAPES.map(([kind, label]) => (
          <Button key={kind} icon="box" why={whyShape} onPress={() => void addShape(kind)}>
            {i18n._(label)}
          </Button>
        ))}
        <Button icon="box" why={whyShape} onPress={() => setChosen("mesh")}>
          {t`Mesh…`}
        </Button>
      </div>
      <SearchField className="field" value={search} onChange={setSearch}>
        <Label className="hidden-but-read">{t`Search`}</Label>
        <Input placeholder={t`Search devices`} />
      </SearchField>
      {[...groups]
        .sort(([a], [b]) => compareTexts(a, b))
        .map(([group, members]) => (
          <section key={group} aria-label={group}>
            <h3 className="quiet small">{group}</h3>
            <ul className="kinds">
              {members.map((each) => (
                <li key={each.type}>
                  <button
                    type="button"
                    className="kind"
                    aria-disabled={each.disabled || undefined}
                    onClick={() =>
                      each.disabled
                        ? notify(
                            "info",
                            each.problem
                              ? t`${shownName(each)} cannot be used: ${each.problem}`
                              : t`${shownName(each)} cannot be used.`,
                          )
                        : setChosen(each.type)
                    }
                  >
                    <Icon name={CATEGORY_ICONS[each.category ?? ""] ?? "box"} />
                    <span>
                      <strong>{shownName(each)}</strong>
                      <span className={`small ${each.disabled ? "error" : "quiet"}`}>
                        {each.disabled ? each.problem : first(each.description)}
                      </span>
                      {each.shadows && (
                        <span className="small">
                          {t`replaces the installed type ${shownName(each)} (${each.shadows})`}
                        </span>
                      )}
                    </span>
                  </button>
                </li>
              ))}
            </ul>
          </section>
        ))}
      {found.length === 0 && <p className="quiet">{t`No device type matches “${search.trim()}”.`}</p>}
    </>
  );
}

/** Return whether it is a device: abstract types cannot be added, and shapes have their own buttons. */
function isDevice({ abstract, base, disabled, problem }: ObjectTypeMeta): boolean {
  return base !== "VirtualCollisionObject" && (!abstract || (disabled && problem !== undefined));
}

const shownName = (type: ObjectTypeMeta) => type.display_name ?? type.type;

/** Return the first sentence. */
function first(text: string): string {
  return text.split(/(?<=\.)\s/)[0] ?? "";
}
