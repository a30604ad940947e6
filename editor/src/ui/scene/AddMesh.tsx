/** Upload a mesh as an object. Its size is shown first, since many files do not state the unit. */

import { plural, t } from "@lingui/core/macro";
import { type FormEvent, useState } from "react";
import { addMesh, freeObjectName } from "../../commands/scene";
import type { MeshFile } from "../../scene/meshes";
import { amountText, LENGTH_UNITS, type LengthUnit, UNIT_FACTORS } from "../../transform/amounts";
import { Field } from "../kit/Field";
import { ToggleGroup } from "../kit/fields";
import { Button } from "../kit/kit";
import { RefusedText, useRefusal } from "../points/Refusal";
import { MeshPreview } from "./MeshPreview";

export function AddMesh({ why, onBack }: { why: string; onBack: () => void }) {
  const [mesh, setMesh] = useState<MeshFile | null>(null);
  const [unit, setUnit] = useState<LengthUnit>("m");
  const [name, setName] = useState("");
  const [wrong, setWrong] = useState("");
  const { refused, busy, ask } = useRefusal();
  const read = async (file: File | undefined) => {
    setWrong("");
    setMesh(null);
    if (!file) return;
    try {
      const { readMesh, likelyUnit } = await import("../../scene/meshes");
      const found = await readMesh(file);
      setMesh(found);
      setUnit(likelyUnit(found.size));
      setName(freeObjectName(file.name.replace(/\.\w+$/, "")));
    } catch (error) {
      setWrong(error instanceof Error ? error.message : String(error));
    }
  };
  const submit = (event: FormEvent) => {
    event.preventDefault();
    if (!mesh || why) return;
    const upload = async () => {
      const { inMetres } = await import("../../scene/meshes");
      return addMesh(name.trim(), inMetres(mesh, UNIT_FACTORS[unit]));
    };
    void ask(upload());
  };
  return (
    <form className="add-form" onSubmit={submit}>
      <Button variant="plain" onPress={onBack}>
        {t`← All types`}
      </Button>
      <h3>{t`Mesh`}</h3>
      <div className="field">
        <label htmlFor="mesh-file">{t`File: STL, GLB, OBJ, PLY or DAE`}</label>
        <input
          id="mesh-file"
          type="file"
          accept=".stl,.glb,.gltf,.obj,.ply,.dae"
          onChange={(event) => void read(event.target.files?.[0])}
        />
      </div>
      <RefusedText>{wrong}</RefusedText>
      {mesh && (
        <>
          <MeshPreview geometry={mesh.geometry} />
          <ToggleGroup
            label={t`Unit of the file`}
            value={unit}
            choices={LENGTH_UNITS.map((each) => [each, `1 ${each}`] as const)}
            onChange={setUnit}
          />
          <p className="small">
            {t`Size: ${mesh.size.map((each) => amountText(each * UNIT_FACTORS[unit], "mm")).join(" × ")} mm.`}{" "}
            <span className="quiet">{plural(mesh.triangles, { one: "# triangle", other: "# triangles" })}</span>
          </p>
          <Field label={t`Name`} value={name} onChange={setName} autoComplete="off" />
          <RefusedText>{refused}</RefusedText>
          <Button variant="primary" icon="plus" type="submit" why={why} isDisabled={busy || !name.trim()}>
            {busy ? t`Uploading…` : t`Upload and add`}
          </Button>
        </>
      )}
    </form>
  );
}
