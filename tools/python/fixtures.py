"""Writes small archives with the field's own software, for the tests of what reads them.

    python fixtures.py OUT_FOLDER [FORMAT...]

Everything is the same small field (inputs/case.py); OUT_FOLDER/manifest.json tells of each archive what must be read.
Folders of formats are made anew, and the manifest is of those alone that were written.
fixtures.txt lists the packages, with the versions that wrote tests/golden/inputs.
"""

from __future__ import annotations

import json
import sys
from importlib import import_module
from pathlib import Path

from inputs.case import fresh

FORMATS = ["npy", "npz", "metaimage", "vtk_legacy", "vti", "vtr", "vtkhdf", "nifti", "nrrd", "tiff", "hdf5", "netcdf", "zarr"]


def write_format(out: Path, name: str) -> list[dict]:
    """Writes a format's folder anew; paths of the records are below `out`."""
    module = import_module(f"inputs.{name}")
    records = [case.record() for case in module.write(fresh(out, module.FOLDER))]
    return [record | {"path": f"{module.FOLDER}/{record['path']}"} for record in records]


def write_manifest(out: Path, records: list[dict]) -> None:
    lines = ",\n".join(json.dumps(record, separators=(",", ":")) for record in records)
    (out / "manifest.json").write_text(f"[\n{lines}\n]\n")


def print_table(records: list[dict]) -> None:
    for r in records:
        what = "refused" if r.get("refused") else f"{r['sample']} x {r['frames']}"
        print(f"{r['path']:36} {r['variable'] or '':20} {what:8} {r['note']}")


def main(out: str, *names: str) -> None:
    records = [record for name in names or FORMATS for record in write_format(Path(out), name)]
    write_manifest(Path(out), records)
    print_table(records)


if __name__ == "__main__":
    if len(sys.argv) < 2:
        sys.exit(__doc__)
    main(*sys.argv[1:])
