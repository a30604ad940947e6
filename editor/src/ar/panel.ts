/** The panel of a headset: texts and buttons in space in front of the user. */

import {
  CanvasTexture,
  Matrix4,
  Mesh,
  MeshBasicMaterial,
  PlaneGeometry,
  Quaternion,
  type Scene,
  SRGBColorSpace,
  Vector3,
} from "three";

export interface PanelButton {
  id: string;
  label: string;
  /** Cells of a row of 12. */
  cells: number;
  style?: "stop";
  disabled?: boolean;
  /** Called when it is pressed; a function that it returns is called on release. */
  press: () => unknown;
}

interface PanelContent {
  title: string;
  lines: readonly string[];
  buttons: readonly PanelButton[];
}

/** Size, m, and pixels per m. */
const WIDTH = 0.56;
const HEIGHT = 0.44;
const DENSITY = 1400;
const CELL = WIDTH / 12;
const ROW = 0.066;
const GAP = 0.006;
/** Distance from the user, m; below the line of sight and after which turn it follows, rad. */
const AHEAD = 0.75;
const BELOW = 0.35;
const TURNED = 0.6;
const MOVED = 0.5;

interface Placed {
  button: PanelButton;
  left: number;
  top: number;
  width: number;
}

const inverse = new Matrix4();

export class Panel {
  readonly mesh: Mesh<PlaneGeometry, MeshBasicMaterial>;
  private readonly canvas = Object.assign(document.createElement("canvas"), {
    width: Math.round(WIDTH * DENSITY),
    height: Math.round(HEIGHT * DENSITY),
  });
  private readonly texture = new CanvasTexture(this.canvas);
  private content: PanelContent = { title: "", lines: [], buttons: [] };
  private placed: Placed[] = [];
  private drawn = "";
  private hovered = "";
  private at: { eye: Vector3; heading: number } | null = null;

  constructor(scene: Scene) {
    this.texture.colorSpace = SRGBColorSpace;
    const material = new MeshBasicMaterial({ map: this.texture, toneMapped: false });
    this.mesh = new Mesh(new PlaneGeometry(WIDTH, HEIGHT), material);
    this.mesh.matrixAutoUpdate = false;
    scene.add(this.mesh);
  }

  show(content: PanelContent): void {
    this.content = content;
    this.placed = placedOf(content.buttons);
    this.draw();
  }

  /** Stay in front of the user, so that Stop can be reached: follow after a turn or a step. */
  follow(viewer: Matrix4): void {
    const eye = new Vector3().setFromMatrixPosition(viewer);
    const ahead = new Vector3(0, 0, -1).transformDirection(viewer);
    const heading = Math.atan2(-ahead.x, -ahead.z);
    const { at } = this;
    const turn = at ? Math.abs(Math.atan2(Math.sin(heading - at.heading), Math.cos(heading - at.heading))) : Math.PI;
    if (at && turn < TURNED && eye.distanceTo(at.eye) < MOVED) return;
    this.at = { eye, heading };
    const up = new Vector3(0, 1, 0);
    const place = new Vector3(0, -Math.sin(BELOW), -Math.cos(BELOW)).multiplyScalar(AHEAD);
    place.applyAxisAngle(up, heading).add(eye);
    const turned = new Quaternion().setFromAxisAngle(up, heading);
    turned.multiply(new Quaternion().setFromAxisAngle(new Vector3(1, 0, 0), -BELOW));
    this.mesh.matrix.compose(place, turned, new Vector3(1, 1, 1));
    this.mesh.matrixWorldNeedsUpdate = true;
  }

  /** Return the distance at which a ray meets the panel, m, and the button there; null if it misses. */
  hit(ray: Matrix4): { distance: number; button: PanelButton | null } | null {
    inverse.copy(this.mesh.matrix).invert().multiply(ray);
    const from = new Vector3().setFromMatrixPosition(inverse);
    const along = new Vector3(0, 0, -1).transformDirection(inverse);
    const distance = -from.z / along.z;
    if (!(distance > 0)) return null;
    const x = from.x + along.x * distance + WIDTH / 2;
    const y = HEIGHT / 2 - (from.y + along.y * distance);
    if (x < 0 || y < 0 || x > WIDTH || y > HEIGHT) return null;
    const found = this.placed.find(
      ({ left, top, width }) => x >= left && x <= left + width && y >= top && y <= top + ROW - GAP,
    );
    return { distance, button: found?.button ?? null };
  }

  hover(id: string): void {
    if (id === this.hovered) return;
    this.hovered = id;
    this.draw();
  }

  /** Return the middle of a button in the frame of WebXR, for tests. */
  middleOf(id: string): number[] | null {
    const found = this.placed.find(({ button }) => button.id === id);
    if (!found) return null;
    const at = new Vector3(found.left + found.width / 2 - WIDTH / 2, HEIGHT / 2 - found.top - (ROW - GAP) / 2, 0);
    return at.applyMatrix4(this.mesh.matrix).toArray();
  }

  dispose(): void {
    this.mesh.removeFromParent();
    this.mesh.geometry.dispose();
    this.mesh.material.dispose();
    this.texture.dispose();
  }

  private draw(): void {
    const { title, lines } = this.content;
    const signature = JSON.stringify([title, lines, this.placed, this.hovered]);
    const context = this.canvas.getContext("2d");
    if (signature === this.drawn || !context) return;
    this.drawn = signature;
    const font = getComputedStyle(document.body).fontFamily;
    const { width, height } = this.canvas;
    const pixels = (metres: number) => metres * DENSITY;
    context.fillStyle = "#10161d";
    context.fillRect(0, 0, width, height);
    context.textBaseline = "middle";
    const write = (text: string, x: number, y: number, size: number, widest: number, align: CanvasTextAlign) => {
      context.textAlign = align;
      context.font = `600 ${pixels(size)}px ${font}`;
      const part = Math.min(1, pixels(widest) / context.measureText(text).width);
      context.font = `600 ${pixels(size) * part}px ${font}`;
      context.fillText(text, pixels(x), pixels(y));
    };
    context.fillStyle = "#ffffff";
    write(title, GAP * 2, 0.022, 0.022, WIDTH - 4 * GAP, "left");
    lines.forEach((line, n) => write(line, GAP * 2, 0.052 + 0.024 * n, 0.017, WIDTH - 4 * GAP, "left"));
    for (const { button, left, top, width } of this.placed) {
      const { style, disabled, id, label } = button;
      context.globalAlpha = disabled ? 0.4 : 1;
      context.fillStyle = style ? "#c62828" : "#2b3642";
      context.fillRect(pixels(left), pixels(top), pixels(width), pixels(ROW - GAP));
      if (id === this.hovered) {
        context.lineWidth = pixels(0.003);
        context.strokeStyle = "#ffffff";
        context.strokeRect(pixels(left), pixels(top), pixels(width), pixels(ROW - GAP));
      }
      context.fillStyle = "#ffffff";
      write(label, left + width / 2, top + (ROW - GAP) / 2, style ? 0.026 : 0.02, width - 2 * GAP, "center");
    }
    context.globalAlpha = 1;
    this.texture.needsUpdate = true;
  }
}

/** Return where the buttons are: rows of 12 cells, the last one at the lower edge. */
function placedOf(buttons: readonly PanelButton[]): Placed[] {
  const rows: PanelButton[][] = [];
  let cells = 12;
  for (const button of buttons) {
    if (cells + button.cells > 12) {
      rows.push([]);
      cells = 0;
    }
    rows.at(-1)?.push(button);
    cells += button.cells;
  }
  return rows.flatMap((row, n) => {
    let left = GAP / 2;
    return row.map((button): Placed => {
      const placed = { button, left, top: HEIGHT - (rows.length - n) * ROW, width: button.cells * CELL - GAP };
      left += button.cells * CELL;
      return placed;
    });
  });
}
