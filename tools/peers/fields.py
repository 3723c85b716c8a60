"""The generator's kinds: synthetic archives as frames of float32 (z, y, x), one after the other.

The same settings give the same samples. Coordinates run over 0..1, sampled at the middles of the voxels.
"""

import numpy as np
from scipy import fft

PLATE_DIMS = (20, 75, 75)  # z, y, x: the size of the paper's experiment
PLATE_MODES = 24  # sines along x and along y
PLATE_DEPTH_MODES = 12  # cosines along z
ROUGHNESS = 2e-3  # of plate_fe: the share by which an element's values are off
SWEEP = 64  # frames in which the turbulence passes its unit of time, whatever the number of frames


def centres(count):
    """The middles of `count` cells of 0..1."""
    return (np.arange(count) + 0.5) / count


def plate(frames, edge=None, roughness=0.0):
    """The magnitude of eddy currents that diffuse in a plate after a pulse in two coils above it.

    A stream function in sines along x and y, damped by diffusion, gives currents whose divergence is 0; cosines along
    z take the skin depth. `roughness` multiplies every voxel by 1 plus a normal number of that size, the same in all
    frames: rough in space and smooth in time, as elements of first order give it.
    """
    nz, ny, nx = PLATE_DIMS if edge is None else (max(3, round(edge * PLATE_DIMS[0] / PLATE_DIMS[2])), edge, edge)
    modes, depths = np.arange(1, PLATE_MODES + 1), np.arange(PLATE_DEPTH_MODES)
    sine = {n: np.sin(np.pi * np.outer(modes, centres(n))) for n in (nx, ny)}
    slope = {n: np.pi * modes[:, None] * np.cos(np.pi * np.outer(modes, centres(n))) for n in (nx, ny)}
    coils = coil_rings(nx, ny)
    amplitudes = 4 / (nx * ny) * (sine[ny] @ coils @ sine[nx].T)
    squares = modes[None, :] ** 2 + modes[:, None] ** 2
    cosine = np.cos(np.pi * np.outer(depths, centres(nz)))
    skin = np.where(depths == 0, 1, 2) * (cosine @ np.exp(-centres(nz) / 0.15)) / nz
    rough = 1 + roughness * np.random.default_rng(7).standard_normal((nz, ny, nx))
    for time in centres(frames):
        damped = amplitudes * np.exp(-0.06 * squares * time)
        sheet = np.hypot(slope[ny].T @ damped @ sine[nx], sine[ny].T @ damped @ slope[nx])
        depth = np.abs((skin * np.exp(-0.35 * depths**2 * time)) @ cosine)
        pulse = (1 - np.exp(-time / 0.04)) * np.exp(-1.2 * time)
        yield (pulse * depth[:, None, None] * sheet[None] * rough).astype(np.float32)


def coil_rings(nx, ny):
    """Two rings on the plate, one of half the strength, as (y, x)."""
    x, y = np.meshgrid(centres(nx), centres(ny))
    large = np.exp(-(((np.hypot(x - 0.42, y - 0.55) - 0.2) / 0.07) ** 2))
    small = np.exp(-((np.hypot(x - 0.72, y - 0.3) / 0.08) ** 2))
    return large + 0.5 * small


# Radius of the way, height, phase, width, amplitude, turns in 256 frames.
BLOBS = [
    (0.28, 0.50, 0.0, 0.060, 1.0, 1.0),
    (0.20, 0.35, 2.1, 0.045, 0.8, -0.8),
    (0.33, 0.65, 4.0, 0.035, 0.9, 1.2),
    (0.12, 0.55, 1.0, 0.080, 0.6, 0.6),
    (0.25, 0.42, 5.2, 0.025, 1.1, 1.5),
]


def blobs(frame):
    """(x, y, z), width and amplitude of every blob: each on a circle, going up and down a little."""
    for radius, height, phase, width, amplitude, turns in BLOBS:
        angle = phase + 2 * np.pi * turns * frame / 256
        lift = 0.04 * np.sin(2 * np.pi * frame / 96 + phase)
        at = (0.5 + radius * np.cos(angle), 0.5 + radius * np.sin(angle), height + lift)
        yield at, width, np.float32(amplitude)


class Turbulence:
    """A random periodic field with the energy k^-5/3, whose modes drift, turn and decay: frames resemble each other."""

    def __init__(self, edge, seed):
        random = np.random.default_rng(seed)
        k = np.fft.fftfreq(edge, 1 / edge).astype(np.float32)
        kz, ky, kx = k[:, None, None], k[None, :, None], np.arange(edge // 2 + 1, dtype=np.float32)[None, None, :]
        self.edge, self.squares = edge, kz**2 + ky**2 + kx**2
        length = np.sqrt(self.squares)
        length[0, 0, 0] = 1
        strength = np.where((length > 2) & (length < edge / 3), length ** (-(5 / 3 + 2) / 2), 0).astype(np.float32)
        noise = fft.rfftn(random.standard_normal((edge,) * 3, dtype=np.float32))
        self.modes = (noise * strength).astype(np.complex64)
        self.turning = (length ** (2 / 3) * random.standard_normal(length.shape, dtype=np.float32)).astype(np.float32)
        self.drift = kz * 0.3 + ky * 0.8 + kx * 1.0
        self.unit = None

    def at(self, time):
        """The field at a time; the first one asked for has the standard deviation 1, were it not for its decay."""
        turned = -(self.turning * (1.5 * time) + self.drift * (0.25 * time)) * np.float32(2 * np.pi / 4)
        worn = np.exp(-self.squares * np.float32(4e-4 * time))
        field = fft.irfftn(self.modes * np.exp(1j * turned) * worn, s=(self.edge,) * 3)
        self.unit = field.std() if self.unit is None else self.unit
        return (field / self.unit * np.exp(-0.8 * time)).astype(np.float32)


def vortex(frames, edge=64):
    """Gaussians on circles in turbulence that fills the volume."""
    turbulence, along = Turbulence(edge, 11), centres(edge).astype(np.float32)
    for frame in range(frames):
        values = np.zeros((edge,) * 3, np.float32)
        for at, width, amplitude in blobs(frame):
            x, y, z = (np.exp(-0.5 / width**2 * (along - c) ** 2) for c in at)
            values += amplitude * z[:, None, None] * y[None, :, None] * x[None, None, :]
        yield values + np.float32(0.04) * turbulence.at(frame / SWEEP)


def cloud(frames, edge=96):
    """Turbulent blobs on circles in nothing, which is exactly 0 in most of the volume."""
    turbulence, along = Turbulence(edge, 13), centres(edge).astype(np.float32)
    for frame in range(frames):
        values = np.zeros((edge,) * 3, np.float32)
        for at, width, amplitude in blobs(frame):
            x, y, z = ((along - c) ** 2 for c in at)
            squares = z[:, None, None] + y[None, :, None] + x[None, None, :]
            values += amplitude * np.maximum(1 - squares / np.float32((2.6 * width) ** 2), 0) ** 2
        values *= 1 + np.float32(0.15) * turbulence.at(frame / SWEEP)
        yield np.maximum(values, 0)


# Name: the generator, its frames and its voxels along x unless others are asked for.
KINDS = {
    "plate": (plate, 32, None),
    "plate_fe": (lambda frames, edge: plate(frames, edge, ROUGHNESS), 32, None),
    "vortex": (vortex, 64, 64),
    "cloud": (cloud, 64, 96),
}


def write(kind, path, frames=None, edge=None):
    """Writes an entry of KINDS as one .npy (t, z, y, x): integers as they are, others as float32."""
    generator, usual_frames, usual_edge = kind
    frames = frames or usual_frames
    array = None
    for number, frame in enumerate(generator(frames, edge or usual_edge)):
        if array is None:
            stored = frame.dtype if frame.dtype.kind in "iu" else np.float32
            array = np.lib.format.open_memmap(path, "w+", stored, (frames, *frame.shape))
        array[number] = frame
    array.flush()
