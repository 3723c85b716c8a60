#!/usr/bin/env python3
"""Peers of wavesplat's renderer: how long VTK takes for all frames of a view, additive, from memory.

    python3 views.py data/plate.npy --spacing 2.3 --size 512 --threads 1

prints a line of JSON for each renderer:

    renderer   vtk-cpu: the fixed-point ray caster; vtk-mesa: the GPU ray caster on Mesa's software OpenGL
    seconds    [of the processor, of the clock] for all frames, the least of so many repeats after the first frame's
               set-up, which is not counted; null: not measured
    why        then the reason

Samples along rays are one voxel apart. Needs VTK; without it, both lines say so.
"""

import argparse
import json
import os
import subprocess
import sys
import time

RENDERERS = ["vtk-cpu", "vtk-mesa"]
DIRECTION = (0.4330127, -0.75, -0.5)  # azimuth 30, elevation 30


def volume_mapper(vtk, renderer, threads):
    if renderer == "vtk-mesa":
        mapper = vtk.vtkOpenGLGPUVolumeRayCastMapper()
    else:
        mapper = vtk.vtkFixedPointVolumeRayCastMapper()
        mapper.SetNumberOfThreads(threads)
        mapper.SetInteractiveSampleDistance(1.0)
    mapper.SetSampleDistance(1.0)
    mapper.SetAutoAdjustSampleDistances(0)
    mapper.SetImageSampleDistance(1.0)
    mapper.SetBlendModeToAdditive()
    return mapper


def volume_property(vtk, highest, depth):
    """Brightness in proportion to values, small enough that a ray through all of the volume does not saturate."""
    opacity, colour = vtk.vtkPiecewiseFunction(), vtk.vtkColorTransferFunction()
    opacity.AddPoint(0, 0)
    opacity.AddPoint(highest, 1 / depth)
    colour.AddRGBPoint(0, 1, 1, 1)
    colour.AddRGBPoint(highest, 1, 1, 1)
    prop = vtk.vtkVolumeProperty()
    prop.SetColor(colour)
    prop.SetScalarOpacity(opacity)
    prop.SetInterpolationTypeToLinear()
    prop.ShadeOff()
    return prop


def camera(view, dims, args):
    """Parallel, at so many pixels a voxel."""
    middle = [(n - 1) / 2 for n in dims]
    far = 2 * sum(dims)
    view.SetFocalPoint(*middle)
    view.SetPosition(*(m - far * d for m, d in zip(middle, DIRECTION)))
    view.SetViewUp(0, 0, 1)
    view.ParallelProjectionOn()
    view.SetParallelScale(args.size / args.spacing / 2)
    view.SetClippingRange(far / 4, 2 * far)


def drawer(renderer, series, args):
    """A function that draws a frame and brings the picture back."""
    import vtk
    from vtk.util.numpy_support import numpy_to_vtk, vtk_to_numpy

    dims = series.shape[:0:-1]
    image = vtk.vtkImageData()
    image.SetDimensions(*dims)
    image.GetPointData().SetScalars(numpy_to_vtk(series[0].reshape(-1)))
    mapper, volume = volume_mapper(vtk, renderer, args.threads), vtk.vtkVolume()
    mapper.SetInputData(image)
    volume.SetMapper(mapper)
    volume.SetProperty(volume_property(vtk, float(series.max()) or 1.0, max(dims)))
    scene, window = vtk.vtkRenderer(), vtk.vtkRenderWindow()
    scene.AddVolume(volume)
    window.SetOffScreenRendering(1)
    window.SetMultiSamples(0)
    window.SetSize(args.size, args.size)
    window.AddRenderer(scene)
    camera(scene.GetActiveCamera(), dims, args)
    picture = vtk.vtkWindowToImageFilter()
    picture.SetInput(window)
    picture.ReadFrontBufferOff()

    def draw(frame):
        image.GetPointData().SetScalars(numpy_to_vtk(frame.reshape(-1)))
        image.Modified()
        window.Render()
        picture.Modified()
        picture.Update()
        return vtk_to_numpy(picture.GetOutput().GetPointData().GetScalars())

    draw.kept = (scene, window, volume, mapper)
    return draw


def measure(renderer, args):
    try:
        import vtk  # noqa: F401
    except ImportError:
        return {"renderer": renderer, "seconds": None, "why": "VTK is not installed"}
    import numpy as np

    series = np.load(args.file)
    draw = drawer(renderer, series, args)
    if not draw(series[len(series) // 2]).any():
        return {"renderer": renderer, "seconds": None, "why": "its picture is black"}
    times = []
    for _ in range(args.repeats):
        processor, wall = time.process_time(), time.perf_counter()
        for frame in series:
            draw(frame)
        times.append((time.process_time() - processor, time.perf_counter() - wall))
    return {"renderer": renderer, "seconds": [min(t) for t in zip(*times)]}


def stay_on(threads):
    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, sorted(os.sched_getaffinity(0))[:threads])


def in_process(renderer, args):
    """Measures in a process of its own, since a renderer without what it needs may end it."""
    environment = {
        "LP_NUM_THREADS": "0" if args.threads == 1 else str(args.threads),
        "VTK_DEFAULT_OPENGL_WINDOW": "vtkEGLRenderWindow",
        **os.environ,
    }
    command = [sys.executable, __file__, *sys.argv[1:], "--only", renderer]
    run = subprocess.run(command, env=environment, capture_output=True, text=True)
    lines = run.stdout.strip().splitlines()
    if run.returncode == 0 and lines:
        return lines[-1]
    return json.dumps({"renderer": renderer, "seconds": None, "why": f"it failed ({run.returncode})"})


def arguments():
    raw = argparse.RawDescriptionHelpFormatter
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=raw)
    parser.add_argument("file", metavar="FILE.npy", help="an archive (t, z, y, x)")
    parser.add_argument("--spacing", type=float, default=1.0, help="pixels from a voxel to the next")
    parser.add_argument("--size", type=lambda text: round(float(text)), default=512, help="pixels a side of a picture")
    parser.add_argument("--threads", type=lambda text: round(float(text)), default=1)
    parser.add_argument("--repeats", type=int, default=3, help="how often every time is taken [3]")
    parser.add_argument("--only", choices=RENDERERS, help=argparse.SUPPRESS)
    return parser.parse_args()


if __name__ == "__main__":
    options = arguments()
    stay_on(options.threads)
    if options.only:
        print(json.dumps(measure(options.only, options)))
    else:
        for name in RENDERERS:
            print(in_process(name, options), flush=True)
