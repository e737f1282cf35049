// In the page: illuminance by Babylon.js' own texture loader, lights, materials and shaders. A meter is a white patch of diffuse material of
// which one pixel is drawn: it is pi times its radiance. Every luminaire is drawn by itself, as bright as one candela: beyond 30 colours are
// cut off.
import { Engine } from "/package/Engines/engine.js";
import { Constants } from "/package/Engines/constants.js";
import { Scene } from "/package/scene.js";
import { Vector3, Quaternion } from "/package/Maths/math.vector.js";
import { Color3, Color4 } from "/package/Maths/math.color.js";
import { Light } from "/package/Lights/light.js";
import { SpotLight } from "/package/Lights/spotLight.js";
import { Camera } from "/package/Cameras/camera.js";
import { TargetCamera } from "/package/Cameras/targetCamera.js";
import { PBRMaterial } from "/package/Materials/PBR/pbrMaterial.js";
import { CreatePlane } from "/package/Meshes/Builders/planeBuilder.js";
import { Texture } from "/package/Materials/Textures/texture.js";
import { RenderTargetTexture } from "/package/Materials/Textures/renderTargetTexture.js";
import "/package/Materials/Textures/Loaders/index.js";

const PATCH_M = 2e-3, AWAY_M = 0.1, PIXEL_M = 2e-5;

window.illuminance = async (job) => {
  const engine = new Engine(document.createElement("canvas"), false);
  const lux = job.meters.map(() => 0);
  for (const lamp of job.lamps) {
    const scene = new Scene(engine);
    scene.useRightHandedSystem = true;
    scene.imageProcessingConfiguration.applyByPostProcess = true;
    const white = new PBRMaterial("white", scene);
    Object.assign(white, { metallic: 0, roughness: 1, albedoColor: Color3.White(), metallicF0Factor: 0, backFaceCulling: false, usePhysicalLightFalloff: true });
    white.brdf.baseDiffuseModel = Constants.MATERIAL_DIFFUSE_MODEL_LAMBERT;
    const patch = CreatePlane("patch", { size: PATCH_M }, scene);
    patch.material = white;
    patch.rotationQuaternion = new Quaternion();
    const own = Vector3.FromArray(patch.getVerticesData("normal"));
    const down = Vector3.FromArray(lamp.axes[2].map((z) => -z));
    const light = new SpotLight("lamp", Vector3.FromArray(lamp.position), down, Math.PI, 1, scene);
    Object.assign(light, { intensityMode: Light.INTENSITYMODE_LUMINOUSINTENSITY, intensity: 1, specular: Color3.Black() });
    light.iesProfileTexture = await new Promise((ready, failed) => {
      const texture = new Texture(`/${lamp.file}`, scene, { onLoad: () => ready(texture), onError: (what) => failed(new Error(what)) });
    });
    const camera = new TargetCamera("camera", Vector3.Zero(), scene);
    const half = PIXEL_M / 2;
    Object.assign(camera, { mode: Camera.ORTHOGRAPHIC_CAMERA, orthoLeft: -half, orthoRight: half, orthoBottom: -half, orthoTop: half, minZ: AWAY_M / 10, maxZ: 10 * AWAY_M });
    scene.activeCamera = camera;
    const target = new RenderTargetTexture("pixel", 1, scene, { generateMipMaps: false, type: Constants.TEXTURETYPE_FLOAT });
    Object.assign(target, { renderList: [patch], activeCamera: camera, clearColor: new Color4(0, 0, 0, 0) });
    for (const [k, meter] of job.meters.entries()) {
      const at = Vector3.FromArray(meter.position), normal = Vector3.FromArray(meter.normal);
      patch.position.copyFrom(at);
      Quaternion.FromUnitVectorsToRef(own, normal, patch.rotationQuaternion);
      patch.computeWorldMatrix(true);
      camera.position.copyFrom(at.add(normal.scale(AWAY_M)));
      camera.upVector = Math.abs(normal.z) < 0.9 ? new Vector3(0, 0, 1) : new Vector3(0, 1, 0);
      camera.setTarget(at);
      camera.getViewMatrix(true);
      camera.getProjectionMatrix(true);
      if (k === 0) await scene.whenReadyAsync();
      target.render();
      const pixel = await target.readPixels(0, 0, null, true, false, 0, 0, 1, 1);
      lux[k] += pixel[3] === 1 ? Math.PI * lamp.candela * pixel[0] : NaN;
    }
    scene.dispose();
  }
  const backend = `WebGL ${engine.webGLVersion}`;
  engine.dispose();
  return { lux, version: Engine.Version, backend };
};
