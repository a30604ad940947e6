/** Icons on a grid of 24 × 24 in the colour of the text, used next to a word or with a label. */

export const PATHS = {
  home: "M4 11l8-7 8 7v9h-5v-6H9v6H4z",
  save: "M5 4h11l3 3v13H5zM8 4v5h7V4M8 20v-6h8v6",
  undo: "M9 14L4 9l5-5M4 9h10a5 5 0 0 1 0 11h-3",
  redo: "M15 14l5-5-5-5M20 9H10a5 5 0 0 0 0 11h3",
  close: "M6 6l12 12M18 6L6 18",
  left: "M15 5l-7 7 7 7",
  right: "M9 5l7 7-7 7",
  more: "M5 11a1 1 0 1 0 0 2 1 1 0 1 0 0-2zM12 11a1 1 0 1 0 0 2 1 1 0 1 0 0-2zM19 11a1 1 0 1 0 0 2 1 1 0 1 0 0-2z",
  plus: "M12 5v14M5 12h14",
  tree: "M5 5h6M5 5v14h4M5 12h4M13 12h6M13 19h6",
  plug: "M9 3v5M15 3v5M6 8h12v3a6 6 0 0 1-12 0zM12 17v4",
  robot: "M6 21h8M10 21v-5l-4-5 6-6 6 3M12 5a1 1 0 1 0 0 .01",
  camera: "M3 8h4l2-3h6l2 3h4v11H3zM12 10a3.5 3.5 0 1 0 0 7 3.5 3.5 0 0 0 0-7z",
  search: "M10.5 4a6.5 6.5 0 1 0 0 13 6.5 6.5 0 0 0 0-13zM15.5 15.500L21 21",
  people:
    "M9 11a3.5 3.5 0 1 0 0-7 3.5 3.5 0 0 0 0 7zM2.5 20a6.5 6.5 0 0 1 13 0" +
    "M16 4.500a3.5 3.5 0 0 1 0 6.500M18 14.500a6.5 6.5 0 0 1 3.5 5.5",
  zoom: "M4 9V4h5M20 9V4h-5M4 15v5h5M20 15v5h-5",
  info: "M12 11v6M12 7.500v.01M12 3a9 9 0 1 0 0 18 9 9 0 0 0 0-18z",
  warn: "M12 4L2.5 20h19zM12 10v5M12 17.500v.01",
  check: "M4 12.500l5 5L20 6.5",
  pause: "M8 5v14M16 5v14",
  stop: "M6 6h12v12H6z",
  step: "M6 5l9 7-9 7zM18 5v14",
  play: "M7 4l13 8-13 8z",
  settings: "M4 7h9M17 7h3M15 5v4M4 17h3M11 17h9M9 15v4",
  list: "M4 6h16M4 12h16M4 18h16",
  box: "M4 8l8-4 8 4v8l-8 4-8-4zM4 8l8 4 8-4M12 12v8",
  point: "M12 9a3 3 0 1 0 0 6 3 3 0 0 0 0-6zM12 2v4M12 18v4M2 12h4M18 12h4",
  action: "M4 14c0-2 3.6-3.5 8-3.500s8 1.5 8 3.5-3.6 3.5-8 3.500S4 16 4 14z",
  eye: "M2 12s4-7 10-7 10 7 10 7-4 7-10 7-10-7-10-7zM12 9a3 3 0 1 0 0 6 3 3 0 0 0 0-6z",
  parallel: "M12 3v4M6 17V7h12v10zM12 17v4M12 10v4",
  function: "M8 4H4v16h4M16 4h4v16h-4M8 12h7M12 9l3 3-3 3",
  lock: "M6 11h12v9H6zM8.5 11V8a3.5 3.5 0 0 1 7 0v3",
} as const;

export type IconName = keyof typeof PATHS;

export function Icon({ name, size }: { name: IconName; size?: number }) {
  return <Drawing path={PATHS[name]} {...(size !== undefined && { size })} />;
}

/** A path in the style of the icons. */
export function Drawing({ path, size = 20 }: { path: string; size?: number }) {
  return (
    <svg
      width={size}
      height={size}
      viewBox="0 0 24 24"
      fill="none"
      stroke="currentColor"
      strokeWidth="1.9"
      strokeLinecap="round"
      strokeLinejoin="round"
      aria-hidden="true"
    >
      <path d={path} />
    </svg>
  );
}
