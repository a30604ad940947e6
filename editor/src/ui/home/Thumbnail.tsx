/** The thumbnail of a document; loaded when the tile becomes visible, and again after a save. */

import { useEffect, useRef } from "react";
import { readThumbnail, useThumbnails } from "../../commands/thumbnail";

/** Save times of the documents whose thumbnail was requested. */
const asked = new Map<string, string>();

export function Thumbnail({ id, time }: { id: string; time: string }) {
  const picture = useThumbnails((all) => all[id]) ?? "";
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const element = place.current;
    if (!element || asked.get(id) === time) return;
    const watch = new IntersectionObserver((seen) => {
      if (!seen.some((each) => each.isIntersecting)) return;
      watch.disconnect();
      asked.set(id, time);
      readThumbnail(id).catch(() => asked.delete(id)); // the tile keeps the old picture, or none
    });
    watch.observe(element);
    return () => watch.disconnect();
  }, [id, time]);
  return (
    <div ref={place} className="thumbnail" data-empty={picture === ""}>
      {picture && <img src={picture} alt="" />}
    </div>
  );
}
