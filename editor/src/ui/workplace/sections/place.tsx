/** Where the selected thing stands: position in mm, rotation in degrees. */

import type { Position } from "../../../protocol/types";
import { useEditor } from "../../../store/store";
import { rollPitchYaw } from "../../../viewmodel/rotations";
import { nameOf } from "../../names";
import type { Section } from "../sections";

const Body: Section["Body"] = ({ selection: { id } }) => {
  const object = useEditor((state) => state.doc?.objects[id]?.pose);
  const point = useEditor((state) => state.doc?.points[id]);
  const orientation = useEditor((state) => state.doc?.orientations[id]?.orientation);
  const parent = useEditor((state) => (point?.parent ? nameOf(state, point.parent) : ""));
  const position = object?.position ?? point?.position;
  const turned = object?.orientation ?? orientation;
  return (
    <>
      {point && <p className="quiet small">{parent ? `relative to ${parent}` : "in the world"}</p>}
      <dl className="numbers">
        {position && <Numbers title="Position" unit="mm" values={millimetres(position)} />}
        {turned && <Numbers title="Rotation" unit="°" values={rollPitchYaw(turned)} />}
      </dl>
    </>
  );
};

function Numbers({ title, unit, values }: { title: string; unit: string; values: [number, number, number] }) {
  return (
    <div>
      <dt>
        {title} <span className="quiet">{unit}</span>
      </dt>
      {(["x", "y", "z"] as const).map((axis, n) => (
        <dd key={axis}>
          <span className="quiet">{axis}</span> {(values[n] ?? 0).toFixed(1)}
        </dd>
      ))}
    </div>
  );
}

function millimetres({ x, y, z }: Position): [number, number, number] {
  return [x * 1000, y * 1000, z * 1000];
}

export const place: Section = {
  id: "place",
  title: "Place",
  applies: ({ kind, id }, state) => kind === "point" || kind === "orientation" || state.doc?.objects[id]?.pose !== undefined,
  Body,
};
