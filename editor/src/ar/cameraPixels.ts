/** Pictures of the camera in an XR session, read without waiting for the graphics processor. */

export interface Pixels {
  /** RGBA, row by row from the bottom. */
  data: Uint8Array<ArrayBuffer>;
  width: number;
  height: number;
}

export class CameraPixels {
  private readonly framebuffer: WebGLFramebuffer;
  private readonly buffer: WebGLBuffer;
  private reading: { fence: WebGLSync; width: number; height: number } | null = null;

  constructor(private readonly gl: WebGL2RenderingContext) {
    this.framebuffer = gl.createFramebuffer();
    this.buffer = gl.createBuffer();
  }

  /** Start to read a texture of the current frame, unless a picture is being read. Return whether it does. */
  read(texture: WebGLTexture, width: number, height: number): boolean {
    if (this.reading) return false;
    const { gl } = this;
    const before = gl.getParameter(gl.FRAMEBUFFER_BINDING) as WebGLFramebuffer | null;
    gl.bindFramebuffer(gl.FRAMEBUFFER, this.framebuffer);
    gl.framebufferTexture2D(gl.FRAMEBUFFER, gl.COLOR_ATTACHMENT0, gl.TEXTURE_2D, texture, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.buffer);
    gl.bufferData(gl.PIXEL_PACK_BUFFER, 4 * width * height, gl.STREAM_READ);
    gl.readPixels(0, 0, width, height, gl.RGBA, gl.UNSIGNED_BYTE, 0);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    gl.bindFramebuffer(gl.FRAMEBUFFER, before);
    const fence = gl.fenceSync(gl.SYNC_GPU_COMMANDS_COMPLETE, 0);
    if (fence) this.reading = { fence, width, height };
    return fence !== null;
  }

  /** Return the picture that was read; null while there is none. */
  take(): Pixels | null {
    const { gl, reading } = this;
    if (!reading || gl.getSyncParameter(reading.fence, gl.SYNC_STATUS) !== gl.SIGNALED) return null;
    const { fence, width, height } = reading;
    this.reading = null;
    gl.deleteSync(fence);
    const data = new Uint8Array(4 * width * height);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, this.buffer);
    gl.getBufferSubData(gl.PIXEL_PACK_BUFFER, 0, data);
    gl.bindBuffer(gl.PIXEL_PACK_BUFFER, null);
    return { data, width, height };
  }

  dispose(): void {
    if (this.reading) this.gl.deleteSync(this.reading.fence);
    this.gl.deleteFramebuffer(this.framebuffer);
    this.gl.deleteBuffer(this.buffer);
  }
}

/** Return a canvas with a picture. */
export function canvasOf({ data, width, height }: Pixels): HTMLCanvasElement {
  const canvas = Object.assign(document.createElement("canvas"), { width, height });
  const context = canvas.getContext("2d");
  const row = 4 * width;
  const upright = new Uint8ClampedArray(data.length);
  for (let y = 0; y < height; y++) upright.set(data.subarray(y * row, (y + 1) * row), (height - 1 - y) * row);
  context?.putImageData(new ImageData(upright, width, height), 0, 0);
  return canvas;
}
