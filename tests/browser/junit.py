"""Reads a JUnit view as others do and counts it against the report: junit.py VIEW.xml report.json."""

import json
import sys

from junitparser import Failure, JUnitXml, Skipped

view, report = JUnitXml.fromfile(sys.argv[1]), json.load(open(sys.argv[2]))
cases = [case for suite in view for case in suite]
key = lambda of: (of["case"], of["procedure"], of["engine"])
ran = {key(r) for r in report["recordings"]}
skipped = {key(s) for s in report["skips"]} - ran
bad = {key(c) for c in report["comparisons"] if c["verdict"] in ("fail", "unexpected_pass", "missing")}
found = {(c.classname, *c.name.split(" ")): [type(r) for r in c.result] for c in cases}
assert len(cases) == len(ran) + sum(key(s) not in ran for s in report["skips"]) > 0, len(cases)
assert set(found) == ran | skipped, set(found) ^ (ran | skipped)
assert {k for k, results in found.items() if Failure in results} == bad
assert {k for k, results in found.items() if Skipped in results} == skipped
assert all(r.message for c in cases for r in c.result), "a result without a reason"
print(f"{sys.argv[1]}: {len(cases)} test cases, {len(bad)} failed, {len(skipped)} skipped")
