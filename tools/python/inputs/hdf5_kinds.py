"""HDF5 by h5py: scales behind labels, numbered groups, links, booleans, and what must be refused."""

from pathlib import Path

import h5py
import numpy as np

from .case import FRAMES, NAME, ORIGIN, SPACING, TIMES, Case, Refused, axes, by, frame, frames

H5PY = by("h5py")
SMALL = ("v110", "v110")
BARE = {"spacing": None, "origin": None}


def write(folder: Path) -> list:
    return [
        dedalus(folder),
        *numbered_twice(folder),
        *openpmd_files(folder),
        theta_mode(folder),
        booleans(folder),
        *elsewhere(folder),
        *refused(folder),
    ]


def group(file: h5py.File, path: str) -> h5py.Group:
    """The group, made if need be; those on the way would note the time of day if h5py were left to make them."""
    found = file
    for name in path.split("/"):
        found = found[name] if name in found else found.create_group(name)
    return found


def dedalus(folder: Path) -> Case:
    """Labels t, z, y, x; several scales of the first axis; all scales in a group of their own, as Dedalus writes them."""
    with h5py.File(folder / "dedalus.h5", "w", libver=SMALL) as file:
        scales, data = group(file, "scales"), group(file, "tasks").create_dataset(NAME, data=frames())
        along_time = {"wall_time": np.array(TIMES) * 7, "sim_time": TIMES, "iteration": np.arange(FRAMES) * 10}
        for name, values in along_time.items():
            scales[name] = values
            scales[name].make_scale(name)
            data.dims[0].attach_scale(scales[name])
        for at, name, values in zip((3, 2, 1), "xyz", axes()):
            scale = group(file, f"scales/{name}").create_dataset("1.0", data=values)
            scale.make_scale("1.0")
            data.dims[at].attach_scale(scale)
        for at, label in enumerate("tzyx"):
            data.dims[at].label = label
    note = "labels t, z, y, x; scales wall_time, sim_time and iteration of t; scales x/1.0 and so on in another group"
    return Case("dedalus.h5", H5PY, note, times=TIMES)


def numbered_twice(folder: Path) -> list:
    """Paths with two numbers, as Imaris and BigDataViewer have them."""
    imaris = "DataSet/ResolutionLevel {}/TimePoint {}/Channel 0"
    with h5py.File(folder / "imaris.h5", "w", libver=SMALL) as file:
        for t in range(FRAMES):
            group(file, imaris.format(0, t))["Data"] = frame("u8", t)
            group(file, imaris.format(1, t))["Data"] = frame("u8", t)[::2, ::2, ::2]
    with h5py.File(folder / "runs.h5", "w", libver=SMALL) as file:
        for t in range(FRAMES):
            group(file, f"a{t}/b0")[NAME] = frame("u8", t)
            group(file, f"a0/b{t}")[NAME + "s"] = frame("u8", 0)
            group(file, f"a{t}/b1")[NAME] = frame("u8", t) + np.uint8(100)
    notes = ["two numbers in each path: resolution and time", "two numbers in each path, of which none says time"]
    level = imaris.format(0, "%T") + "/Data"
    return [
        Case("imaris.h5", H5PY, notes[0], "u8", variable=level, **BARE),
        Case("runs.h5", H5PY, notes[1], "u8", variable=f"a%T/b0/{NAME}", **BARE),
        Refused("runs.h5", H5PY, notes[1] + "; nothing says which", variable=NAME),
    ]


def mesh(labels: str, at: list, **more) -> dict:
    return {
        "geometry": np.bytes_("cartesian"),
        "dataOrder": np.bytes_("C"),
        "axisLabels": np.array([label.encode() for label in labels]),
        "gridSpacing": np.array([SPACING[axis] for axis in at]),
        "gridGlobalOffset": np.array([ORIGIN[axis] for axis in at]),
        "gridUnitSI": 1.0,
        "timeOffset": 0.0,
    } | more


def component(record: h5py.Group, name: str, data) -> None:
    record.create_dataset(name, data=data).attrs.update({"unitSI": 1.0, "position": np.zeros(len(record.attrs["axisLabels"]))})


def openpmd_files(folder: Path) -> list:
    """A file for each iteration, with a record of vectors, of which a component is called as an axis."""
    (folder / "openpmd").mkdir()
    for t in range(FRAMES):
        with h5py.File(folder / f"openpmd/run_{50 * t:06d}.h5", "w", libver=SMALL) as file:
            file.attrs.update({"openPMD": np.bytes_("1.1.0"), "iterationEncoding": np.bytes_("fileBased")})
            record = group(file, f"data/{50 * t}/fields/E")
            file[f"data/{50 * t}"].attrs.update({"time": TIMES[t] / 4, "dt": 0.01, "timeUnitSI": 4.0})
            record.attrs.update(mesh("zyx", [2, 1, 0]))
            component(record, "x", frame("f32", t))
            component(record, "y", frame("f32", t) + 1)
    note = "openPMD, fileBased: iterations 0, 50, 100, 150"
    return [
        Case("openpmd", H5PY, note, variable="data/%T/fields/E/x", times=TIMES),
        Case("openpmd", H5PY, note + "; by the end of its path", variable="E/x", times=TIMES),
    ]


def theta_mode(folder: Path) -> Case:
    """Modes around an axis of symmetry: r is x, and z is z."""
    dims = (7, 1, 3)
    with h5py.File(folder / "theta_mode.h5", "w", libver=SMALL) as file:
        file.attrs.update({"openPMD": np.bytes_("1.1.0"), "iterationEncoding": np.bytes_("groupBased")})
        for t in range(FRAMES):
            record = group(file, f"data/{t}/meshes/B")
            file[f"data/{t}"].attrs.update({"time": TIMES[t], "dt": 0.5, "timeUnitSI": 1.0})
            record.attrs.update(mesh("rz", [0, 2], geometry=np.bytes_("thetaMode")))
            whole = frame("f32", t, dims=dims)[:, 0].T
            component(record, "z", np.stack([whole, whole + 1, whole + 2]))
    place = {"dims": dims, "spacing": (SPACING[0], 1.0, SPACING[2]), "origin": (ORIGIN[0], 0.0, ORIGIN[2])}
    note = "openPMD, thetaMode: three modes, r, z"
    return Case("theta_mode.h5", H5PY, note, variable="data/%T/meshes/B/z[0]", times=TIMES, **place)


def booleans(folder: Path) -> Case:
    """NumPy's bool is an enumeration in HDF5; here all of it is true but for the first sample."""
    with h5py.File(folder / "bool.h5", "w", libver=SMALL) as file:
        file[NAME] = frame("u8", dims=(2, 1, 1)).astype(bool)
    return Case("bool.h5", H5PY, "bool, an enumeration", "u8", dims=(2, 1, 1), frames=1, **BARE)


def elsewhere(folder: Path) -> list:
    """Links to what is not there, external links and a virtual dataset, beside an array or alone."""
    for forms, name in ((SMALL, "links.h5"), ("earliest", "links_earliest.h5")):
        with h5py.File(folder / name, "w", libver=forms) as file:
            file[NAME] = frames("u8")
            add_links(file)
    with h5py.File(folder / "links_alone.h5", "w", libver=SMALL) as file:
        add_links(file)
    note = "and names that lead elsewhere: external links, a soft link, a virtual dataset"
    return [
        Case("links.h5", H5PY, "an array " + note, "u8", **BARE),
        Case("links_earliest.h5", H5PY, "an array " + note + ", in the first form of groups", "u8", **BARE),
        Refused("links_alone.h5", H5PY, "no array " + note),
        Refused("links_alone.h5", H5PY, "a virtual dataset", variable="all"),
        Refused("links_alone.h5", H5PY, "a link to another file", variable="far"),
    ]


def add_links(file: h5py.File) -> None:
    file["far"] = h5py.ExternalLink("other.h5", "/deep/v")
    file["soft"] = h5py.SoftLink("/not/there")
    whole = h5py.VirtualLayout((FRAMES, 3, 5, 7), "u1")
    for t in range(FRAMES):
        whole[t] = h5py.VirtualSource(f"part{t}.h5", "v", (3, 5, 7))
    file.create_virtual_dataset("all", whole)


def refused(folder: Path) -> list:
    """Forms that would be read as other numbers."""
    above_most(folder / "refused_above_most.h5")
    bfloat = h5py.h5t.IEEE_F16LE.copy()
    bfloat.set_fields(15, 7, 8, 0, 7)
    bfloat.set_ebias(127)
    twelve = h5py.h5t.STD_I16LE.copy()
    twelve.set_precision(12)
    for name, kind in (("bfloat16", bfloat), ("i12", twelve)):
        with h5py.File(folder / f"refused_{name}.h5", "w", libver=SMALL) as file:
            space = h5py.h5s.create_simple((3, 5, 7))
            h5py.h5d.create(file.id, NAME.encode(), kind, space).write(h5py.h5s.ALL, h5py.h5s.ALL, -frame("f32"))
    minc(folder / "refused_minc2.h5")
    return [
        Refused("refused_above_most.h5", H5PY, "sizes above the largest that they may become, by another hand"),
        Refused("refused_bfloat16.h5", H5PY, "floats of 16 bits with 8 of exponent"),
        Refused("refused_i12.h5", H5PY, "signed integers of 12 bits"),
        Refused("refused_minc2.h5", H5PY, "MINC 2: slices scaled by image-max and image-min"),
    ]


def above_most(path: Path) -> None:
    with h5py.File(path, "w", libver="earliest") as file:
        file.create_dataset(NAME, data=frames("u8"), chunks=(1, 3, 5, 7), maxshape=(FRAMES, 3, 5, 7))
    data = path.read_bytes()
    sizes = np.array([FRAMES, 3, 5, 7], "<u8").tobytes()
    assert data.count(sizes * 2) == 1
    path.write_bytes(data.replace(sizes * 2, np.array([FRAMES, 3, 9, 7], "<u8").tobytes() + sizes))


def minc(path: Path) -> None:
    with h5py.File(path, "w", libver=SMALL) as file:
        image = group(file, "minc-2.0/image/0")
        image["image"] = frame("u8")
        image["image"].attrs["valid_range"] = [0.0, 255.0]
        image["image-max"], image["image-min"] = np.arange(3) + 10.0, np.arange(3.0)
