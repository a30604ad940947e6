/** What this is, how others join, and which keys there are; a chunk of its own. */

import { version } from "../../../package.json";
import { useEditor } from "../../store/store";
import { Invitation } from "../join/Invitation";
import { Window } from "../kit/dialogs";
import { Button } from "../kit/kit";
import { SaveDiagnosis } from "./SaveDiagnosis";
import "./search.css";

const KEYS: readonly (readonly [string, string])[] = [
  ["/", "find a command or a thing"],
  ["?", "this page"],
  ["Esc, twice", "stop motion, while a robot is live"],
  ["Tab, arrows", "through tools, lists and fields; Enter does it"],
  ["X", "the cross in the middle of the view comes and goes; N: the next thing there, Enter: select it"],
  ["W A S D Q E", "fly, when the view has the focus"],
  ["arrow keys at a number", "one step more or less"],
];

export default function About({ onClose }: { onClose: () => void }) {
  const { server, user } = useEditor((state) => state.connection);
  return (
    <Window title="About" onClose={onClose}>
      <dl className="facts">
        <dt>Editor</dt>
        <dd>ARCOR2-HW {version}</dd>
        <dt>Server</dt>
        <dd>{server ? `${server.version}, protocol ${server.api_version}` : "no connection"}</dd>
        <dt>You are</dt>
        <dd>{user}</dd>
      </dl>
      <Invitation />
      <SaveDiagnosis />
      <h3>Keys</h3>
      <dl className="facts">
        {KEYS.map(([key, does]) => (
          <div key={key} className="fact">
            <dt>
              <kbd>{key}</kbd>
            </dt>
            <dd>{does}</dd>
          </div>
        ))}
      </dl>
      <div className="actions">
        <Button look="primary" onPress={onClose}>
          Close
        </Button>
      </div>
    </Window>
  );
}
