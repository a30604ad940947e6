/** A point: name, parent, note, update from the robot. */

import { plural, t } from "@lingui/core/macro";
import { useState } from "react";
import { holdHandTeaching } from "../../commands/holdToRun";
import { movePointToRobot, possibleParents, removePoint, renamePoint, setParent } from "../../commands/points";
import { chosenRobot, featuresOf, notReady } from "../../commands/robot";
import { storeViewState } from "../../commands/viewstate";
import { useEditor } from "../../store/store";
import { nameOf } from "../../viewmodel/names";
import { SelectField } from "../kit/fields";
import { Button } from "../kit/kit";
import { HoldButton } from "../robot/HoldButton";
import type { Section } from "../workplace/section";
import { useWhyNot } from "./editing";
import { NameField } from "./NameField";
import { RefusedText, useRefusal } from "./Refusal";
import { Remove } from "./Remove";
import "./points.css";

const PointSection: Section["Body"] = ({ selection: { id } }) => {
  const point = useEditor((state) => state.doc?.points[id]);
  const parents = useEditor((state) => possibleParents(state, id).join("\n"));
  const names = useEditor((state) =>
    possibleParents(state, id)
      .map((each) => nameOf(state, each))
      .join("\n"),
  );
  const chosen = useEditor(chosenRobot);
  const why = useWhyNot(id, "UpdateActionPointPosition");
  const noRobot = useEditor((state) => notReady(state, chosen, "UpdateActionPointUsingRobot"));
  const byHand = useEditor((state) =>
    chosen && featuresOf(state, chosen.robotId)?.hand_teaching ? "" : t`This robot does not support hand teaching.`,
  );
  const { refused, busy, ask } = useRefusal();
  if (!point) return null;
  const labels = names.split("\n");
  const choices = parents ? parents.split("\n").map((each, n) => [each, labels[n] ?? ""] as const) : [];
  return (
    <>
      <NameField
        key={id}
        label={t`Point name`}
        name={point.name}
        why={why}
        onRename={(name) => renamePoint(id, name)}
      />
      <SelectField
        label={t`Parent`}
        value={point.parent ?? ""}
        choices={[["", t`World`], ...choices]}
        isDisabled={why !== "" || busy}
        onChange={(parent) => void ask(setParent(id, parent))}
      />
      <div className="actions start">
        <Button
          icon="robot"
          why={why || noRobot}
          isDisabled={busy}
          onPress={() => chosen && void ask(movePointToRobot(id, chosen))}
        >
          {t`Move to the robot`}
        </Button>
        <HoldButton
          label={t`Hold to teach: move the arm by hand, release to set the point`}
          why={why || noRobot || byHand}
          onHold={() => holdHandTeaching(chosen?.robotId ?? "", chosen?.armId || undefined)}
          onOver={(reason) => void ask(reason || !chosen ? Promise.resolve(reason) : movePointToRobot(id, chosen))}
        >
          {t`Hold to teach`}
        </HoldButton>
      </div>
      <RefusedText>{refused}</RefusedText>
      <Note key={`note ${id}`} id={id} />
    </>
  );
};

export default PointSection;

/** Remove a point with its children. The server refuses to remove a point that is used. */
export const RemovePoint: Section["Body"] = ({ selection: { id } }) => {
  const doc = useEditor((state) => state.doc);
  const why = useWhyNot(id, "RemoveActionPoint");
  if (!doc?.points[id]) return null;
  const count = (of: Record<string, { pointId: string }>) =>
    Object.values(of).filter((each) => each.pointId === id).length;
  const actions = count(doc.actions);
  const orientations = count(doc.orientations);
  const joints = count(doc.joints);
  const along = [
    actions > 0 && plural(actions, { one: "# action", other: "# actions" }),
    orientations > 0 && plural(orientations, { one: "# orientation", other: "# orientations" }),
    joints > 0 && plural(joints, { one: "# joint configuration", other: "# joint configurations" }),
  ].filter(Boolean);
  return (
    <Remove key={id} name={doc.points[id].name} why={why} along={along.join(", ")} onRemove={() => removePoint(id)} />
  );
};

/** A note about a point for all users. The protocol has no request for a point's description. */
function Note({ id }: { id: string }) {
  const key = `note/${id}`;
  const stored = useEditor((state) => state.view.shared[key]);
  const why = useEditor((state) =>
    state.connection.status === "ready" && state.connection.role >= 2 ? "" : t`read only`,
  );
  const [text, setText] = useState<string | null>(null);
  return (
    <label className="field">
      <span>{t`Note`}</span>
      <textarea
        className="note"
        maxLength={2000}
        readOnly={why !== ""}
        value={text ?? (typeof stored === "string" ? stored : "")}
        onChange={(event) => setText(event.target.value)}
        onBlur={() => {
          if (text !== null) storeViewState("shared", { [key]: text.trim() || null });
          setText(null);
        }}
      />
    </label>
  );
}
