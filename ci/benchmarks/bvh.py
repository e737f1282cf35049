"""Casts the same rays with our tree and with Embree, by turns, and prints the table of benchmarks/bvh.md.

bvh.py PROGRAM FOLDER ROUNDS TRIANGLES...: PROGRAM is the example `bvh_and_embree`, which makes rooms and rays in FOLDER and casts ours.
"""

import os
import subprocess
import sys
import time

import numpy
from embreex.mesh_construction import TriangleMesh
from embreex.rtcore import EmbreeDevice
from embreex.rtcore_scene import EmbreeScene

program, folder, rounds, *sizes = sys.argv[1:]
ours = subprocess.Popen([program, folder, *sizes], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
triangles = [int(ours.stdout.readline()) for _ in sizes]
assert ours.stdout.readline() == "ready\n"


def load(name, kind, columns):
    return numpy.fromfile(f"{folder}/{name}", kind).reshape(-1, columns)


def ask(line):
    ours.stdin.write(line + "\n")
    ours.stdin.flush()
    return float(ours.stdout.readline())


def embree_seconds(scene, rays, question):
    """Seconds of this thread and the answers: a distance, or whether anything lies within the reach."""
    origins, directions, reach = (numpy.ascontiguousarray(part) for part in numpy.split(rays, (3, 6), axis=1))
    reach = reach.reshape(-1).copy()
    began = time.thread_time()
    if question == "closest":
        answers = scene.run(origins, directions, query="DISTANCE")
    else:
        answers = scene.run(origins, directions, reach, query="OCCLUDED") != -1
    return time.thread_time() - began, answers


device = EmbreeDevice()


def embree(corners, robust):
    scene = EmbreeScene(device, robust=robust)
    TriangleMesh(scene, corners)
    return scene


rays = {kind: load(kind, numpy.float32, 7) for kind in ("coherent", "incoherent")}
count = len(rays["coherent"])
afar = embree(numpy.full((1, 3, 3), 1e6, numpy.float32) + numpy.eye(3, dtype=numpy.float32), False)
embree_seconds(afar, rays["coherent"][:1], "closest")
idle = min(embree_seconds(afar, rays["incoherent"], "closest")[0] for _ in range(int(rounds)))
load_average = os.getloadavg()[0]
print("| triangles | rays | question | Embree, Mrays/s | Embree, robust | ours | ours / Embree | ours / robust |")
print("|---|---|---|---|---|---|---|---|")
for size, have in zip(sizes, triangles):
    corners = load(f"{size}.vertices", numpy.float32, 3)[load(f"{size}.faces", numpy.int32, 3)]
    scenes = [embree(corners, robust) for robust in (False, True)]
    for scene in scenes:
        embree_seconds(scene, rays["coherent"][:1], "closest")
    for question in ("closest", "occluded"):
        for kind in rays:
            best = [float("inf")] * 3
            for _ in range(int(rounds)):
                for k, scene in enumerate(scenes):
                    seconds, answers = embree_seconds(scene, rays[kind], question)
                    best[k] = min(best[k], seconds)
                best[2] = min(best[2], ask(f"{question} {size} {kind}"))
            found = load("ours", numpy.float32, 1).reshape(-1)
            if question == "closest":
                differing = numpy.count_nonzero(abs(found - answers) > 1e-5 * numpy.maximum(1, answers))
            else:
                differing = numpy.count_nonzero((found != 0) != answers)
            assert differing <= 1e-5 * count, f"{differing} of {count} answers differ"
            plain, robust, own = (1e-6 * count / seconds for seconds in best)
            print(f"| {have} | {kind} | {question} | {plain:.1f} | {robust:.1f} | {own:.1f} | {own / plain:.2f} | {own / robust:.2f} |", flush=True)
print(f"\nA ray that meets nothing takes embreex and Embree {1e9 * idle / count:.0f} ns; load average {load_average:.1f}.")
