// In the page: illuminance by three.js' own loader, lights, materials and shaders. A meter is a white patch of diffuse material of which one
// pixel is drawn: it is pi times its radiance. Every luminaire is drawn by itself.
import * as THREE from "/package/build/three.webgpu.js";
import { IESLoader } from "/package/examples/jsm/loaders/IESLoader.js";

const PATCH_M = 2e-3, AWAY_M = 0.1, PIXEL_M = 2e-5, ROW = 1024;

window.illuminance = async (job) => {
  const renderer = new THREE.WebGPURenderer({ forceWebGL: true, antialias: false });
  renderer.toneMapping = THREE.NoToneMapping;
  renderer.autoClear = false;
  await renderer.init();
  const camera = new THREE.OrthographicCamera(-PIXEL_M / 2, PIXEL_M / 2, PIXEL_M / 2, -PIXEL_M / 2, AWAY_M / 10, 10 * AWAY_M);
  const z = new THREE.Vector3(0, 0, 1), at = new THREE.Vector3(), normal = new THREE.Vector3();
  const lux = job.meters.map(() => 0);
  for (const lamp of job.lamps) {
    const scene = new THREE.Scene();
    const loader = new IESLoader();
    if (job.texture === "float") loader.type = THREE.FloatType;
    const light = new THREE.IESSpotLight(0xffffff, lamp.candela);
    light.iesMap = await loader.loadAsync(`/${lamp.file}`);
    light.position.fromArray(lamp.position);
    light.target.position.fromArray(lamp.position.map((p, k) => p - lamp.axes[2][k]));
    // C 0 lies to the left of what the light's camera sees.
    light.shadow.camera.up.fromArray(lamp.axes[1].map((y) => -y));
    const patch = new THREE.Mesh(new THREE.PlaneGeometry(PATCH_M, PATCH_M), new THREE.MeshLambertNodeMaterial({ color: 0xffffff }));
    scene.add(light, light.target, patch);
    for (let first = 0; first < lux.length; first += ROW) {
      const row = job.meters.slice(first, first + ROW);
      const target = new THREE.RenderTarget(row.length, 1, { type: THREE.FloatType, depthBuffer: false });
      target.scissorTest = true;
      renderer.setRenderTarget(target);
      for (const [k, meter] of row.entries()) {
        at.fromArray(meter.position);
        normal.fromArray(meter.normal);
        patch.position.copy(at);
        patch.quaternion.setFromUnitVectors(z, normal);
        camera.position.copy(at).addScaledVector(normal, AWAY_M);
        camera.quaternion.copy(patch.quaternion);
        target.viewport.set(k, 0, 1, 1);
        target.scissor.set(k, 0, 1, 1);
        await renderer.render(scene, camera);
      }
      const pixels = await renderer.readRenderTargetPixelsAsync(target, 0, 0, row.length, 1);
      for (const k of row.keys()) lux[first + k] += pixels[4 * k + 3] === 1 ? Math.PI * pixels[4 * k] : NaN;
      target.dispose();
    }
  }
  const backend = renderer.backend.constructor.name;
  renderer.dispose();
  return { lux, version: THREE.REVISION, backend };
};
