/** A face or a mesh in WebGL: surface, dots and initial cloud, drawn from a view. */

import {
  type BufferGeometry, DataTexture, DoubleSide, Group, LinearFilter, Mesh, PerspectiveCamera, Points,
  Scene, ShaderMaterial, Vector2, WebGLRenderer,
} from "three";

import type { Mode } from "./flat.ts";
import { load, type Loaded, type Shape } from "./loaded.ts";
import type { View } from "./pose.ts";
import { dotFragment, dotVertex, screenVertex, surfaceFragment, surfaceVertex } from "./shaders.ts";
import { sigmaColor, sigmaPosition } from "./sigma_scale.ts";
import type { Surface } from "./surface.ts";

/** What is drawn of a face. */
export interface Shown {
  readonly view: View;
  readonly mode: Mode;
  /** Between true colours, 0, and those of sigma, 1. */
  readonly confidence: number;
  /** Part of the face's width, from the left, that is dense; the rest is the initial cloud. */
  readonly blend: number;
  /** Of the surface: 1 for every point, 2 for every second row and column. */
  readonly stride: number;
}

/** Of the camera's picture, top to bottom, degrees: a face is seen as from two thirds of a metre. */
const FIELD_OF_VIEW = 26;
/** Part of the canvas's height or width that a face takes. */
const SHARE = 0.88;
const NEAR_MM = 10;
const FAR_MM = 5000;
/** Least distance of the dots of the points view, pixels: fewer are no points but moire. */
const DOT_DISTANCE_PX = 5;
/** Diameter of a dot, as a part of the dots' distance. */
const DOT_SIZE = 0.75;
const SEED_SIZE = 0.85;
/** What hides the dots of the far side lies so far behind the surface, mm. */
const BEHIND_MM = 2;
const HANDLE_PX = 3;
/** How far the line between dense and initial cloud reaches, halves of a face. */
const BEYOND = 1.08;
const SCALE_COLORS = 256;

/** All that WebGL holds of one face, and how it is drawn. */
export class Stage {
  readonly renderer: WebGLRenderer;
  readonly #scene = new Scene();
  readonly #camera = new PerspectiveCamera(FIELD_OF_VIEW, 1, NEAR_MM, FAR_MM);
  readonly #turned = new Group();
  readonly #scale = scaleTexture();
  readonly #sigma = {
    scale: { value: this.#scale },
    sigmaCodes: { value: new Vector2(0, 1) },
    confidence: { value: 0 },
  };
  readonly #focal = { value: 1 };
  readonly #surfaceMaterial = new ShaderMaterial({
    vertexShader: surfaceVertex, fragmentShader: surfaceFragment, side: DoubleSide,
    transparent: true, premultipliedAlpha: true,
    uniforms: this.#sigma,
  });
  readonly #screenMaterial = new ShaderMaterial({
    vertexShader: screenVertex, fragmentShader: "void main() {}", side: DoubleSide,
    colorWrite: false, uniforms: { behind: { value: BEHIND_MM } },
  });
  readonly #dotMaterial = dotMaterial(this.#sigma, this.#focal, 1);
  readonly #seedMaterial = dotMaterial(
    { ...this.#sigma, confidence: { value: 0 } }, this.#focal, 0);
  readonly #mesh = new Mesh<BufferGeometry, ShaderMaterial>();
  readonly #points = new Points<BufferGeometry, ShaderMaterial>();
  #loaded: Loaded | null = null;
  #aspect = 1;

  constructor(canvas: HTMLCanvasElement, context: WebGL2RenderingContext) {
    this.renderer = new WebGLRenderer({ canvas, context });
    this.renderer.autoClear = false;
    this.#scene.add(this.#turned);
    this.#mesh.frustumCulled = this.#points.frustumCulled = false;
  }

  /** The whole canvas's size in CSS pixels and pixels for each of them. */
  resize(width: number, height: number, ratio: number): void {
    this.renderer.setPixelRatio(ratio);
    this.renderer.setSize(width, height, false);
    this.#aspect = width / height;
  }

  /** Takes another face or mesh, or none. */
  load(shape: Shape | null): void {
    this.#loaded?.dispose();
    this.#turned.clear();
    this.#loaded = null;
    if (!shape) return;
    this.#loaded = load(shape);
    const [low, high] = this.#loaded.sigmaMm;
    this.#sigma.sigmaCodes.value.set(sigmaPosition(low), sigmaPosition(high));
  }

  /** Leaves nothing on the canvas. */
  wipe(): void {
    this.renderer.setScissorTest(false);
    this.renderer.setClearColor(0, 0);
    this.renderer.clear();
  }

  /**
   * Draws.
   *
   * @returns where the initial cloud begins, as a part of the canvas's width; null where one of both
   * is shown alone.
   */
  draw(shown: Shown): number | null {
    const { renderer } = this;
    this.wipe();
    if (!this.#loaded) return null;
    this.#look(shown.view, this.#loaded.surface);
    // A mesh has neither: it stays as it is beside faces that show theirs.
    const { seeds } = this.#loaded;
    this.#sigma.confidence.value = seeds ? shown.confidence : 0;
    const at = seeds ? this.#split(shown, this.#loaded.surface) : 1;
    const { width, height } = renderer.getSize(new Vector2());
    if (at > 0) {
      this.#within(0, at * width, height);
      this.#drawDense(shown, this.#loaded);
    }
    if (seeds && at < 1) {
      this.#within(at * width, (1 - at) * width, height);
      this.#seedMaterial.uniforms["diameter"]!.value = SEED_SIZE * this.#loaded.spacingMm;
      this.#draw(this.#points, seeds, this.#seedMaterial);
    }
    if (at <= 0 || at >= 1) return null;
    const [bottom, top] = this.#faceHeight(shown, this.#loaded.surface);
    this.#within(at * width - HANDLE_PX / 2, HANDLE_PX, (top - bottom) * height, bottom * height);
    renderer.setClearColor(0xffffff, 0.9);
    renderer.clear();
    return at;
  }

  /** Which part of the face's half width and half height a CSS pixel is. */
  partsOfPixel(): [number, number] {
    if (!this.#loaded) return [0, 0];
    const [halfWidth, halfHeight] = this.#loaded.surface.halfSize;
    const pixel = this.#camera.position.z * this.renderer.getPixelRatio() / this.#focal.value;
    return [pixel / Math.max(1, halfWidth), pixel / Math.max(1, halfHeight)];
  }

  /** Gives everything back; the canvas is of no use any more. */
  dispose(): void {
    this.load(null);
    this.#scale.dispose();
    for (const material of [this.#surfaceMaterial, this.#screenMaterial, this.#dotMaterial,
      this.#seedMaterial]) {
      material.dispose();
    }
    this.renderer.dispose();
    this.renderer.forceContextLoss();
  }

  #drawDense({ mode, stride }: Shown, loaded: Loaded): void {
    if (mode !== "points" && loaded.meshed) {
      this.#draw(this.#mesh, loaded.mesh(stride), this.#surfaceMaterial);
      return;
    }
    const { stepMm, surface } = loaded;
    const distance = this.#camera.position.z - surface.halfSize[2];
    const pixels = stepMm * this.#focal.value / distance;
    const every = Math.max(1, Math.round(DOT_DISTANCE_PX / pixels));
    this.#dotMaterial.uniforms["diameter"]!.value = DOT_SIZE * every * stepMm;
    if (loaded.meshed) {
      this.#draw(this.#mesh, loaded.mesh(Math.max(2, stride)), this.#screenMaterial);
    }
    this.#draw(this.#points, loaded.dots(every), this.#dotMaterial);
  }

  #draw(
    object: Mesh<BufferGeometry, ShaderMaterial> | Points<BufferGeometry, ShaderMaterial>,
    geometry: BufferGeometry, material: ShaderMaterial,
  ): void {
    object.geometry = geometry;
    object.material = material;
    this.#turned.add(object);
    this.renderer.render(this.#scene, this.#camera);
    this.#turned.remove(object);
  }

  #look(view: View, { halfSize: [halfWidth, halfHeight, halfDepth] }: Surface): void {
    const camera = this.#camera;
    const tangent = Math.tan(FIELD_OF_VIEW / 2 * Math.PI / 180);
    // Turned to the side a face is as wide as it is deep and wide together.
    const radius = Math.hypot(halfWidth, halfDepth);
    const fit = Math.max(halfHeight, radius / this.#aspect, 1) / tangent / SHARE;
    camera.aspect = this.#aspect;
    camera.zoom = view.zoom;
    camera.position.set(-view.panX * halfWidth, view.panY * halfHeight, fit + halfDepth);
    // Of a room or a coin, too.
    camera.near = Math.min(NEAR_MM, fit / 20);
    camera.far = Math.max(FAR_MM, 4 * (fit + halfDepth));
    camera.updateProjectionMatrix();
    this.#turned.rotation.set(view.pitch * Math.PI / 180, view.yaw * Math.PI / 180, 0);
    const { height } = this.renderer.getDrawingBufferSize(new Vector2());
    this.#focal.value = camera.projectionMatrix.elements[5]! * height / 2;
  }

  /** Where the initial cloud begins, as a part of the canvas's width: along the face. */
  #split({ blend, view }: Shown, { halfSize: [halfWidth, , halfDepth] }: Surface): number {
    if (blend <= 0 || blend >= 1) return blend <= 0 ? 0 : 1;
    const across = this.#camera.projectionMatrix.elements[0]! / this.#camera.position.z / 2;
    const reach = BEYOND * Math.hypot(halfWidth, halfDepth) * across;
    const middle = 0.5 + view.panX * halfWidth * across;
    return Math.min(0.999, Math.max(0.001, middle + (2 * blend - 1) * reach));
  }

  /** Where the face's lower and upper end are, a little beyond it, as parts of the canvas's height. */
  #faceHeight({ view }: Shown, { halfSize: [, halfHeight] }: Surface): [number, number] {
    const half = halfHeight * this.#camera.projectionMatrix.elements[5]! / this.#camera.position.z / 2;
    const middle = 0.5 - view.panY * half;
    return [Math.max(0, middle - BEYOND * half), Math.min(1, middle + BEYOND * half)];
  }

  #within(left: number, width: number, height: number, bottom = 0): void {
    this.renderer.setScissorTest(true);
    this.renderer.setScissor(left, bottom, width, height);
  }
}

function dotMaterial(
  sigma: Record<string, { value: unknown }>, focal: { value: number }, shaded: number,
): ShaderMaterial {
  return new ShaderMaterial({
    vertexShader: dotVertex, fragmentShader: dotFragment, transparent: true,
    premultipliedAlpha: true,
    uniforms: { ...sigma, focal, diameter: { value: 1 }, shaded: { value: shaded } },
  });
}

function scaleTexture(): DataTexture {
  const pixels = new Uint8Array(4 * SCALE_COLORS);
  for (let at = 0; at < SCALE_COLORS; at++) {
    pixels.set([...sigmaColor(at / (SCALE_COLORS - 1)), 255], 4 * at);
  }
  const texture = new DataTexture(pixels, SCALE_COLORS, 1);
  texture.minFilter = texture.magFilter = LinearFilter;
  texture.needsUpdate = true;
  return texture;
}
