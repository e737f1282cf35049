"""Runs random rooms and notes processor seconds: `cost_measure.py PROGRAM ENGINES FIRST COUNT OUT.jsonl`, engines with commas.

Each room is read by our own two alone, and then by each engine beside them, whose seconds are taken off. At the end it says of how many rooms
`check` told the processor seconds within a factor of 3."""
import json, math, os, re, resource, shutil, subprocess, sys, tempfile

import rooms

program, engines, first, count, out = sys.argv[1], sys.argv[2].split(","), int(sys.argv[3]), int(sys.argv[4]), sys.argv[5]


def seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


with tempfile.TemporaryDirectory() as folder, open(out, "a") as found:
    for seed in range(first, first + count):
        spec = f"{folder}/room.yaml"
        with open(spec, "w") as f:
            f.write(rooms.spec(seed))
        row = {"seed": seed}
        planned = subprocess.run([program, "check", spec, "--engines", ",".join(engines)], capture_output=True, text=True).stdout
        row["check"] = [line.strip() for line in planned.splitlines() if line.strip().startswith("run ")]
        for name in ["simulator"] + [e for e in engines if e != "simulator"]:
            before = seconds()
            done = subprocess.run([program, "run", spec, "--engines", name, "--no-cache", "--no-calibration", "--jobs", "1", "--out", f"{folder}/out", "--format", "json"], capture_output=True, text=True)
            row[f"cpu_{name}"] = seconds() - before
            report = json.loads(done.stdout or "{}")
            for recording in report.get("recordings", []):
                if recording["engine"] == name:
                    row[name] = {k: recording.get(k) for k in ("procedure", "work_s", "wall_s", "stages", "notes", "method", "effort", "failure", "approximation")}
            row[f"exit_{name}"] = done.returncode
            shutil.rmtree(f"{folder}/out", ignore_errors=True)
        found.write(json.dumps(row) + "\n")
        found.flush()

told = {}
with open(out) as found:
    for row in map(json.loads, found):
        for name in engines:
            said = next((line for line in row["check"] if re.match(rf"run +{name} ", line)), "")
            about = re.search(r"about ([\d.]+) processor s|less than (1) processor s", said)
            if about and "at most" not in said and name in row and not row[name]["failure"]:
                seconds = row[f"cpu_{name}"] - (row["cpu_simulator"] if name != "simulator" else 0)
                procedure = row[name]["procedure"].removesuffix("_illuminance")
                # What is below a second is told to be no more.
                off = math.log(max(seconds, 1) / max(float(about[1] or 1), 1))
                told.setdefault((name, procedure), []).append(off)
for (name, procedure), off in sorted(told.items()):
    spread = ", ".join(f"{math.exp(x):.2f}" for x in sorted(off))
    print(f"{name} {procedure}: {sum(abs(x) <= math.log(3) for x in off)} of {len(off)} rooms within 3 times; times as long as told: {spread}")
