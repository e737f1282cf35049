"""LuxCore alone: a panel whose material emits 0 is left alone in a scene from which a lit one was deleted."""
import sys
import time
import pyluxcore as lux

lux.Init()
lux.SetLogHandler(None)


def panel(name, z, emission):
    return (
        f"scene.materials.{name}.type = matte\nscene.materials.{name}.kd = 0 0 0\n"
        f"scene.materials.{name}.emission = {emission} {emission} {emission}\n"
        f"scene.objects.{name}.material = {name}\n"
        f"scene.objects.{name}.vertices = -1 -1 {z} 1 -1 {z} 1 1 {z} -1 1 {z}\n"
        f"scene.objects.{name}.faces = 0 1 2 0 2 3\n"
    )


def render(scene, strategy):
    config = lux.Properties()
    config.SetFromString(
        f"renderengine.type = PATHCPU\nsampler.type = SOBOL\nlightstrategy.type = {strategy}\n"
        "batch.haltspp = 4\nfilm.width = 8\nfilm.height = 8\n"
        "film.outputs.0.type = RGB\nfilm.outputs.0.filename = a.exr\nnative.threads.count = 1\n"
    )
    session = lux.RenderSession(lux.RenderConfig(config, scene))
    session.Start()
    while not session.HasDone():
        time.sleep(0.01)
        session.UpdateStats()
    session.Stop()
    print("rendered", flush=True)


scene, properties = lux.Scene(), lux.Properties()
camera = "scene.camera.lookat.orig = 0 0 0\nscene.camera.lookat.target = 0 0 1\nscene.camera.up = 0 1 0\n"
properties.SetFromString(camera + panel("lit", 2, 1) + panel("off", 3, 0))
scene.Parse(properties)
strategy = sys.argv[1]  # UNIFORM and POWER end here with SIGSEGV, LOG_POWER does not
render(scene, strategy)
scene.DeleteObject("lit")
render(scene, strategy)
