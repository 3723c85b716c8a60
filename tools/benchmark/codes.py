"""Times whole programs on archives, beside another build of wavesplat.

    python tools/benchmark/codes.py this/bin other/bin archive.npy ...

Prints a table for codes.md. Times are processor seconds on one thread, the least of some rounds; each build reads its own files.
"""

import argparse
import os
import resource
import subprocess
import tempfile

COMMANDS = {
    "convert": "wavesplat convert {archive} -o {file} --tolerance {tolerance} --threads 1 --force --quiet",
    "extract": "wavesplat extract {file} -o {out}.npy --threads 1 --force --quiet",
    "view": "wavesplat-render {file} -o {out}_%04d.png --view 30,30 --size 512x512 --threads 1 --force --quiet",
    "one": "wavesplat-render {file} -o {out}_%04d.png --view 30,30 --size 512x512 --frames 7 --threads 1 --force --quiet",
}


def processor_seconds():
    used = resource.getrusage(resource.RUSAGE_CHILDREN)
    return used.ru_utime + used.ru_stime


def timed(programs, command):
    program, *options = command.split()
    start = processor_seconds()
    subprocess.run([os.path.join(programs, program), *options], check=True, capture_output=True)
    return processor_seconds() - start


def compare(builds, archive, tolerance, rounds, folder):
    """The least times of each command, and the bytes of the file, by each build."""
    least, sizes = {}, {}
    for _ in range(rounds):
        for number, programs in enumerate(builds):
            file, out = (os.path.join(folder, f"{number}{name}") for name in (".wspl", ""))
            for name, command in COMMANDS.items():
                taken = timed(programs, command.format(archive=archive, file=file, out=out, tolerance=tolerance))
                least[number, name] = min(taken, least.get((number, name), taken))
            sizes[number] = os.path.getsize(file)
    return least, sizes


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("this", help="the folder of this build's programs")
    parser.add_argument("other", help="the folder of the other build's programs")
    parser.add_argument("archives", nargs="+", metavar="ARCHIVE", help="a .npy file (t, z, y, x)")
    parser.add_argument("--tolerances", default="1e-2,1e-3")
    parser.add_argument("--rounds", type=int, default=3)
    given = parser.parse_args()
    print("| data | tolerance | bytes other | this | this / other | " + ", times | ".join(COMMANDS) + ", times |")
    print("|---|---" + "|--:" * (3 + len(COMMANDS)) + "|")
    with tempfile.TemporaryDirectory() as folder:
        for tolerance in given.tolerances.split(","):
            for archive in given.archives:
                least, sizes = compare([given.other, given.this], archive, tolerance, given.rounds, folder)
                name = os.path.splitext(os.path.basename(archive))[0]
                times = " | ".join(f"{least[0, command] / least[1, command]:.2f}" for command in COMMANDS)
                ratio = sizes[1] / sizes[0]
                print(f"| {name} | {tolerance} | {sizes[0]} | {sizes[1]} | {ratio:.3f} | {times} |", flush=True)


if __name__ == "__main__":
    main()
