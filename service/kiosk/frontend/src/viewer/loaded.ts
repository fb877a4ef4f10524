/** What WebGL holds of a face, or of a mesh. */

import { BufferAttribute, BufferGeometry } from "three";

import type { FaceGrid } from "../face_grid.ts";
import { type Mesh, thinnedMesh, toMeshSurface } from "./mesh.ts";
import { thinned, toSurface, triangulate, type Surface } from "./surface.ts";

/** What can be shown. */
export type Shape = FaceGrid | Mesh;

/** Whether a shape is a mesh, which has no initial cloud and no sigma. */
export function isMesh(shape: Shape): shape is Mesh {
  return "triangles" in shape;
}

/** Makes the buffers of a shape. */
export function load(shape: Shape): Loaded {
  return new Loaded(isMesh(shape) ? ofMesh(shape) : ofFace(shape));
}

function ofFace(face: FaceGrid): Parts {
  const surface = toSurface(face);
  return {
    surface, tints: face.colors, sigmaMm: face.sigmaMm, stepMm: face.stepMm,
    spacingMm: face.spacingMm, seeds: toSeeds(face, surface), meshed: true,
    triangles: (stride) => triangulate(face, stride), points: (stride) => thinned(face, stride),
  };
}

function ofMesh(mesh: Mesh): Parts {
  return {
    surface: toMeshSurface(mesh), tints: mesh.tints, sigmaMm: [1, 1], stepMm: mesh.stepMm,
    spacingMm: mesh.stepMm, seeds: null, meshed: mesh.triangles.length > 0,
    triangles: () => mesh.triangles, points: (stride) => thinnedMesh(mesh, stride),
  };
}

/** What is known of a shape besides its vertices. */
interface Parts {
  readonly surface: Surface;
  /** (points * 4): sRGB and code of sigma. */
  readonly tints: Uint8Array;
  /** Sigma of codes 0 and 255, mm. */
  readonly sigmaMm: readonly [number, number];
  /** Distance of neighbouring points, mm. */
  readonly stepMm: number;
  /** That of the initial cloud, mm. */
  readonly spacingMm: number;
  /** The initial cloud; null where there is none. */
  readonly seeds: BufferGeometry | null;
  /** Whether there are triangles. */
  readonly meshed: boolean;
  /** Triangles, and points, of which a stride thins out the rows and columns. */
  readonly triangles: (stride: number) => Uint32Array;
  readonly points: (stride: number) => Uint32Array;
}

/** The buffers of one shape; what is coarser shares the vertices. */
export class Loaded {
  readonly surface: Surface;
  readonly seeds: BufferGeometry | null;
  readonly sigmaMm: readonly [number, number];
  readonly stepMm: number;
  readonly spacingMm: number;
  readonly meshed: boolean;
  readonly #parts: Parts;
  readonly #attributes: Record<string, BufferAttribute>;
  readonly #meshes = new Map<number, BufferGeometry>();
  readonly #dots = new Map<number, BufferGeometry>();

  constructor(parts: Parts) {
    this.#parts = parts;
    ({ surface: this.surface, seeds: this.seeds, sigmaMm: this.sigmaMm, stepMm: this.stepMm,
      spacingMm: this.spacingMm, meshed: this.meshed } = parts);
    this.#attributes = {
      position: new BufferAttribute(this.surface.positions, 3),
      bearing: new BufferAttribute(this.surface.normals, 4, true),
      tint: new BufferAttribute(parts.tints, 4, true),
    };
  }

  /** The triangles of every `stride`-th row and column. */
  mesh(stride: number): BufferGeometry {
    return this.#kept(this.#meshes, stride, this.#parts.triangles);
  }

  /** The points of every `stride`-th row and column. */
  dots(stride: number): BufferGeometry {
    return this.#kept(this.#dots, stride, this.#parts.points);
  }

  dispose(): void {
    for (const geometry of [...this.#meshes.values(), ...this.#dots.values()]) geometry.dispose();
    this.seeds?.dispose();
  }

  #kept(
    all: Map<number, BufferGeometry>, stride: number, make: (stride: number) => Uint32Array,
  ): BufferGeometry {
    let geometry = all.get(stride);
    if (!geometry) {
      geometry = new BufferGeometry();
      for (const [name, attribute] of Object.entries(this.#attributes)) {
        geometry.setAttribute(name, attribute);
      }
      geometry.setIndex(new BufferAttribute(make(stride), 1));
      all.set(stride, geometry);
    }
    return geometry;
  }
}

function toSeeds({ seeds }: FaceGrid, { origin: [x, y, z] }: Surface): BufferGeometry {
  const positions = new Float32Array(3 * seeds.points);
  const tints = new Uint8Array(4 * seeds.points);
  const bearings = new Int8Array(4 * seeds.points);
  for (let point = 0; point < seeds.points; point++) {
    positions[3 * point] = seeds.positions[3 * point]! - x;
    positions[3 * point + 1] = y - seeds.positions[3 * point + 1]!;
    positions[3 * point + 2] = z - seeds.positions[3 * point + 2]!;
    tints.set(seeds.colors.subarray(3 * point, 3 * point + 3), 4 * point);
    bearings[4 * point + 2] = 127;
  }
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(positions, 3));
  geometry.setAttribute("bearing", new BufferAttribute(bearings, 4, true));
  geometry.setAttribute("tint", new BufferAttribute(tints, 4, true));
  return geometry;
}
