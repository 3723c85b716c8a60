"""Times reads of open files in Python, each in a fresh process, beside another build of wavesplat.

    python tools/benchmark/reads.py this.wspl --python other/bin/python --other other.wspl

Both files hold the same archive; each build reads its own. Prints a table for reads.md. Times are the least of some rounds, on one thread.
"""

import argparse
import json
import os
import subprocess
import sys
import time

import wavesplat


def seconds(run):
    start = time.perf_counter()
    run()
    return time.perf_counter() - start


def everything(file, _):
    return {"all samples": seconds(lambda: file[...])}


def loop(file, _):
    def run():
        for frame in range(file.shape[0]):
            file[frame]

    return {"a loop over all frames": seconds(run)}


def one_frame(file, _):
    return {"one frame": seconds(lambda: file[file.shape[0] // 2])}


def series(file, middle):
    first = seconds(lambda: file[:, middle, middle, middle])
    file[:, middle + 1, middle, middle]
    near = seconds(lambda: [file[:, middle + n % 3, middle - n % 2, middle + 1] for n in range(20)]) / 20
    return {"the series of a voxel": first, "series nearby, from the third on": near}


def box(file, middle):
    part = slice(middle - 4, middle + 4)
    return {"8x8x8 voxels of a frame": seconds(lambda: file[7, part, part, part])}


def views(file, _):
    def picture(view):
        return seconds(lambda: file.render(view=view))

    return {"a view of all frames": picture("30,30"), "a second view": picture("45,30")}


RUNS = [everything, loop, one_frame, series, box, views]


def timed(python, path, number):
    """The times of one run in a fresh process."""
    environment = dict(os.environ, RAYON_NUM_THREADS="1")
    command = [python, __file__, path, "--run", str(number)]
    return json.loads(subprocess.run(command, env=environment, check=True, capture_output=True).stdout)


def compare(this, other, rounds):
    """The least times of each read: of the other build, and of this one."""
    least = {}
    for number in range(len(RUNS)):
        for _ in range(rounds):
            for build, (python, path) in enumerate([other, this]):
                for name, taken in timed(python, path, number).items():
                    times = least.setdefault(name, [float("inf")] * 2)
                    times[build] = min(times[build], taken)
    return least


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("file", help="a file of this build, of at least 32 voxels a side")
    parser.add_argument("--python", help="the other build's interpreter")
    parser.add_argument("--other", help="the other build's file of the same archive")
    parser.add_argument("--rounds", type=int, default=4)
    parser.add_argument("--run", type=int, help=argparse.SUPPRESS)
    given = parser.parse_args()
    if given.run is not None:
        file = wavesplat.open(given.file)
        print(json.dumps(RUNS[given.run](file, file.shape[1] // 2 - 3)))
        return
    print("| read | other build, ms | this build, ms | other / this |\n|---|--:|--:|--:|")
    found = compare((sys.executable, given.file), (given.python, given.other), given.rounds)
    for name, (other, this) in found.items():
        print(f"| {name} | {1e3 * other:.2f} | {1e3 * this:.2f} | {other / this:.2f} |", flush=True)


if __name__ == "__main__":
    main()
