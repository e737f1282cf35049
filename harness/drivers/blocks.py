"""What drivers share: the readings of a job (JSON) as JSON on standard output, in blocks of samples.

Every block has a seed of its own; the standard error is that of the mean of the blocks. By itself a driver reads as many blocks as the
job says. With --serve it says what there is to read, and then answers each line of standard input, {"part": ..., "side": m,
"seeds": [...]}, with one block of m x m samples a meter for every seed, so that luxproof can stop when the blocks' spread is small enough.
"""

import argparse
import json
import math
import os
import sys

import numpy as np


def main(description, instrument, more=None):
    """Answers the command line: `instrument` makes an Instrument of the job, its folder and the options, to which `more` adds."""
    parser = argparse.ArgumentParser(description=description)
    parser.add_argument("job", help="the job, a JSON file beside its scene")
    parser.add_argument("--serve", action="store_true", help="read blocks as standard input asks for them")
    parser.add_argument("--threads", type=int, default=os.cpu_count(), help="worker threads; no result depends on them")
    if more:
        more(parser)
    options = parser.parse_args()
    # The renderer's messages must not mix with the answer.
    answer = os.fdopen(os.dup(1), "w")
    os.dup2(2, 1)
    with open(options.job, encoding="utf-8") as file:
        job = json.load(file)
    read = instrument(job, os.path.dirname(os.path.abspath(options.job)), options)
    for line in read.served(sys.stdin) if options.serve else [read.by_itself()]:
        print(json.dumps(line, allow_nan=False), file=answer, flush=True)


class Instrument:
    """The parts of a job's light: for each a function from (m, seed) to a block, and the rays of a block with m = 1."""

    lanes = 1 << 17  # rays in flight

    def __init__(self, job, versions, variant):
        self.job, self.versions, self.variant, self.parts = job, versions, variant, {}
        self.stations = [s["id"] for s in job["stations"]]

    def is_sampled(self, part):
        raise NotImplementedError

    def block(self, part, m, seed):
        values = self.parts[part][0](m, seed)
        bad = [name for name, value in zip(self.stations, values) if not math.isfinite(value)]
        if bad:
            raise RuntimeError(f"illuminance is not finite at {', '.join(bad)}")
        return values

    def served(self, requests):
        parts = [{"name": p, "rays": self.parts[p][1], "sampled": self.is_sampled(p)} for p in self.parts]
        about = {"versions": self.versions, "variant": self.variant}
        yield {**about, "lanes": self.lanes, "stations": self.stations, "parts": parts}
        for request in map(json.loads, requests):
            yield [self.block(request["part"], request["side"], seed).tolist() for seed in request["seeds"]]

    def by_itself(self):
        value, variance = np.zeros(len(self.stations)), np.zeros(len(self.stations))
        for k, part in enumerate(self.parts):
            if not self.is_sampled(part):
                value += self.block(part, 1, None)
                continue
            seeds = ((self.job["seed"], k, b) for b in range(self.job["blocks"]))
            blocks = np.array([self.block(part, self.job["side"], seed) for seed in seeds])
            value += blocks.mean(0)
            variance += blocks.var(0, ddof=1) / len(blocks)
        rows = zip(self.stations, value.tolist(), np.sqrt(variance).tolist())
        readings = [{"id": name, "value": lux, "std_error": error} for name, lux, error in rows]
        return {"versions": self.versions, "variant": self.variant, "readings": readings}
