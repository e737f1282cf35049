"""Says which LuxCore there is and proves that it works, by starting it.

    python luxcore_probe.py
"""

import json
import os

os.environ["OMP_NUM_THREADS"] = "1"
import numpy  # before LuxCore, see luxcore_read.py
import pyluxcore

pyluxcore.Init()
pyluxcore.SetLogHandler(None)
pyluxcore.Scene()
print(json.dumps({"version": pyluxcore.Version()}), flush=True)
