/** The number of repetitions of a failed action. Shown for actions that are safe to repeat. */

import { t } from "@lingui/core/macro";
import { notEditable, setRetry } from "../../commands/program";
import { useEditor } from "../../store/store";
import type { Section } from "../workplace/section";
import { ValueField } from "./ValueField";

/** Limits of the server. */
const MOST = 100;
const LONGEST = 3600;

const Retry: Section["Body"] = ({ selection: { id } }) => {
  const action = useEditor((state) => state.doc?.actions[id]);
  const why = useEditor((state) => notEditable(state, "UpdateAction"));
  if (!action) return null;
  const { count, pause } = action.retry ?? { count: 0, pause: 0 };
  return (
    <>
      <ValueField
        label={t`Repetitions after an error`}
        name={t`Repetitions after an error`}
        type="integer"
        json={String(count)}
        extra={{ minimum: 0, maximum: MOST }}
        why={why}
        onSet={(json) => setRetry(id, { count: Number(json), pause })}
      />
      {count > 0 && (
        <ValueField
          label={t`Pause before a repetition`}
          name={t`Pause before a repetition`}
          type="double"
          json={JSON.stringify(pause)}
          extra={{ minimum: 0, maximum: LONGEST, unit: "s" }}
          why={why}
          onSet={(json) => setRetry(id, { count, pause: Number(json) })}
        />
      )}
    </>
  );
};
export default Retry;
