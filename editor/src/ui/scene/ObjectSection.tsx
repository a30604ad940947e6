/** The selected object: name, copies, users, visibility. */

import { t } from "@lingui/core/macro";
import { Suspense, useState } from "react";
import { duplicateObject, notBuildable, projectsUsing, removeObject, renameObject } from "../../commands/scene";
import { storeViewState } from "../../commands/viewstate";
import { heldBy } from "../../store/selectors";
import { getState, useEditor } from "../../store/store";
import { isPlaceable } from "../../viewmodel/devices";
import { SliderField, SwitchField } from "../kit/fields";
import { Button, Waiting } from "../kit/kit";
import { lazyComponent } from "../kit/lazy";
import { Confirm } from "../kit/lazyControls";
import { NameField } from "../points/NameField";
import type { Section } from "../workplace/section";
import { setHidden } from "./hidden";
import { Placing } from "./Placing";
import "./scene.css";

const Trends = lazyComponent(() => import("../trends/Trends"));

const Body: Section["Body"] = ({ selection: { id } }) => {
  const object = useEditor((state) => state.doc?.objects[id]);
  const holder = useEditor((state) => heldBy(state, id));
  const inUse = holder && t`In use by ${holder}.`;
  const why = useEditor((state) => inUse || notBuildable(state, "RemoveFromScene"));
  const cannotCopy = useEditor((state) => notBuildable(state, "AddSceneShape"));
  const cannotRename = useEditor((state) => inUse || (state.doc?.project ? notBuildable(state, "RenameObject") : ""));
  const placeable = useEditor((state) => object !== undefined && isPlaceable(state, object));
  const [needing, setNeeding] = useState<string[] | null>(null);
  if (!object) return null;
  const remove = async () => {
    const projects = await projectsUsing(id).catch(() => []);
    // An unused object is removed at once; undo restores it.
    if (projects.length === 0) await removeObject(id);
    else setNeeding(projects);
  };
  return (
    <>
      <NameField
        label={t`Object name`}
        name={object.name}
        why={cannotRename}
        onRename={(name) => renameObject(id, name)}
      />
      <div className="actions start">
        <Button icon="plus" why={cannotCopy} onPress={() => void duplicateObject(object)}>
          {t`Duplicate`}
        </Button>
        <Button icon="close" why={why} onPress={() => void remove()}>
          {t`Remove`}
        </Button>
      </div>
      {placeable && <Placing id={id} />}
      <Visibility id={id} />
      <Values key={id} id={id} />
      {needing && (
        <Confirm
          title={t`Remove ${object.name}?`}
          confirmLabel={t`Remove`}
          onClose={() => setNeeding(null)}
          onConfirm={() => void removeObject(id, true)}
        >
          <p>{t`These projects lose the actions and points of this object when you save the scene:`}</p>
          <ul>
            {needing.map((each) => (
              <li key={each}>{each}</li>
            ))}
          </ul>
        </Confirm>
      )}
    </>
  );
};

/** Trends of the device's values, which are read only while they are shown. */
function Values({ id }: { id: string }) {
  const [shown, setShown] = useState(false);
  const changing = useEditor(({ doc, types }) => {
    const type = doc?.objects[id]?.type ?? "";
    return types.byName[type]?.observable === true || types.robots[type] !== undefined;
  });
  if (!changing) return null;
  return (
    <>
      <SwitchField isSelected={shown} onChange={setShown}>
        {t`Trends of values`}
      </SwitchField>
      {shown && (
        <Suspense fallback={<Waiting>{t`Loading…`}</Waiting>}>
          <Trends id={id} />
        </Suspense>
      )}
    </>
  );
}

/** Visibility for this user only. */
function Visibility({ id }: { id: string }) {
  const hidden = useEditor(
    (state) => Array.isArray(state.view.user.blocklist) && state.view.user.blocklist.includes(id),
  );
  const opacity = useEditor((state) =>
    Number((state.view.user.opacity as Record<string, unknown> | undefined)?.[id] ?? 1),
  );
  const [pending, setPending] = useState<number | null>(null);
  const put = (value: number) => {
    const rest = { ...(getState().view.user.opacity as Record<string, number> | undefined) };
    if (value >= 1) delete rest[id];
    else rest[id] = value;
    storeViewState("user", { opacity: rest });
  };
  return (
    <>
      <SwitchField isSelected={hidden} onChange={(on) => setHidden(id, on)}>
        {t`Hide`}
      </SwitchField>
      {!hidden && (
        <SliderField
          label={t`Transparency`}
          value={1 - (pending ?? opacity)}
          least={0}
          most={0.95}
          step={0.05}
          words={(value) => `${Math.round(value * 100)} %`}
          onChange={(value) => setPending(1 - value)}
          onEnd={(value) => {
            put(1 - value);
            setPending(null);
          }}
        />
      )}
    </>
  );
}

export default Body;
