//! Schemes: the transform and the pyramid that code the blocks of a window.

use crate::wavelet::{self, TimeBasis};
pub use wavesplat_format::{Axis, Basis, Pyramid, Stencil, Window};

/// How the blocks of one window are coded.
#[derive(Debug, Clone, PartialEq)]
pub struct Scheme {
    /// The transform along time.
    pub basis: Basis,
    /// The learned functions, if the basis is [`Basis::Learned`].
    pub functions: Vec<i16>,
    /// The pyramid that refines coefficients or samples; without one, each is coded by itself.
    pub pyramid: Option<Pyramid>,
    /// The step, relative to the step for which rounding alone stays within the bound. Samples that then miss the bound
    /// are stored exactly.
    pub coarseness: f64,
}

impl Scheme {
    /// Only a transform along time, as in [Dobashi](crate::bibliography).
    pub fn along_time(basis: Basis) -> Self {
        Self { basis, functions: Vec::new(), pyramid: None, coarseness: 1.0 }
    }

    /// The scheme of a window of a file.
    pub fn from_window(window: &Window) -> Self {
        let (functions, pyramid) = (window.functions.clone(), window.pyramid.clone());
        Self { basis: window.basis, functions, pyramid, coarseness: window.coarseness }
    }

    /// The transform along time of a window of `frames` frames.
    pub(crate) fn time_basis(&self, frames: usize) -> Box<dyn TimeBasis> {
        wavelet::basis(self.basis, &self.functions, frames)
    }

    /// A name for reports: the transform, and the pyramid's stencil and axes.
    pub fn name(&self) -> String {
        let Some(pyramid) = &self.pyramid else { return self.basis.name().into() };
        let axes: String = pyramid.order.iter().map(|axis| format!("{axis:?}").to_lowercase()).collect();
        let stencil = format!("{:?}", pyramid.stencil).to_lowercase();
        match self.basis {
            Basis::Samples => format!("pyramid ({stencil} {axes})"),
            basis => format!("{} + pyramid ({stencil} {axes})", basis.name()),
        }
    }
}
