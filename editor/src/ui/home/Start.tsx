/** The first thing on the home screen: continue, start with an example, or create the first workplace. */

import { plural, t } from "@lingui/core/macro";
import * as documents from "../../commands/documents";
import { proposalOf } from "../../home/start";
import { whyUnavailable } from "../../store/permissions";
import { setUi, useEditor } from "../../store/store";
import { Button } from "../kit/kit";
import { stepsOf } from "../tour/steps";
import { recentOf } from "./recent";

export function Start() {
  const lists = useEditor((state) => state.lists);
  const recent = useEditor(recentOf);
  const cannotAdd = useEditor((state) => whyUnavailable(state, "NewScene"));
  const steps = useEditor((state) => stepsOf(state.connection.role).length);
  const proposal = proposalOf(lists, recent);
  if (!proposal) return null;
  if (proposal.kind === "empty")
    return (
      <section className="start-here" aria-label={t`Start`}>
        <p>{t`Create a workplace, add its devices, and program it.`}</p>
        <Button
          variant="primary"
          icon="play"
          why={cannotAdd}
          onPress={() => void documents.startEmpty(t`Workplace`, t`Program`)}
        >
          {t`Start here`}
        </Button>
      </section>
    );
  const { document, id, name } = proposal;
  const open = () => (document === "scene" ? documents.openScene(id) : documents.openProject(id));
  return (
    <section className="start-here" aria-label={t`Start`}>
      {proposal.kind === "continue" ? (
        <Button variant="primary" icon="play" className="wraps" onPress={() => void open()}>
          {t`Continue with ${name}`}
        </Button>
      ) : (
        <>
          <p>
            {plural(steps, {
              one: `“${name}” is a complete program. A guided tour of # step shows how it works.`,
              other: `“${name}” is a complete program. A guided tour of # steps shows how it works.`,
            })}
          </p>
          <Button
            variant="primary"
            icon="play"
            onPress={() => {
              setUi({ tour: 0 });
              void open();
            }}
          >
            {t`Start here`}
          </Button>
        </>
      )}
    </section>
  );
}
