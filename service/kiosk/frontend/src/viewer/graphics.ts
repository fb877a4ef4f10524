/** WebGL on a canvas, and what it is made by. */

/** A context, and whether the processor computes its pixels. */
export interface Graphics {
  readonly context: WebGL2RenderingContext;
  readonly software: boolean;
}

/** Names of renderers that compute pixels on the processor, as drivers give them. */
const SOFTWARE = /swiftshader|llvmpipe|softpipe|software|basic render/i;

/** Opens WebGL 2 on a canvas; null where there is none. Edges are smoothed in hardware alone. */
export function openGraphics(canvas: HTMLCanvasElement): Graphics | null {
  const software = isSoftware();
  const context = software === null ? null : canvas.getContext("webgl2", {
    alpha: true, premultipliedAlpha: true, depth: true, stencil: false, antialias: !software,
  });
  return context && { context, software: software === true };
}

let known: boolean | null = null;

/** Whether the processor computes pixels; null without WebGL. Asked once, of a context that goes. */
function isSoftware(): boolean | null {
  if (known !== null) return known;
  const context = document.createElement("canvas").getContext("webgl2");
  if (!context) return null;
  const named = context.getExtension("WEBGL_debug_renderer_info");
  const renderer = context.getParameter(named ? named.UNMASKED_RENDERER_WEBGL : context.RENDERER);
  known = SOFTWARE.test(String(renderer));
  context.getExtension("WEBGL_lose_context")?.loseContext();
  return known;
}

/**
 * Waits until all that was drawn is drawn.
 *
 * @returns false where the context was lost meanwhile.
 */
export async function drawn(context: WebGL2RenderingContext): Promise<boolean> {
  const ended = new AbortController();
  // Lost and restored between two looks, it has another life, in which the fence is none.
  let lost = context.isContextLost();
  context.canvas.addEventListener(
    "webglcontextlost", () => (lost = true), { signal: ended.signal });
  const fence = lost ? null : context.fenceSync(context.SYNC_GPU_COMMANDS_COMPLETE, 0);
  context.flush();
  try {
    while (!lost && fence) {
      // A fence's state is only seen to change between tasks.
      await new Promise((next) => setTimeout(next, 1));
      if (context.isContextLost()) lost = true;
      else if (!lost && context.clientWaitSync(fence, 0, 0) !== context.TIMEOUT_EXPIRED) break;
    }
    if (!lost) context.deleteSync(fence);
    return !lost;
  } finally {
    ended.abort();
  }
}
