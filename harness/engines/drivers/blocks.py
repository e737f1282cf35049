"""What drivers share: the readings of a job (JSON) as JSON on standard output, in blocks of samples.

Every block has a seed of its own; the standard error is that of the mean of the blocks. By itself a driver reads as many blocks as the
job says. With --serve it is told lines on standard input, and answers each with one: {"job": PATH, "threads": N} with what there is to
read, {"part": ..., "side": m, "seeds": [...]} with one block of m x m samples a meter for every seed, so that luxproof can stop when the
blocks' spread is small enough. Jobs may follow one another.
"""

import argparse
import gc
import json
import os
import sys

import numpy as np


def main(description, instrument, more=None):
    """Answers the command line: `instrument` makes an Instrument of the job, its folder and the options, to which `more` adds."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("job", nargs="?", help="the job, a JSON file beside its scene")
    parser.add_argument("--serve", action="store_true", help="read what standard input asks for")
    parser.add_argument("--threads", type=int, default=os.cpu_count(), help="worker threads; no result depends on them")
    if more:
        more(parser)
    options = parser.parse_args()
    if options.serve == bool(options.job):
        parser.error("give a job, or --serve")
    # The renderer's messages must not mix with the answer.
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    for line in served(instrument, options) if options.serve else [begun(instrument, options).by_itself()]:
        print(json.dumps(line, allow_nan=False), file=answer, flush=True)


def begun(instrument, options):
    with open(options.job, encoding="utf-8") as file:
        job = json.load(file)
    return instrument(job, os.path.dirname(os.path.abspath(options.job)), options)


def served(instrument, options):
    read = None
    for request in map(json.loads, sys.stdin):
        if "job" in request:
            read = None  # before the next is made, so that there is memory for one alone
            gc.collect()  # its parts lead back to it
            options.job, options.threads = request["job"], request["threads"]
            read = begun(instrument, options)
            yield read.about()
        else:
            yield read.blocks(request["part"], request["side"], request["seeds"]).tolist()


def one_by_one(block):
    """A function from (m, seed) to a block, seed by seed."""
    return lambda m, seeds: [block(m, seed) for seed in seeds]


class Instrument:
    """The parts of a job's light: for each a function from (m, seeds) to a block a seed, and the rays of a block with m = 1."""

    lanes = 1 << 17  # rays in flight
    normals_off = []  # how far each meter's unit normal is from that which it should have, where the renderer rounds it more than its numbers

    def __init__(self, job, versions, variant):
        self.job, self.versions, self.variant, self.parts = job, versions, variant, {}
        self.sensors = [s["id"] for s in job["sensors"]]

    def is_sampled(self, part):
        raise NotImplementedError

    def blocks(self, part, m, seeds):
        """Blocks by meters."""
        found = np.asarray(self.parts[part][0](m, seeds), np.float64)
        bad = [name for name, finite in zip(self.sensors, np.isfinite(found).all(0)) if not finite]
        if bad:
            raise RuntimeError(f"illuminance is not finite at {', '.join(bad)}")
        return found

    def about(self):
        parts = [{"name": p, "rays": self.parts[p][1], "sampled": self.is_sampled(p)} for p in self.parts]
        about = {"versions": self.versions, "variant": self.variant}
        return {**about, "lanes": self.lanes, "sensors": self.sensors, "normals_off": self.normals_off, "parts": parts}

    def by_itself(self):
        value, variance = np.zeros(len(self.sensors)), np.zeros(len(self.sensors))
        for k, part in enumerate(self.parts):
            if not self.is_sampled(part):
                value += self.blocks(part, 1, [None])[0]
                continue
            seeds = [(self.job["seed"], k, b) for b in range(self.job["blocks"])]
            blocks = self.blocks(part, self.job["side"], seeds)
            value += blocks.mean(0)
            variance += blocks.var(0, ddof=1) / len(blocks)
        rows = zip(self.sensors, value.tolist(), np.sqrt(variance).tolist())
        readings = [{"id": name, "value": lux, "std_error": error} for name, lux, error in rows]
        return {"versions": self.versions, "variant": self.variant, "readings": readings}
