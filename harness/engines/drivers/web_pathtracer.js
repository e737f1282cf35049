// In the page: illuminance by three-gpu-pathtracer's own lights, materials and path tracer, with the IES loader of three.js. A meter is a
// small white square, there only while it is read, of which some pixels are drawn: it is pi times their mean radiance.
//
// Direct light is read luminaire by luminaire, without chance. Reflected light is what paths bring beyond their first surface: a block
// draws the same paths twice, and the second time only as far as that, so that direct light cancels sample by sample.
import * as THREE from "three";
import { IESLoader } from "three/examples/jsm/loaders/IESLoader.js";
import { PhysicalSpotLight, WebGLPathTracer } from "three-gpu-pathtracer";

// Its shader starts rays so far off a surface, times one and the largest coordinate.
const OFFSET = 1e-4;
// Pixels along a side of an image; the paths of a block are spread over as many images as they need.
const PIXELS = 32;
// Its own limits, where nothing is set.
const STOCK_BOUNCES = 10, STOCK_TRANSMISSIVE_BOUNCES = 10;
// How random numbers are made: by a generator, a value each, or from a short list that all pixels share. That list has 20 rows, one for
// each surface of a path, so that longer paths read none of it.
const GENERATOR = 0, LIST = 2;
// As rough as leaves its diffuse reflection Lambert's to 1e-4: it grows with roughness toward grazing light.
const ROUGHNESS = 0.05;

// What it draws in JavaScript has a seed, too: mulberry32.
let randomState = 1;
Math.random = () => {
  randomState = (randomState + 0x6d2b79f5) | 0;
  let t = Math.imul(randomState ^ (randomState >>> 15), 1 | randomState);
  t = (t + Math.imul(t ^ (t >>> 7), 61 | t)) ^ t;
  return ((t ^ (t >>> 14)) >>> 0) / 4294967296;
};

/** A positive 31-bit number for a list of numbers (FNV-1a by bytes). */
function mixed(numbers) {
  let hash = 0x811c9dc5;
  for (const byte of new Uint8Array(new Float64Array(numbers).buffer)) hash = Math.imul(hash ^ byte, 0x01000193);
  return hash >>> 1;
}

function tracerOf(renderer) {
  const tracer = new WebGLPathTracer(renderer);
  // An image of the paths alone, at once.
  Object.assign(tracer, { renderDelay: 0, minSamples: 0, fadeDuration: 0, renderToCanvas: false, rasterizeScene: false });
  tracer.tiles.set(1, 1);
  return tracer;
}

/** A white or grey surface: Lambert's, or what a user gets who sets its color alone. */
function surfaceMaterial(reflectance, isStock) {
  const color = new THREE.Color(reflectance, reflectance, reflectance), side = THREE.DoubleSide;
  if (isStock) return new THREE.MeshStandardMaterial({ color, side });
  return new THREE.MeshPhysicalMaterial({ color, side, roughness: ROUGHNESS, ior: 1, specularIntensity: 0 });
}

function surfaceMesh({ reflectance, corners }, isStock) {
  const geometry = new THREE.BufferGeometry();
  geometry.setAttribute("position", new THREE.Float32BufferAttribute(corners.flat(2), 3));
  geometry.computeVertexNormals();
  return new THREE.Mesh(geometry, surfaceMaterial(reflectance, isStock));
}

async function spotLight(lamp, name) {
  const light = new PhysicalSpotLight(0xffffff, lamp.candela);
  light.iesMap = await new IESLoader().loadAsync(`/${lamp.file}`);
  light.position.fromArray(lamp.position);
  light.target.position.fromArray(lamp.position.map((p, k) => p - lamp.axes[2][k]));
  // The renderer sorts lights and tables by these, and keeps a table whose name it knows.
  light.uuid = light.iesMap.uuid = name;
  return light;
}

class Sampler {
  constructor() {
    this.renderer = new THREE.WebGLRenderer({ canvas: document.createElement("canvas"), antialias: false });
    this.renderer.setPixelRatio(1);
    this.tracer = tracerOf(this.renderer);
    this.camera = new THREE.OrthographicCamera();
    this.jobs = 0;
  }

  /** Compiles the path tracer's shader, which takes a minute by software, by drawing a small scene. */
  async warm(job) {
    await this.begin({
      ...job, transport: "direct", lamps: [], surfaces: [], patch: 1e-3,
      sensors: [{ id: "warm", position: [0, 0, 0], normal: [0, 0, 1], free: false }],
    });
    this.place(0);
    await this.radiance(1, 1, 1, 1);
    return { warm: true };
  }

  async begin(job) {
    this.job = job;
    this.scene = new THREE.Scene();
    this.scene.background = new THREE.Color(0, 0, 0);
    this.jobs += 1;
    this.lights = await Promise.all(job.lamps.map((lamp, k) => spotLight(lamp, `job ${this.jobs} lamp ${String(k).padStart(8, "0")}`)));
    for (const light of this.lights) this.scene.add(light, light.target);
    for (const surface of job.surfaces) this.scene.add(surfaceMesh(surface, job.stock));
    this.patch = new THREE.Mesh(new THREE.PlaneGeometry(job.patch, job.patch), surfaceMaterial(1, false));
    this.scene.add(this.patch);
    this.paths().setDefine("RANDOM_TYPE", job.stock ? LIST : GENERATOR);
    const meters = job.sensors.length, parts = [], isLit = this.lights.length > 0;
    if (isLit && job.transport !== "indirect") parts.push({ name: "direct", rays: meters * this.lights.length, sampled: false });
    if (isLit && job.transport !== "direct" && job.reflections > 0 && job.surfaces.length > 0) parts.push({ name: "indirect", rays: meters, sampled: true });
    const gl = this.renderer.getContext(), variant = gl.getParameter(gl.VERSION);
    const versions = { three_gpu_pathtracer: job.version, three: THREE.REVISION };
    return { versions, variant, lanes: 1 << 18, sensors: job.sensors.map(({ id }) => id), parts };
  }

  /** The material of the path tracer: it has the seed. */
  paths() {
    return this.tracer._pathTracer.material;
  }

  /** Blocks by meters. */
  async blocks({ part, side, seeds }) {
    const found = seeds.map(() => this.job.sensors.map(() => 0));
    for (const k of this.job.sensors.keys()) {
      this.place(k);
      for (const [block, seed] of seeds.entries()) {
        found[block][k] = Math.PI * (part === "direct" ? await this.direct() : await this.reflected(mixed([...seed, k]), side));
      }
    }
    return found;
  }

  /** Puts the square before the camera where rays from it start at the meter, or a hair before a surface that the meter is on. */
  place(k) {
    const { position, normal, free } = this.job.sensors[k], side = this.job.patch, half = side / 1000;
    const at = new THREE.Vector3().fromArray(position), up = new THREE.Vector3().fromArray(normal);
    const clear = OFFSET * (Math.max(...position.map(Math.abs)) + 1);
    this.patch.position.copy(at).addScaledVector(up, free ? -clear : side / 4);
    this.patch.quaternion.setFromUnitVectors(new THREE.Vector3(0, 0, 1), up);
    Object.assign(this.camera, { left: -half, right: half, bottom: -half, top: half, near: side / 8, far: 2 * side });
    this.camera.updateProjectionMatrix();
    this.camera.position.copy(this.patch.position).addScaledVector(up, side);
    this.camera.quaternion.copy(this.patch.quaternion);
    this.tracer.setScene(this.scene, this.camera);
  }

  /** One luminaire shines, or all. */
  shine(only) {
    for (const [k, light] of this.lights.entries()) light.visible = only === null || k === only;
    this.tracer.updateLights();
  }

  async direct() {
    let sum = 0;
    for (const k of this.lights.keys()) {
      this.shine(k);
      sum += await this.radiance(1, 1, 1, 1);
    }
    return sum;
  }

  async reflected(seed, side) {
    const pixels = Math.min(side, PIXELS), images = Math.ceil((side * side) / (pixels * pixels));
    const surfaces = this.job.reflections + 1;
    this.shine(null);
    const all = await this.radiance(seed, pixels, images, this.job.stock ? Math.min(surfaces, STOCK_BOUNCES) : surfaces);
    return all - (await this.radiance(seed, pixels, images, 1));
  }

  /** The mean of so many images of paths that end at so many surfaces. */
  async radiance(seed, pixels, images, surfaces) {
    this.renderer.setSize(pixels, pixels, false);
    // The list's size follows from their sum: the same numbers are drawn whatever the surfaces.
    Object.assign(this.tracer, { bounces: surfaces, transmissiveBounces: STOCK_BOUNCES + STOCK_TRANSMISSIVE_BOUNCES - Math.min(surfaces, STOCK_BOUNCES) });
    this.tracer.reset();
    randomState = seed | 0;
    const paths = this.paths();
    paths.seed = seed;
    paths.stratifiedTexture.sampler = null;
    do {
      this.tracer.renderSample();
      // Its program is compiled beside this one.
      if (this.tracer.samples < 1) await new Promise((ready) => setTimeout(ready, 1));
    } while (this.tracer.samples < images);
    const film = new Float32Array(4 * pixels * pixels);
    this.renderer.readRenderTargetPixels(this.tracer.target, 0, 0, pixels, pixels, film);
    return film.reduce((sum, value, k) => (k % 4 === 0 ? sum + value : sum), 0) / (pixels * pixels);
  }
}

window.sampler = new Sampler();
