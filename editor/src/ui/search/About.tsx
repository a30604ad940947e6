/** About: versions, invitation, keys. A separate chunk. */

import { t } from "@lingui/core/macro";
import { version } from "../../../package.json";
import { useEditor } from "../../store/store";
import { Invitation } from "../join/Invitation";
import { ModalDialog } from "../kit/dialogs";
import { Button } from "../kit/kit";
import { SaveDiagnosis } from "./SaveDiagnosis";
import "./search.css";

const keys = (): readonly (readonly [string, string])[] => [
  ["/", t`find a command or an object`],
  ["?", t`this page`],
  [t`Esc twice`, t`stop motion while a robot is online`],
  [t`Tab, arrows`, t`move between tools, lists and fields; Enter selects`],
  ["X", t`show or hide the crosshair; N: next object, Enter: select`],
  ["W A S D Q E", t`fly when the view has the focus`],
  [t`Arrow keys in a number`, t`one step up or down`],
];

export default function About({ onClose }: { onClose: () => void }) {
  const { server, user } = useEditor((state) => state.connection);
  return (
    <ModalDialog title={t`About`} onClose={onClose}>
      <dl className="facts">
        <dt>{t`Editor`}</dt>
        <dd>ARCOR2-HW {version}</dd>
        <dt>{t`Server`}</dt>
        <dd>{server ? t`${server.version}, protocol ${server.api_version}` : t`no connection`}</dd>
        <dt>{t`You are`}</dt>
        <dd>{user}</dd>
      </dl>
      <Invitation />
      <SaveDiagnosis />
      <h3>{t`Keys`}</h3>
      <dl className="facts">
        {keys().map(([key, does]) => (
          <div key={key} className="fact">
            <dt>
              <kbd>{key}</kbd>
            </dt>
            <dd>{does}</dd>
          </div>
        ))}
      </dl>
      <div className="actions">
        <Button variant="primary" onPress={onClose}>
          {t`Close`}
        </Button>
      </div>
    </ModalDialog>
  );
}
