/** All that was told since the page is open, with times, the newest first: also what went by itself. */

import { useEditor } from "../../store/store";
import { Window } from "../kit/dialogs";
import { Icon } from "../kit/icons";
import { Button } from "../kit/kit";
import "./messages.css";

const WORDS = { info: "told", warn: "warning", error: "error" } as const;

export default function Messages({ onClose }: { onClose: () => void }) {
  const said = useEditor((state) => state.said);
  return (
    <Window title="Messages" onClose={onClose}>
      {said.length === 0 && <p className="quiet">Nothing has been told since the page is open.</p>}
      <ol className="messages" tabIndex={0} aria-label="Messages, the newest first">
        {[...said].reverse().map(({ id, level, text, time }) => (
          <li key={id} className={level}>
            <Icon name={level === "info" ? "info" : "warn"} size={18} />
            <time className="quiet" dateTime={new Date(time).toISOString()}>
              {new Date(time).toLocaleTimeString("en-GB")}
            </time>
            <span>
              <span className="hidden-but-read">{WORDS[level]}: </span>
              {text}
            </span>
          </li>
        ))}
      </ol>
      <div className="actions">
        <Button look="primary" onPress={onClose}>
          Close
        </Button>
      </div>
    </Window>
  );
}
