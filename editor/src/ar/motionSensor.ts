/** Permission to use the orientation sensor. */

/** Ask for the orientation sensor where the browser requires it (iOS). Call it in the handler of a tap. */
export async function askForMotion(): Promise<void> {
  const event = globalThis.DeviceOrientationEvent as unknown as
    | { requestPermission?: () => Promise<string> }
    | undefined;
  // Without it, AR works as long as a marker is visible.
  await event?.requestPermission?.().catch(() => "denied");
}
