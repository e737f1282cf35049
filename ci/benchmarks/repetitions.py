"""Twenty seeded repetitions of case S1's reflected light on every renderer: are its standard errors honest, what is its bias?

    python3 ci/benchmarks/repetitions.py [--luxproof PATH] [--repetitions 20] [--seconds 30] [--relative-error 0.003] [ENGINE ...]

A repetition is one run of the audit preset with a seed of its own. At each of the four points of the work plane it is within
three of its standard errors of the exact value, or not; the mean over the repetitions shows a bias that no single one
resolves. Prints rows of the table in benchmarks/repetitions.md.
"""
import argparse
import json
import pathlib
import re
import statistics
import subprocess
import tempfile

ROOT = pathlib.Path(__file__).resolve().parents[2]
EXACT_LX = [0.94314714, 1.15551735, 1.15551735, 1.42062868]  # reference/analytic/values/s1.yaml


def arguments():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("engines", nargs="*", default=["mitsuba", "radiance", "povray"])
    parser.add_argument("--luxproof", default="luxproof")
    parser.add_argument("--repetitions", type=int, default=20)
    parser.add_argument("--seconds", type=float, default=30.0)
    parser.add_argument("--relative-error", type=float, default=0.003)
    parser.add_argument("--settings", default="{}", help="the engines' settings, JSON, e.g. '{\"count\": 50}'")
    return parser.parse_args()


def main():
    options = arguments()
    with tempfile.TemporaryDirectory() as folder:
        spec = pathlib.Path(folder) / "s1.yaml"
        text = (ROOT / "reference/analytic/s1.yaml").read_text()
        budget = f"budget: {{relative_error: {options.relative_error}, seconds: {options.seconds}}}"
        text = re.sub(r"budget: .*", budget, text)
        text = text.replace("../luminaires", str(ROOT / "reference/luminaires"))
        text = re.sub(r"published: .*\n", "", text)
        print("| engine | version | point | within 3 standard errors | within 3 and .5 % | mean deviation "
              "| its standard error | standard error of one | seconds |\n|---|---|---|---|---|---|---|---|---|")
        for engine in options.engines:
            spec.write_text(f"{text}engines: {{{engine}: {options.settings}}}\n")
            runs = [run(options.luxproof, engine, seed, spec, folder) for seed in range(1, options.repetitions + 1)]
            for k, exact in enumerate(EXACT_LX):
                print(row(engine, k, exact, runs), flush=True)


def run(luxproof, engine, seed, spec, folder):
    """One repetition: the engine's recording and its readings."""
    command = [luxproof, "run", str(spec), "--engines", engine, "--procedures", "indirect_illuminance",
               "--seed", str(seed), "--out", f"{folder}/out", "--format", "json"]
    # A deviation is what is looked for here: the exit code does not matter, a failed engine has no readings.
    report = json.loads(subprocess.run(command, stdout=subprocess.PIPE, check=False).stdout)
    recording = next(r for r in report["recordings"] if r["engine"] == engine)
    if recording["failure"]:
        raise SystemExit(f"{engine}, seed {seed}: {recording['failure']}")
    return recording, [r for r in report["readings"] if r["engine"] == engine]


def row(engine, k, exact, runs):
    readings = [readings[k] for _, readings in runs]
    off = [r["value"] / exact - 1 for r in readings]
    errors = [r["std_error"] / exact for r in readings]
    within = sum(abs(d) <= 3 * e for d, e in zip(off, errors))
    with_bias = sum(abs(d) <= 3 * e + 0.005 for d, e in zip(off, errors))
    mean_error = statistics.stdev(off) / len(off) ** 0.5
    seconds = statistics.mean(recording["wall_s"] for recording, _ in runs)
    cells = [engine, runs[0][0]["version"], f"workplane[{k}]", f"{within} of {len(runs)}",
             f"{with_bias} of {len(runs)}",
             f"{100 * statistics.mean(off):+.3f} %", f"{100 * mean_error:.3f} %",
             f"{100 * statistics.mean(errors):.3f} %", f"{seconds:.1f}"]
    return "| " + " | ".join(cells) + " |"


main()
