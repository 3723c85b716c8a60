"""Archives of many kinds, by small solvers and imitated scans: frames of (z, y, x), one after the other.

The same settings give the same samples. Fields are periodic where nothing else is said.
"""

import numpy as np
from fields import centres
from scipy import fft, ndimage


def shifted(field, axis, by):
    """The values `by` cells further along an axis."""
    return np.roll(field, -by, axis)


def laplacian(field):
    """The sum of second differences."""
    return sum(shifted(field, a, 1) + shifted(field, a, -1) for a in range(field.ndim)) - 2 * field.ndim * field


def lattice(edge):
    """Coordinates 0..1 along z, y and x, ready for broadcasting."""
    along = centres(edge).astype(np.float32)
    return along[:, None, None], along[None, :, None], along[None, None, :]


def smooth_noise(random, shape, width):
    """Noise of mean 0 and deviation 1, smoothed over `width` cells."""
    field = ndimage.gaussian_filter(random.standard_normal(shape), width, mode="wrap")
    return (field / field.std()).astype(np.float32)


def reaction(frames, edge, random):
    """Two substances that react and diffuse (Gray and Scott): spots that divide."""
    u, v = np.ones((edge,) * 3, np.float32), np.zeros((edge,) * 3, np.float32)
    for z, y, x in random.integers(0, edge - 8, (12, 3)):
        u[z : z + 8, y : y + 8, x : x + 8], v[z : z + 8, y : y + 8, x : x + 8] = 0.5, 0.25
    for frame in range(frames):
        for _ in range(300 if frame == 0 else 25):
            rate = u * v * v
            u += 0.14 * laplacian(u) - rate + 0.03 * (1 - u)
            v += 0.07 * laplacian(v) + rate - 0.092 * v
        yield v


def sound(frames, edge, random, layered=False):
    """Pressure of short pulses, by second-order differences; in layers of other speeds they are reflected."""
    speed = np.full((edge, 1, 1), 0.16, np.float32)
    if layered:
        speed[:] = np.repeat(random.uniform(0.05, 0.25, 8), -(-edge // 8))[:edge, None, None]
    z, y, x = lattice(edge)
    now = np.zeros((edge,) * 3, np.float32)
    for at in random.uniform(0.25, 0.75, (3, 3)):
        now += np.exp(-((z - at[0]) ** 2 + (y - at[1]) ** 2 + (x - at[2]) ** 2) / 0.002).astype(np.float32)
    before = now.copy()
    for _ in range(frames):
        for _ in range(3):
            now, before = 2 * now - before + speed * laplacian(now), now
        yield now


def shocks(frames, edge, random):
    """Velocity that steepens to shocks (Burgers), by local Lax-Friedrichs fluxes of first order."""
    u = smooth_noise(random, (edge,) * 3, edge / 12)
    for _ in range(frames):
        for _ in range(4):
            change = 0
            for axis in range(3):
                ahead = shifted(u, axis, 1)
                flux = 0.25 * (u * u + ahead * ahead) - 0.5 * np.maximum(abs(u), abs(ahead)) * (ahead - u)
                change = change + flux - shifted(flux, axis, -1)
            u = u - 0.08 * change
        yield u


def phases(frames, edge, random):
    """A mixture that separates (Cahn and Hilliard), by spectral steps."""
    c = 0.1 * random.standard_normal((edge,) * 3).astype(np.float32)
    k = 2 * np.pi * np.fft.fftfreq(edge)
    squares = k[:, None, None] ** 2 + k[None, :, None] ** 2 + k[None, None, : edge // 2 + 1] ** 2
    for frame in range(frames):
        for _ in range(40 if frame == 0 else 12):
            force = fft.rfftn(c**3 - c)
            c = fft.irfftn((fft.rfftn(c) - 0.5 * squares * force) / (1 + 0.5 * squares**2), s=c.shape)
        yield c


def smoke(frames, edge, random):
    """A scalar of sharp blobs, carried by a swirl (semi-Lagrangian steps)."""
    z, y, x = np.broadcast_arrays(*lattice(edge))
    field = (smooth_noise(random, (edge,) * 3, edge / 20) > 1).astype(np.float32)
    swirl = [np.sin(2 * np.pi * b) * np.cos(2 * np.pi * a) for a, b in ((z, y), (y, x), (x, z))]
    back = [np.indices(field.shape)[a] - 0.7 * swirl[a] for a in range(3)]
    for _ in range(frames):
        field = ndimage.map_coordinates(field, back, order=1, mode="grid-wrap")
        yield field


def heat(frames, edge, random):
    """Boxes of temperatures that diffuse."""
    field = np.zeros((edge,) * 3, np.float32)
    for low, value in zip(random.integers(0, edge // 2, (8, 3)), random.uniform(-1, 1, 8), strict=True):
        field[tuple(slice(a, a + edge // 3) for a in low)] += value
    for _ in range(frames):
        for _ in range(5):
            field = field + 0.12 * laplacian(field)
        yield field


def cavity(frames, edge, random):
    """The field E_z of modes in a conducting box, of many frequencies."""
    z, y, x = lattice(edge)
    modes = [
        (*random.integers(1, 7, 3), *random.uniform(0, 2 * np.pi, 1), *random.uniform(0.2, 1, 1)) for _ in range(20)
    ]
    for frame in range(frames):
        field = 0
        for kz, ky, kx, phase, amplitude in modes:
            turning = np.cos(0.12 * np.sqrt(kz**2 + ky**2 + kx**2) * frame + phase)
            shape = np.cos(np.pi * kz * z) * np.sin(np.pi * ky * y) * np.sin(np.pi * kx * x)
            field = field + amplitude * turning * shape
        yield field


def distances(frames, edge, random):
    """The distance from moving balls, below 0 inside: smooth, but for kinks."""
    z, y, x = lattice(edge)
    balls = random.uniform(0, 1, (6, 7))
    for frame in range(frames):
        field = np.full((edge,) * 3, 9, np.float32)
        for bz, by, bx, vz, vy, vx, r in balls:
            at = [0.5 + 0.4 * np.sin(6 * b + 0.05 * frame * v) for b, v in ((bz, vz), (by, vy), (bx, vx))]
            far = np.sqrt((z - at[0]) ** 2 + (y - at[1]) ** 2 + (x - at[2]) ** 2)
            field = np.minimum(field, far - 0.05 - 0.1 * r)
        yield field


def heart(frames, edge, random):
    """A scan in integers: a body, a chamber that beats, and the noise of the detector."""
    z, y, x = (2 * a - 1 for a in lattice(edge))
    for frame in range(frames):
        beat = 0.3 + 0.06 * np.sin(2 * np.pi * frame / 20)
        body = np.where((x / 0.9) ** 2 + (y / 0.7) ** 2 + (z / 1.2) ** 2 < 1, 40, -1000)
        wall = x**2 + y**2 + (z / 1.3) ** 2
        body = np.where(wall < (beat + 0.1) ** 2, 120, body)
        body = np.where(wall < beat**2, 300, body)
        noise = ndimage.gaussian_filter(random.standard_normal(body.shape), 0.6) * 50
        yield np.rint(body + noise).astype(np.int16)


def weather(frames, edge, random):
    """Temperatures of a globe's surface: latitudes, mountains, seasons, and weather that moves and decays."""
    shape = (1, edge, 2 * edge)
    latitude = np.linspace(-np.pi / 2, np.pi / 2, edge)[None, :, None]
    mountains = np.maximum(smooth_noise(random, shape, (0, 2, 2)), 0) ** 2
    state = smooth_noise(random, shape, (0, 4, 4))
    for frame in range(frames):
        state = 0.9 * np.roll(state, 1, 2) + np.sqrt(1 - 0.81) * smooth_noise(random, shape, (0, 4, 4))
        season = np.sin(2 * np.pi * frame / 365) * np.sin(latitude)
        yield 288 - 50 * np.sin(latitude) ** 2 - 12 * season - 8 * mountains + 4 * state


def ocean(frames, edge, random):
    """Salinity in a few layers of a sea with land, where samples are missing."""
    shape = (8, edge, edge)
    land = smooth_noise(random, (edge, edge), 6) > np.linspace(1.2, 0.4, 8)[:, None, None]
    eddies = [smooth_noise(random, shape, (1, 3, 3)) for _ in range(2)]
    base = 35 - 2 * np.exp(-np.arange(8) / 2)[:, None, None]
    for frame in range(frames):
        carried = (
            ndimage.shift(e, (0, 0, s * frame), order=1, mode="grid-wrap")
            for e, s in zip(eddies, (0.4, -0.25), strict=True)
        )
        yield np.where(land, np.nan, base + 0.3 * sum(carried))


def gauges(frames, edge, random):
    """Water levels at a few places over years: tides, surges and noise."""
    shape, surge = (edge,) * 3, np.zeros((edge,) * 3)
    phases_of = random.uniform(0, 1, (3, *shape))
    for hour in range(frames):
        surge = 0.98 * surge + 0.05 * random.standard_normal(shape)
        tides = (
            a * np.sin(2 * np.pi * (hour / p + f))
            for a, p, f in zip((1, 0.4, 0.2), (12.42, 12, 25.8), phases_of, strict=True)
        )
        yield sum(tides) + surge + 0.01 * random.standard_normal(shape)


def galaxies(frames, edge, random):
    """The density of particles that fall together, as logarithms of counts: mostly nothing, and noise."""
    at = random.uniform(0, edge, (edge**3 // 2, 3)).astype(np.float32)
    pull = [ndimage.gaussian_filter(random.standard_normal((edge,) * 3), edge / 16, mode="wrap") for _ in range(3)]
    pull = [0.15 * p / p.std() for p in pull]
    for _ in range(frames):
        cells = tuple(at.astype(int).T % edge)
        at += np.stack([p[cells] for p in pull], axis=1)
        counts = np.zeros((edge,) * 3, np.float32)
        np.add.at(counts, tuple(at.astype(int).T % edge), 1)
        yield np.log1p(counts)


def grains(frames, edge, random):
    """Labels of crystals that grow from seeds until they touch; 0 is the melt."""
    seeds = np.zeros((edge,) * 3, np.uint8)
    seeds[tuple(random.integers(0, edge, (3, 150)))] = random.integers(1, 255, 150)
    far, nearest = ndimage.distance_transform_edt(seeds == 0, return_indices=True)
    for frame in range(frames):
        yield np.where(far < 0.4 * frame + 1, seeds[tuple(nearest)], 0).astype(np.uint8)


def seeded(generator, seed, **settings):
    """The generator with its random numbers."""
    return lambda frames, edge: generator(frames, edge, np.random.default_rng(seed), **settings)


# Name: the generator, its frames and its voxels along an axis.
KINDS = {
    "reaction": (seeded(reaction, 1), 32, 80),
    "sound": (seeded(sound, 2), 32, 96),
    "layers": (seeded(sound, 3, layered=True), 32, 96),
    "shocks": (seeded(shocks, 4), 32, 80),
    "phases": (seeded(phases, 5), 32, 64),
    "smoke": (seeded(smoke, 6), 32, 80),
    "heat": (seeded(heat, 7), 48, 72),
    "cavity": (seeded(cavity, 8), 64, 64),
    "distances": (seeded(distances, 9), 48, 80),
    "heart": (seeded(heart, 10), 40, 64),
    "weather": (seeded(weather, 11), 365, 72),
    "ocean": (seeded(ocean, 12), 60, 128),
    "gauges": (seeded(gauges, 13), 7300, 2),
    "galaxies": (seeded(galaxies, 14), 24, 80),
    "grains": (seeded(grains, 15), 24, 64),
}
