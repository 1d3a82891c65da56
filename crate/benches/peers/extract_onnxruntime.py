"""Time of extraction in ONNX Runtime on the CPU, of encoders that `tracklens export` wrote.

`extract_onnxruntime.py FOLDER [--threads N]` prints a line of JSON for every encoder and size: the median of 15 frames
after two that are not counted, one frame at a time on N threads.
"""

import argparse
import json
import pathlib
import statistics
import time

import numpy
import onnxruntime


def main():
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("folder", type=pathlib.Path)
    arguments.add_argument("--threads", type=int, default=1)
    arguments = arguments.parse_args()
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = arguments.threads
    options.inter_op_num_threads = 1
    for name in ("basic", "keynet", "dsae"):
        path = arguments.folder / f"{name}.onnx"
        session = onnxruntime.InferenceSession(path, options, providers=["CPUExecutionProvider"])
        for side in (128, 256):
            image = numpy.arange(3 * side * side, dtype=numpy.float32) * 31 % 97 / 97
            feed = {session.get_inputs()[0].name: image.reshape(1, 3, side, side)}
            times = []
            for _ in range(17):
                start = time.perf_counter()
                session.run(None, feed)
                times.append(time.perf_counter() - start)
            print(json.dumps({"name": f"{name} {side}", "median_ms": statistics.median(times[2:]) * 1e3}))


if __name__ == "__main__":
    main()
