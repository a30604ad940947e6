/** Grey pictures. */

export interface Grey {
  /** Brightness, row by row. */
  data: Uint8Array;
  width: number;
  height: number;
}

/** Return the picture of a canvas in grey. */
export function greyOf(rgba: ArrayLike<number>, width: number, height: number): Grey {
  const data = new Uint8Array(width * height);
  for (let i = 0, j = 0; i < data.length; i++, j += 4) {
    data[i] = ((rgba[j] as number) * 77 + (rgba[j + 1] as number) * 150 + (rgba[j + 2] as number) * 29) >> 8;
  }
  return { data, width, height };
}

/** Return an upright copy of a picture whose rows start at the bottom. */
export function flipped({ data, width, height }: Grey): Grey {
  const out = new Uint8Array(data.length);
  for (let y = 0; y < height; y++) out.set(data.subarray(y * width, (y + 1) * width), (height - 1 - y) * width);
  return { data: out, width, height };
}

/** Return a picture of half the size. */
export function half({ data, width, height }: Grey): Grey {
  const w = width >> 1;
  const h = height >> 1;
  const out = new Uint8Array(w * h);
  for (let y = 0, k = 0; y < h; y++) {
    for (let x = 0, a = 2 * y * width; x < w; x++, a += 2, k++) {
      const upper = (data[a] as number) + (data[a + 1] as number);
      out[k] = (upper + (data[a + width] as number) + (data[a + width + 1] as number) + 2) >> 2;
    }
  }
  return { data: out, width: w, height: h };
}

/** Return the brightness at a place between pixels. */
export function sample({ data, width, height }: Grey, x: number, y: number): number {
  if (!(x >= 0 && y >= 0 && x < width - 1 && y < height - 1)) return 128;
  const i = x | 0;
  const j = y | 0;
  const u = x - i;
  const v = y - j;
  const k = j * width + i;
  return (
    ((data[k] as number) * (1 - u) + (data[k + 1] as number) * u) * (1 - v) +
    ((data[k + width] as number) * (1 - u) + (data[k + width + 1] as number) * u) * v
  );
}
