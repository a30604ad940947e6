/** Who is here. */

import { now, useEditor } from "../../store/store";
import { Icon } from "../kit/icons";
import { nameOf } from "../names";
import { colourOf, initials } from "./colours";
import "./people.css";

export function People() {
  const users = useEditor((state) => state.users);
  const me = useEditor((state) => state.connection.user);
  const doc = useEditor((state) => state.doc);
  const called = (name: string) => {
    if (name === me) return `${name} (you)`;
    const looked = users[name]?.presence?.selected[0];
    const thing = looked && doc ? nameOf(now(), looked) : "";
    return thing ? `${name}, at ${thing}` : name;
  };
  const names = [me, ...Object.keys(users).filter((name) => name !== me).sort()];
  const shown = names.slice(0, 4);
  return (
    <div className="people" role="group" aria-label={names.length === 1 ? "Only you are here" : `${names.length} people are here`}>
      {shown.map((name) => (
        <span key={name} className="person" title={called(name)} style={{ background: colourOf(name) }} role="img" aria-label={called(name)}>
          {initials(name)}
        </span>
      ))}
      {names.length > shown.length && (
        <span className="person more-people">
          <Icon name="people" size={16} />+{names.length - shown.length}
        </span>
      )}
    </div>
  );
}
