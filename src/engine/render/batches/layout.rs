//! The planes of a frame batch: the sums that a view keeps for each pixel, and their order.

/// The planes of a frame batch, one after another: coefficients, values of single frames, weights of samples missing in
/// single frames, weights of samples missing in all frames, and errors.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Number of coefficient planes.
    pub coefficients: usize,
    /// Number of frames in the batch.
    pub frames: usize,
    /// Whether each frame has a plane of values.
    pub values: bool,
    /// Whether samples are missing.
    pub absent: bool,
    /// Number of error planes; 0 unless pictures are certified.
    pub error_planes: usize,
    /// How tiles store the planes.
    pub order: Order,
}

impl Layout {
    /// The layout with one plane of values for each of `frames` frames, and no other planes.
    pub fn of_values(frames: usize) -> Self {
        let (coefficients, error_planes, order) = (0, 0, Order::Pixels);
        Self { coefficients, frames, values: true, absent: false, error_planes, order }
    }

    /// The index of a frame's plane of values.
    pub fn value(&self, frame: usize) -> usize {
        self.coefficients + frame
    }

    /// Number of planes whose sums are values.
    pub fn value_planes(&self) -> usize {
        self.coefficients + if self.values { self.frames } else { 0 }
    }

    /// The index of a frame's plane of missing weights.
    pub fn absent(&self, frame: usize) -> usize {
        self.value_planes() + frame
    }

    /// The frame of a plane of values or of missing weights, and whether it holds missing weights; `None` for other
    /// planes.
    pub(in crate::render) fn samples(&self, plane: usize) -> Option<(usize, bool)> {
        let frame = |first: usize, there: bool| plane.checked_sub(first).filter(|f| there && *f < self.frames);
        let absent = || frame(self.absent(0), self.absent).map(|f| (f, true));
        frame(self.value(0), self.values).map(|f| (f, false)).or_else(absent)
    }

    /// The index of the plane of weights missing in all frames.
    pub fn absent_in_all(&self) -> usize {
        self.value_planes() + self.frames
    }

    /// The index of the first error plane.
    pub fn first_error(&self) -> usize {
        self.value_planes() + if self.absent { self.frames + 1 } else { 0 }
    }

    /// Number of planes.
    pub fn planes(&self) -> usize {
        self.first_error() + self.error_planes
    }
}

/// How the planes of a tile lie in memory. The sums do not depend on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Plane by plane: fast if voxels have values in few planes; splats a row of pixels at a time.
    Planes,
    /// Pixel by pixel: fast if voxels have values in most planes; splats all planes of a pixel at a time.
    Pixels,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_follow_one_another() {
        let layout =
            Layout { coefficients: 5, frames: 3, values: true, absent: true, error_planes: 2, order: Order::Planes };
        assert_eq!((layout.value(0), layout.absent(0), layout.absent_in_all()), (5, 8, 11));
        assert_eq!((layout.first_error(), layout.planes()), (12, 14));
        let plain = Layout { values: false, absent: false, error_planes: 0, ..layout };
        assert_eq!(plain.planes(), 5);
    }
}
