#!/usr/bin/env python3
"""Measures shards and their merge on this machine. The figures of tools/guide/clusters.md are from here.

    tools/cluster/measure.py many [SHARDS]   # tiny shards: time, memory, open files and directory of their merge
    tools/cluster/measure.py large [GB]      # large frames: shards against one conversion, the merge against cp

Needs wavesplat on the path, and room for three times the frames in the folder of temporary files (TMPDIR).
"""

import array
import concurrent.futures
import math
import os
import random
import subprocess
import sys
import tempfile
import time


def run(*words):
    """Runs a program. Returns its seconds, peak MB and the most files and maps that it held open."""
    start, process = time.monotonic(), subprocess.Popen(words)
    files = maps = 0
    while True:
        pid, status, used = os.wait4(process.pid, os.WNOHANG)
        if pid:
            break
        files, maps = max(files, held(f"/proc/{process.pid}/fd")), max(maps, mapped(process.pid, ".wspl"))
        time.sleep(0.002)
    if status:
        sys.exit(f"{' '.join(words[:3])}: status {status}")
    return time.monotonic() - start, used.ru_maxrss / 1024, files, maps


def held(folder):
    try:
        return len(os.listdir(folder))
    except OSError:
        return 0


def mapped(pid, name):
    try:
        with open(f"/proc/{pid}/maps") as maps:
            return sum(name in line for line in maps)
    except OSError:
        return 0


def write_frames(path, edge, frames):
    """Waves that travel, with noise in the last bits, as raw f32 frames."""
    rows = [array.array("f", (math.sin(0.07 * x + 0.3 * t) for x in range(edge))) for t in range(64)]
    noise = random.Random(1)
    with open(path, "wb") as out:
        for t in range(frames):
            for z in range(edge):
                plane = array.array("f")
                for y in range(edge):
                    plane.extend(rows[(t + y // 5 + z // 3) % 64])
                for n in range(0, len(plane), 3):
                    plane[n] += noise.random() * 1e-3
                out.write(plane.tobytes())


def many(shards):
    write_frames("all.raw", 8, shards)
    common = ["wavesplat", "convert", "all.raw", "--dims", f"8x8x8x{shards}", "--dtype", "f32", "--range", "-2,2", "--quiet"]
    common += ["--window", "1", "--chain", "1", "--threads", "1"]
    with concurrent.futures.ThreadPoolExecutor(os.cpu_count()) as pool:
        start = time.monotonic()
        make = lambda n: subprocess.run([*common, "--shard", f"{n}/{shards}", "-o", f"part-{n}.wspl"], check=True)
        list(pool.map(make, range(1, shards + 1)))
    print(f"{shards} shards made in {time.monotonic() - start:.0f} s")
    parts = [f"part-{n}.wspl" for n in range(1, shards + 1)]
    seconds, memory, files, maps = run("wavesplat", "merge", *parts, "-o", "merged.wspl", "--quiet")
    print(f"merge: {seconds:.1f} s, peak {memory:.0f} MB, at most {files} files open and {maps} mapped")
    run(*common, "-o", "whole.wspl")
    subprocess.run(["cmp", "merged.wspl", "whole.wspl"], check=True)
    sizes = [os.path.getsize(path) for path in ("merged.wspl", *parts)]
    print(f"merged file {sizes[0]} bytes, of its shards {sum(sizes[1:])}; metadata and root: {tail('merged.wspl')} bytes")


def tail(path):
    """Bytes behind the last window: metadata, root and footer."""
    with open(path, "rb") as file:
        data = file.read()
    return len(data) - data.rindex(b"META")


def large(gigabytes):
    edge, shards = 80, 4
    chain = 4 * 32 * shards  # frames of four windows for each shard
    frames = max(round(gigabytes * 1e9 / (4 * edge**3 * chain)), 1) * chain
    write_frames("all.raw", edge, frames)
    size = os.path.getsize("all.raw")
    dims = ["--dims", f"{edge}x{edge}x{edge}x{frames}", "--dtype", "f32", "--quiet"]
    print(f"{frames} frames, {size / 1e9:.2f} GB, {os.cpu_count()} processors")
    print("read, from memory:", rate(run("dd", "if=all.raw", "of=/dev/null", "bs=4M", "status=none")[0], size))
    print("scan:", rate(run("wavesplat", "scan", "all.raw", *dims, "-o", "scan.json")[0], size))
    for tolerance in ("0.001", "0"):
        compare([*dims, "--scan", "scan.json", "--chain", "4", "--tolerance", tolerance], shards, size)


def rate(seconds, size):
    return f"{seconds:.1f} s, {size / seconds / 1e6:.0f} MB/s"


def compare(options, shards, size):
    common = ["wavesplat", "convert", "all.raw", *options, "--force"]
    whole = run(*common, "-o", "whole.wspl")[0]
    print(f"{' '.join(options[-2:])}: one conversion:", rate(whole, size))
    each = [run(*common, "--shard", f"{n}/{shards}", "-o", f"part-{n}.wspl")[0] for n in range(1, shards + 1)]
    print(f"  {shards} shards, one after another:", rate(sum(each), size), f"({sum(each) / whole - 1:+.0%})")
    parts = [f"part-{n}.wspl" for n in range(1, shards + 1)]
    stored = sum(map(os.path.getsize, parts))
    for _ in range(3):
        seconds, memory, _, _ = run("wavesplat", "merge", *parts, "-o", "merged.wspl", "--force", "--quiet")
        print(f"  merge of {stored / 1e6:.0f} MB:", rate(seconds, stored), f"peak {memory:.0f} MB")
        copied = run("sh", "-c", f"cat {' '.join(parts)} > copy && sync copy && rm copy")[0]
        print("  copy of the same bytes, to the disk:", rate(copied, stored))
    subprocess.run(["cmp", "merged.wspl", "whole.wspl"], check=True)


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as folder:
        what, amount = sys.argv[1], sys.argv[2:]
        os.chdir(folder)
        many(int(amount[0]) if amount else 10_000) if what == "many" else large(float(amount[0]) if amount else 1)
