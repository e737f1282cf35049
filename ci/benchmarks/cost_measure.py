"""Runs random rooms and notes processor seconds: `cost_measure.py PROGRAM ENGINE FIRST COUNT OUT.jsonl`.

Each room is read by one engine beside our own two, whose seconds, read alone before, are taken off."""
import json, os, re, resource, shutil, subprocess, sys, tempfile

import rooms

program, engine, first, count, out = sys.argv[1], sys.argv[2], int(sys.argv[3]), int(sys.argv[4]), sys.argv[5]


def seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


with tempfile.TemporaryDirectory() as folder, open(out, "a") as found:
    for seed in range(first, first + count):
        spec = f"{folder}/room.yaml"
        with open(spec, "w") as f:
            f.write(rooms.spec(seed))
        row = {"seed": seed, "engine": engine}
        planned = subprocess.run([program, "check", spec, "--engines", engine], capture_output=True, text=True).stdout
        row["check"] = [line.strip() for line in planned.splitlines() if line.strip().startswith("run ")]
        for name in ["simulator"] + [engine] * (engine != "simulator"):
            before = seconds()
            done = subprocess.run([program, "run", spec, "--engines", name, "--no-cache", "--no-calibration", "--jobs", "1", "--out", f"{folder}/out", "--format", "json"], capture_output=True, text=True)
            row[f"cpu_{name}"] = seconds() - before
            report = json.loads(done.stdout or "{}")
            for recording in report.get("recordings", []):
                if recording["engine"] == name:
                    row[name] = {k: recording.get(k) for k in ("procedure", "work_s", "wall_s", "looks", "notes", "method", "effort", "failure", "approximation")}
            row[f"exit_{name}"] = done.returncode
            shutil.rmtree(f"{folder}/out", ignore_errors=True)
        found.write(json.dumps(row) + "\n")
        found.flush()
