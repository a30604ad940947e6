/** The thumbnail of a document; loaded when the tile becomes visible, and again after a save. */

import { useEffect, useRef } from "react";
import { loadThumbnailOnce } from "../../commands/thumbnail";
import { useEditor } from "../../store/store";

export function Thumbnail({ id, time }: { id: string; time: string }) {
  const picture = useEditor((state) => state.thumbnails[id]?.picture) ?? "";
  const place = useRef<HTMLDivElement>(null);
  useEffect(() => {
    const element = place.current;
    if (!element) return;
    const watch = new IntersectionObserver((seen) => {
      if (!seen.some((each) => each.isIntersecting)) return;
      watch.disconnect();
      loadThumbnailOnce(id, time);
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
