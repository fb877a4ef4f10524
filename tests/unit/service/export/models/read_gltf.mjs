// Reads .glb files as others do, and says what it found as JSON: Khronos's validator, and three.js
// with meshoptimizer's decoder; of .json, the packed streams by that decoder alone. Arguments: the
// folder of the packages, then the files.
import { readFileSync } from "node:fs";
import { pathToFileURL } from "node:url";

const [packages, ...files] = process.argv.slice(2);
const load = (name) => import(pathToFileURL(`${packages}/${name}`).href);
const validator = (await load("gltf-validator/index.js")).default;
const three = await load("three/build/three.module.js");
const { GLTFLoader } = await load("three/examples/jsm/loaders/GLTFLoader.js");
const { OBJLoader } = await load("three/examples/jsm/loaders/OBJLoader.js");
const { STLLoader } = await load("three/examples/jsm/loaders/STLLoader.js");
const { PLYLoader } = await load("three/examples/jsm/loaders/PLYLoader.js");
const { PCDLoader } = await load("three/examples/jsm/loaders/PCDLoader.js");
const { MeshoptDecoder } = await load("meshoptimizer/meshopt_decoder.mjs");

/** Give a mesh's arrays as a viewer draws them, placed by its node; of a large one its size. */
function arrays(mesh) {
  mesh.updateMatrixWorld(true);
  const { geometry, material } = mesh;
  const { position } = geometry.attributes;
  if (position.count > 10000) {
    const box = new three.Box3().setFromObject(mesh);
    return { points: position.count, corners: geometry.index.count,
      size: box.getSize(new three.Vector3()).toArray() };
  }
  const told = { index: geometry.index ? Array.from(geometry.index.array) : null };
  const turn = new three.Matrix3().getNormalMatrix(mesh.matrixWorld);
  for (const [name, attribute] of Object.entries(geometry.attributes)) {
    const rows = [];
    const one = new three.Vector3();
    for (let i = 0; i < attribute.count; i++) {
      one.fromBufferAttribute(attribute, i);
      if (name === "position") one.applyMatrix4(mesh.matrixWorld);
      if (name === "normal") one.applyMatrix3(turn).normalize();
      if (name === "uv" && material.map) {
        const { offset, repeat } = material.map;
        one.set(one.x * repeat.x + offset.x, one.y * repeat.y + offset.y, 0);
      }
      rows.push(one.toArray().slice(0, attribute.itemSize === 2 ? 2 : 3));
    }
    told[name] = rows;
  }
  return told;
}

/** three.js has no images under node: a texture is its place alone, and the bytes of its file. */
class Textures {
  name = "textures";
  constructor(parser) {
    this.parser = parser;
  }
  async loadTexture(index) {
    const { json } = this.parser;
    const image = json.images[json.textures[index].source];
    const bytes = await this.parser.getDependency("bufferView", image.bufferView);
    const texture = new three.Texture();
    texture.userData = { image: Buffer.from(bytes).toString("base64") };
    return texture;
  }
}

async function glb(data) {
  const report = await validator.validateBytes(new Uint8Array(data), { maxIssues: 100 });
  const loader = new GLTFLoader().setMeshoptDecoder(MeshoptDecoder);
  loader.register((parser) => new Textures(parser));
  const buffer = data.buffer.slice(data.byteOffset, data.byteOffset + data.length);
  const { scene, asset } = await loader.parseAsync(buffer, "");
  const meshes = [];
  scene.traverse((one) => one.isMesh && meshes.push(one));
  const map = meshes[0].material.map;
  return {
    ...arrays(meshes[0]), meshes: meshes.length, asset, issues: report.issues.messages,
    info: report.info, image: map?.userData.image ?? null, map: map && map.colorSpace,
    vertexColors: meshes[0].material.vertexColors,
  };
}

const READERS = {
  glb,
  obj: (data) => {
    const mesh = new OBJLoader().parse(data.toString("utf8"));
    return { ...arrays(mesh.children[0]), libraries: mesh.materialLibraries };
  },
  stl: (data) => arrays(new three.Mesh(new STLLoader().parse(cut(data)))),
  ply: (data) => arrays(new three.Points(new PLYLoader().parse(cut(data)))),
  json: (data) => JSON.parse(data).map(({ mode, count, stride, filter, coded }) => {
    const target = new Uint8Array(count * stride);
    const source = new Uint8Array(Buffer.from(coded, "base64"));
    MeshoptDecoder.decodeGltfBuffer(target, count, stride, source, mode, filter);
    return Buffer.from(target).toString("base64");
  }),
  pcd: (data) => arrays(new PCDLoader().parse(cut(data))),
};
const cut = (data) => data.buffer.slice(data.byteOffset, data.byteOffset + data.length);

await MeshoptDecoder.ready;
const told = {};
for (const file of files) {
  told[file] = await READERS[file.split(".").at(-1)](readFileSync(file));
}
process.stdout.write(JSON.stringify(told));
