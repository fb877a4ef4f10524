/** Fingers, mouse, pen, wheel and keys on a canvas, as turning, coming nearer and moving. */

/** What gestures do. */
export interface GestureTarget {
  /** Somebody touched the canvas. */
  touched(): void;
  /** Turn by degrees. */
  turn(yaw: number, pitch: number): void;
  /** Let go while moving, degrees a second. */
  flick(yaw: number, pitch: number): void;
  /** Come nearer by a factor. */
  zoom(factor: number): void;
  /** Move by CSS pixels. */
  pan(x: number, y: number): void;
  reset(): void;
}

/** A drag across the canvas's shorter side turns by so much, degrees. */
const TURN_ACROSS = 150;
const WHEEL_LINE_PX = 16;
const WHEEL_PER_PX = 0.0015;
/** Two taps so near in time and place are one double tap: ms, CSS pixels. */
const DOUBLE_TAP_MS = 350;
const TAP_PX = 24;
/** A finger that moved before it let go within this time flicks, ms. */
const FLICK_MS = 60;
const KEY_TURN = 10;
const KEY_ZOOM = 1.2;

/**
 * Listens on a canvas until the signal ends it.
 *
 * Keys work while the canvas has the focus: arrows turn, + and - zoom, 0 and Home reset.
 */
export function listen(canvas: HTMLCanvasElement, target: GestureTarget, signal: AbortSignal): void {
  const fingers = new Map<number, { x: number; y: number }>();
  // The browser is to leave fingers on the canvas alone.
  canvas.style.touchAction = "none";
  let tap = { time: -Infinity, x: 0, y: 0 };
  let moved = 0;
  let last = { time: 0, yaw: 0, pitch: 0 };

  const perPixel = (): number =>
    TURN_ACROSS / Math.max(1, Math.min(canvas.clientWidth, canvas.clientHeight));

  const drag = (event: PointerEvent, dx: number, dy: number): void => {
    const [yaw, pitch] = [dx * perPixel(), dy * perPixel()];
    target.turn(yaw, pitch);
    const seconds = Math.max(1, event.timeStamp - last.time) / 1000;
    last = { time: event.timeStamp, yaw: yaw / seconds, pitch: pitch / seconds };
  };

  const pinch = (moving: number, x: number, y: number): void => {
    const [other] = [...fingers].filter(([id]) => id !== moving).map(([, finger]) => finger);
    const finger = fingers.get(moving);
    if (!other || !finger) return;
    const before = Math.hypot(finger.x - other.x, finger.y - other.y);
    const after = Math.hypot(x - other.x, y - other.y);
    if (before > 0 && after > 0) target.zoom(after / before);
    target.pan((x - finger.x) / 2, (y - finger.y) / 2);
  };

  const lift = (event: PointerEvent): void => {
    if (!fingers.delete(event.pointerId)) return;
    if (fingers.size > 0) return;
    if (event.type === "pointercancel") return;
    if (moved > TAP_PX) {
      if (event.timeStamp - last.time < FLICK_MS) target.flick(last.yaw, last.pitch);
      return;
    }
    const near = Math.hypot(event.clientX - tap.x, event.clientY - tap.y) < 2 * TAP_PX;
    if (near && event.timeStamp - tap.time < DOUBLE_TAP_MS) {
      target.reset();
      tap = { time: -Infinity, x: 0, y: 0 };
    } else {
      tap = { time: event.timeStamp, x: event.clientX, y: event.clientY };
    }
  };

  canvas.addEventListener("pointerdown", (event) => {
    if (event.button !== 0 || fingers.size >= 2) return;
    try {
      canvas.setPointerCapture(event.pointerId);
    } catch {
      // The pointer is gone already.
    }
    fingers.set(event.pointerId, { x: event.clientX, y: event.clientY });
    if (fingers.size === 1) {
      moved = 0;
      last = { time: event.timeStamp, yaw: 0, pitch: 0 };
    } else {
      moved = Infinity;
      last.time = -Infinity;
    }
    target.touched();
  }, { signal });

  canvas.addEventListener("pointermove", (event) => {
    const finger = fingers.get(event.pointerId);
    if (!finger) return;
    const { clientX: x, clientY: y } = event;
    moved += Math.hypot(x - finger.x, y - finger.y);
    if (fingers.size === 1) drag(event, x - finger.x, y - finger.y);
    else pinch(event.pointerId, x, y);
    fingers.set(event.pointerId, { x, y });
  }, { signal });

  canvas.addEventListener("pointerup", lift, { signal });
  canvas.addEventListener("pointercancel", lift, { signal });

  canvas.addEventListener("wheel", (event) => {
    event.preventDefault();
    const lines = event.deltaMode === WheelEvent.DOM_DELTA_LINE;
    target.touched();
    target.zoom(Math.exp(-event.deltaY * (lines ? WHEEL_LINE_PX : 1) * WHEEL_PER_PX));
  }, { signal, passive: false });

  const keys: Record<string, () => void> = {
    ArrowLeft: () => target.turn(-KEY_TURN, 0),
    ArrowRight: () => target.turn(KEY_TURN, 0),
    ArrowUp: () => target.turn(0, -KEY_TURN),
    ArrowDown: () => target.turn(0, KEY_TURN),
    "+": () => target.zoom(KEY_ZOOM),
    "=": () => target.zoom(KEY_ZOOM),
    "-": () => target.zoom(1 / KEY_ZOOM),
    "0": () => target.reset(),
    Home: () => target.reset(),
  };
  canvas.addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.altKey || event.metaKey) return;
    const action = keys[event.key];
    if (!action) return;
    event.preventDefault();
    target.touched();
    action();
  }, { signal });
}
