//! The planes of a frame batch: which sums a view keeps for each pixel, and in which order.

/// The planes of a batch, one after another: coefficients, then values of single frames, then weights of what is
/// missing in single frames and of what is missing in all of them, then errors, and last lengths.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Layout {
    /// Planes of coefficients.
    pub coefficients: usize,
    /// Frames of the batch.
    pub frames: usize,
    /// Whether values are splatted into single frames.
    pub values: bool,
    /// Whether anything is missing.
    pub absent: bool,
    /// Planes of errors; none unless pictures are certified.
    pub error_planes: usize,
    /// Whether the last plane is of the weights of all voxels: lengths of the rays.
    pub lengths: bool,
    /// How tiles should keep the planes.
    pub order: Order,
}

impl Layout {
    /// One plane of values for each of `frames` frames, and nothing else.
    pub fn of_values(frames: usize) -> Self {
        let (coefficients, error_planes, order) = (0, 0, Order::Pixels);
        Self { coefficients, frames, values: true, absent: false, error_planes, lengths: false, order }
    }

    /// The plane of the values of a frame.
    pub fn value(&self, frame: usize) -> usize {
        self.coefficients + frame
    }

    /// Number of planes whose sums are values.
    pub fn value_planes(&self) -> usize {
        self.coefficients + if self.values { self.frames } else { 0 }
    }

    /// The plane of the weights that are missing in a frame.
    pub fn absent(&self, frame: usize) -> usize {
        self.value_planes() + frame
    }

    /// Whose samples a plane holds: the frame, and whether those are weights that are missing.
    pub(super) fn samples(&self, plane: usize) -> Option<(usize, bool)> {
        let of = |first: usize, there: bool| plane.checked_sub(first).filter(|f| there && *f < self.frames);
        let absent = || of(self.absent(0), self.absent).map(|f| (f, true));
        of(self.value(0), self.values).map(|f| (f, false)).or_else(absent)
    }

    /// The plane of the weights that are missing in all frames.
    pub fn absent_in_all(&self) -> usize {
        self.value_planes() + self.frames
    }

    /// The first plane of errors.
    pub fn first_error(&self) -> usize {
        self.value_planes() + if self.absent { self.frames + 1 } else { 0 }
    }

    /// Number of planes.
    pub fn planes(&self) -> usize {
        self.first_error() + self.error_planes + usize::from(self.lengths)
    }
}

/// How the planes of a tile lie in memory. No sum depends on it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// Plane by plane: fast where voxels have terms in few planes, a row of pixels at a time.
    Planes,
    /// Pixel by pixel: fast where voxels have terms in most planes, all planes of a pixel at a time.
    Pixels,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn planes_follow_one_another() {
        let layout = Layout {
            coefficients: 5,
            frames: 3,
            values: true,
            absent: true,
            error_planes: 2,
            lengths: false,
            order: Order::Planes,
        };
        assert_eq!((layout.value(0), layout.absent(0), layout.absent_in_all()), (5, 8, 11));
        assert_eq!((layout.first_error(), layout.planes()), (12, 14));
        let plain = Layout { values: false, absent: false, error_planes: 0, ..layout };
        assert_eq!(plain.planes(), 5);
    }
}
