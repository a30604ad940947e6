/** The picture of a workplace as it was when it was saved last; asked for when the tile is seen. */

import { useEffect, useRef, useState } from "react";
import { call, serves } from "../../session/session";

/** What was asked for, by document and when that was saved. */
const known = new Map<string, string>();

export function Thumbnail({ id, time }: { id: string; time: string }) {
  const key = `${id} ${time}`;
  const [picture, setPicture] = useState(known.get(key) ?? "");
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const element = place.current;
    if (!element || known.has(key) || !serves("GetViewState")) return;
    let here = true;
    const watch = new IntersectionObserver((seen) => {
      if (!seen.some((each) => each.isIntersecting)) return;
      watch.disconnect();
      call("GetViewState", { scope: "shared", document: id }).then(
        ({ values }) => {
          const { thumbnail } = values as { thumbnail?: unknown };
          const found = typeof thumbnail === "string" && thumbnail.startsWith("data:image/") ? thumbnail : "";
          known.set(key, found);
          if (here) setPicture(found);
        },
        () => {}, // the tile stays without one
      );
    });
    watch.observe(element);
    return () => {
      here = false;
      watch.disconnect();
    };
  }, [id, key]);
  return (
    <div ref={place} className="thumbnail" data-empty={picture === ""}>
      {picture && <img src={picture} alt="" />}
    </div>
  );
}
